/* Matrices: a small one as a table of numbers and squares, a large one as a picture with axes. */
{
  // Viridis, a palette that stays in order in grey and for the colour-blind; on a light page dark is
  // large, on a dark one bright.
  const STOPS = [
    [253, 231, 37], [160, 218, 57], [74, 193, 109], [31, 161, 135], [39, 127, 142],
    [54, 92, 141], [70, 50, 127], [68, 1, 84],
  ];

  const scheme = matchMedia("(prefers-color-scheme: dark)");

  /** Return the colour of a share 0..1 as [red, green, blue]. */
  const colour = (share, dark = scheme.matches) => {
    const inside = Math.min(Math.max(share, 0), 1);
    const at = (dark ? 1 - inside : inside) * (STOPS.length - 1);
    const low = Math.min(Math.floor(at), STOPS.length - 2);
    return STOPS[low].map((part, i) => Math.round(part + (at - low) * (STOPS[low + 1][i] - part)));
  };

  // Canvases know nothing of style sheets: those still in use are drawn again.
  const redraws = new WeakMap();
  const canvases = new Set();
  scheme.addEventListener("change", () => {
    for (const held of canvases) {
      const canvas = held.deref();
      if (canvas) redraws.get(canvas)();
      else canvases.delete(held);
    }
  });
  const whenColoursChange = (canvas, redraw) => {
    redraws.set(canvas, redraw);
    canvases.add(new WeakRef(canvas));
  };

  const css = (share, dark) => `rgb(${colour(share, dark).join(",")})`;
  /** Return the style of an element of class case-shade or case-stroke. */
  const shade = (share) => ({ "--shade-light": css(share, false), "--shade-dark": css(share, true) });

  /** Return 10^k as text with a raised exponent. */
  const power = (exponent) => {
    const raised = { "-": "\u207b", 0: "\u2070", 1: "\u00b9", 2: "\u00b2", 3: "\u00b3", 4: "\u2074",
      5: "\u2075", 6: "\u2076", 7: "\u2077", 8: "\u2078", 9: "\u2079" };
    return "10" + [...String(exponent)].map((sign) => raised[sign]).join("");
  };

  /** Return a number as m x 10^k. */
  const scientific = (value) => {
    const exponent = Math.floor(Math.log10(value));
    return `${(value / 10 ** exponent).toFixed(1)} \u00d7 ${power(exponent)}`;
  };

  /**
   * Return a table whose cells show a number 0..1 and a square of that size and shade.
   *
   * spec: caption, rowTitle, columnTitle, rows, columns (labels), values (rows of numbers or null),
   * pairs (the column of every row's partner, or null), digits.
   */
  const table = (spec) => {
    const el = bench.el;
    const cell = (value, row, column) => {
      const paired = spec.pairs && spec.pairs[row] === column;
      if (value === null || value === undefined) return el("td", {}, "\u2013");
      const size = `${(1.3 * Math.sqrt(Math.min(Math.max(value, 0), 1))).toFixed(2)}rem`;
      const square = el("span", { class: "case-square case-shade", "aria-hidden": "true", style: { width: size, height: size, ...shade(value) } });
      const box = el("span", { class: "case-square-box", "aria-hidden": "true" }, square);
      const number = el("span", { class: "case-number" }, value.toFixed(spec.digits ?? 2));
      const word = paired ? el("span", { class: "case-hidden" }, " pair") : "";
      return el("td", { class: paired ? "case-pair" : "" }, box, number, word);
    };
    const head = el("tr", {},
      el("th", { scope: "col" }, `${spec.rowTitle} \\ ${spec.columnTitle}`),
      ...spec.columns.map((label) => el("th", { scope: "col" }, label)));
    const rows = spec.values.map((values, row) => el("tr", {},
      el("th", { scope: "row" }, spec.rows[row]), ...values.map((value, column) => cell(value, row, column))));
    const table = el("table", { class: "case-heat", "aria-label": spec.caption }, el("thead", {}, head), el("tbody", {}, ...rows));
    return el("div", {}, el("p", { class: "case-hint" }, spec.caption), bench.scroll(spec.caption, table));
  };

  const bytes = (text) => Uint8Array.from(atob(text), (sign) => sign.charCodeAt(0));

  // A place on a member, "name@0.25", is told from the next one by its end.
  const clipped = (label, width) => {
    const end = label.includes("@") ? label.slice(label.lastIndexOf("@")) : "";
    return end.length < width - 2 ? bench.shortened(label.slice(0, label.length - end.length), width - end.length) + end : bench.shortened(label, width);
  };

  /** Return the labels that fit along an axis: [index, text], with room for their own size in px. */
  const fitting = (labels, cell, sizeOf, most = Infinity) => {
    const shown = [];
    let end = -Infinity;
    labels.forEach((label, i) => {
      const half = sizeOf(label) / 2 + 3;
      if ((i + 0.5) * cell - half < end || (i + 0.5) * cell + half > most) return;
      end = (i + 0.5) * cell + half;
      shown.push([i, label]);
    });
    return shown;
  };

  const paint = (matrix, size) => {
    const canvas = document.createElement("canvas");
    canvas.width = canvas.height = size;
    const context = canvas.getContext("2d");
    const image = context.createImageData(size, size);
    matrix.forEach((byte, i) => {
      if (byte > 0) image.data.set([...colour(byte / 255), 255], 4 * i);
    });
    context.putImageData(image, 0, 0);
    return canvas;
  };

  /** Draw picture, axes and colour bar; return the frame of the picture in CSS px. */
  const draw = (canvas, spec, picture, cursor) => {
    const width = canvas.clientWidth;
    const ratio = window.devicePixelRatio || 1;
    const labels = spec.labels.map((label) => clipped(String(label), 13));
    const left = 16 + 7.2 * Math.max(...labels.map((label) => label.length));
    const top = 36;
    const right = 78;
    const side = Math.max(width - left - right, 40);
    const height = top + side + 12;
    canvas.style.height = `${height}px`;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    const pen = canvas.getContext("2d");
    const style = getComputedStyle(canvas);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.imageSmoothingEnabled = false;
    pen.drawImage(picture, left, top, side, side);
    pen.strokeStyle = pen.fillStyle = style.color;
    pen.lineWidth = 1;
    pen.strokeRect(left - 0.5, top - 0.5, side + 1, side + 1);
    pen.font = `12px ${style.fontFamily}`;
    pen.textBaseline = "middle";
    const cell = side / spec.size;
    pen.textAlign = "right";
    for (const [i, text] of fitting(labels, cell, () => 9)) pen.fillText(text, left - 5, top + (i + 0.5) * cell);
    pen.textAlign = "center";
    for (const [i, text] of fitting(labels, cell, (label) => pen.measureText(label).width, side + 8)) pen.fillText(text, left + (i + 0.5) * cell, top - 9);
    pen.fillText(spec.axis, left + side / 2, 9);
    bar(pen, spec, left + side + 14, top, side);
    if (cursor) {
      pen.lineWidth = 2;
      pen.strokeRect(left + cursor[1] * cell, top + cursor[0] * cell, cell, cell);
    }
    return { left, top, side, cell };
  };

  const bar = (pen, spec, x, top, side) => {
    for (let y = 0; y < side; y += 1) {
      pen.fillStyle = css(1 - y / side);
      pen.fillRect(x, top + y, 12, 1.5);
    }
    pen.fillStyle = pen.strokeStyle;
    pen.strokeRect(x - 0.5, top - 0.5, 13, side + 1);
    pen.textAlign = "left";
    pen.fillText(spec.unit, x - 4, top - 14);
    const span = spec.highest - spec.lowest || 1;
    for (let k = Math.ceil(spec.lowest); k <= spec.highest; k += 1) {
      const y = top + side * (1 - (k - spec.lowest) / span);
      pen.beginPath();
      pen.moveTo(x + 12, y);
      pen.lineTo(x + 16, y);
      pen.stroke();
      pen.fillText(power(k), x + 19, y);
    }
  };

  /** Return the entries on and above the diagonal, the largest first. */
  const largest = (matrix, size, count) => {
    const found = [];
    for (let i = 0; i < size; i += 1) {
      for (let j = i; j < size; j += 1) if (matrix[i * size + j]) found.push([i, j, matrix[i * size + j]]);
    }
    return found.sort((a, b) => b[2] - a[2]).slice(0, count);
  };

  /**
   * Return a picture of a symmetric matrix on a logarithmic scale, its largest entries as text.
   *
   * spec: title, axis (what rows and columns are), labels, values (base64 of size x size bytes),
   * size, lowest, highest (log10 of the value of byte 0 and 255), unit.
   */
  const image = (spec) => {
    const el = bench.el;
    const matrix = bytes(spec.values);
    let picture = paint(matrix, spec.size);
    const value = (byte) => 10 ** (spec.lowest + (byte / 255) * (spec.highest - spec.lowest));
    const entry = (i, j) => {
      const byte = matrix[i * spec.size + j];
      const size = byte ? `${scientific(value(byte))} ${spec.unit}` : `none, or below ${scientific(value(0))} ${spec.unit}`;
      return `${spec.labels[i]} \u2013 ${spec.labels[j]}: ${size}`;
    };
    const canvas = el("canvas", { class: "case-canvas case-matrix", tabindex: "0", role: "application",
      "aria-label": `${spec.title}. Arrow keys move over the entries.` });
    const told = el("p", { class: "case-told", role: "status" }, "Point at an entry, or focus the picture and use the arrow keys.");
    let cursor = null;
    let frame = null;
    const redraw = () => {
      if (canvas.clientWidth) frame = draw(canvas, spec, picture, cursor);
    };
    const show = (row, column) => {
      const inside = (k) => Math.min(Math.max(k, 0), spec.size - 1);
      cursor = [inside(row), inside(column)];
      told.textContent = entry(...cursor);
      redraw();
    };
    const moves = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] };
    canvas.addEventListener("keydown", (event) => {
      const move = moves[event.key];
      if (!move) return;
      event.preventDefault();
      show((cursor ? cursor[0] : -1) + move[0], (cursor ? cursor[1] : -1) + move[1]);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!frame) return;
      const at = canvas.getBoundingClientRect();
      const [row, column] = [(event.clientY - at.top - frame.top) / frame.cell, (event.clientX - at.left - frame.left) / frame.cell];
      if (Math.min(row, column) >= 0 && Math.max(row, column) < spec.size) show(Math.floor(row), Math.floor(column));
    });
    new ResizeObserver(redraw).observe(canvas);
    whenColoursChange(canvas, () => {
      picture = paint(matrix, spec.size);
      redraw();
    });
    const top = largest(matrix, spec.size, 5).map(([i, j]) => el("li", {}, entry(i, j)));
    return el("figure", { class: "case-figure" }, el("figcaption", {}, spec.title), canvas, told,
      el("p", { class: "case-list-title" }, "Largest entries"), el("ol", { class: "case-list" }, ...top));
  };

  bench.heat = { table, image, shade, scientific, whenColoursChange };
}
