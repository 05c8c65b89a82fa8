"use strict";
// A button for SVG and one for PNG at every figure; what moves is an SVG that moves.
{
  const LOOK = ["fill", "fill-opacity", "stroke", "stroke-width", "stroke-dasharray", "stroke-opacity", "stroke-linecap", "stroke-linejoin", "opacity",
    "font-family", "font-size", "font-weight", "font-style", "text-anchor", "dominant-baseline", "paint-order", "visibility", "display", "vector-effect"];
  const PIXELS = 3; // of the PNG for one of the screen
  const node = (tag, attrs) => Object.entries(attrs).reduce((one, [name, value]) => (one.setAttribute(name, value), one), document.createElementNS(document.querySelector("svg").namespaceURI, tag));

  /** Return a copy that looks the same on its own; `drawing.film()` gives what moves, as [element, outlines of one cycle]. */
  function copyOf(drawing, moving) {
    const copy = drawing.cloneNode(true);
    const [old, own] = [drawing, copy].map((one) => [one, ...one.querySelectorAll("*")]);
    old.forEach((part, i) => {
      if (part.closest("defs")) return; // looks as what uses it
      const style = getComputedStyle(part);
      own[i].setAttribute("style", LOOK.map((name) => `${name}:${style.getPropertyValue(name)}`).join(";"));
    });
    if (moving) for (const [part, outlines] of drawing.film?.() ?? []) own[old.indexOf(part)].append(node("animate", { attributeName: "d", dur: "2s", repeatCount: "indefinite", values: outlines.join(";") }));
    const { width, height } = drawing.getBoundingClientRect();
    const box = drawing.getAttribute("viewBox") ?? `0 0 ${width} ${height}`;
    for (const [name, value] of Object.entries({ width, height, viewBox: box })) copy.setAttribute(name, value);
    const [x, y, w, h] = box.split(/[\s,]+/);
    copy.prepend(node("rect", { x, y, width: w, height: h, fill: getComputedStyle(document.body).backgroundColor }));
    return new XMLSerializer().serializeToString(copy);
  }
  function save(href, name) {
    Object.assign(document.createElement("a"), { href, download: name }).click();
  }
  function png(drawing, name) {
    const [image, canvas, { width, height }] = [new Image(), document.createElement("canvas"), drawing.getBoundingClientRect()];
    Object.assign(canvas, { width: PIXELS * width, height: PIXELS * height });
    image.onload = () => {
      canvas.getContext("2d").drawImage(image, 0, 0, canvas.width, canvas.height);
      save(canvas.toDataURL("image/png"), name);
    };
    image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(copyOf(drawing, false))}`;
  }
  function offer() {
    for (const drawing of document.querySelectorAll("figure svg:not([data-saved]), svg.case-view:not([data-saved])")) {
      if (drawing.parentElement.closest("svg, .legend")) continue;
      drawing.dataset.saved = "";
      const figure = drawing.closest("figure");
      const words = figure?.querySelector("figcaption b, figcaption")?.textContent ?? "structure";
      const name = words.trim().toLowerCase().replace(/[^a-z0-9]+/g, "-").slice(0, 40) || "figure";
      // A chart that was drawn again left its buttons.
      for (const left of figure?.querySelectorAll(".saves") ?? []) if (!left.drawing.isConnected) left.remove();
      const line = Object.assign(document.createElement("p"), { className: "saves", drawing });
      for (const [title, act] of [["SVG", () => save(`data:image/svg+xml;charset=utf-8,${encodeURIComponent(copyOf(drawing, true))}`, `${name}.svg`)], ["PNG", () => png(drawing, `${name}.png`)]]) {
        const button = Object.assign(document.createElement("button"), { type: "button", className: "button", textContent: title, title: `Save this figure as ${title}` });
        button.addEventListener("click", act);
        line.append(button);
      }
      figure ? figure.append(line) : drawing.after(line);
    }
  }
  document.addEventListener("DOMContentLoaded", () => {
    offer();
    new MutationObserver(offer).observe(document.getElementById("main"), { childList: true, subtree: true });
  });
}
