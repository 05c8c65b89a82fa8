"use strict";
// The namespace that all parts of the page share: data, elements, numbers, looks, addresses.
// Every file keeps its own names to itself in a block.
const bench = {};
{
  const SVG = "http://www.w3.org/2000/svg";
  const NOTHING = "–";

  function put(node, attrs, children) {
    for (const [name, value] of Object.entries(attrs || {})) {
      if (value === null || value === undefined || value === false) continue;
      if (typeof value === "function") node.addEventListener(name.replace(/^on/, ""), value);
      else if (/^on/i.test(name)) throw new Error(`${name} takes a function`);
      else if (name === "href" && !String(value).startsWith("#")) throw new Error("links stay on the page");
      else if (name === "style") for (const [k, v] of Object.entries(value)) node.style.setProperty(k, v);
      else node.setAttribute(name, value === true ? "" : String(value));
    }
    for (const child of children.flat(Infinity)) {
      if (child === null || child === undefined || child === false) continue;
      node.append(child instanceof Node ? child : document.createTextNode(String(child)));
    }
    return node;
  }

  // Return an element; text children become text, never markup.
  bench.el = (tag, attrs, ...children) => put(document.createElement(tag), attrs, children);
  bench.svg = (tag, attrs, ...children) => put(document.createElementNS(SVG, tag), attrs, children);

  // Return the text of a number with some significant digits, a dash for nothing.
  bench.number = (value, digits = 3) => {
    if (value === null || value === undefined || !Number.isFinite(value)) return NOTHING;
    const size = Math.abs(value);
    if (size === 0) return "0";
    if (size < 1e-4 || size >= 1e7) return minus(value.toExponential(Math.max(digits - 2, 0)).replace("e+", "e"));
    const whole = Math.floor(Math.log10(Number(size.toPrecision(digits)))) + 1;
    return minus(value.toFixed(Math.max(digits - whole, 0)));
  };
  // Parts of a whole have three decimals; rounding errors are none, and nothing either.
  bench.share = (value) => (value === null || value === undefined ? NOTHING : minus(value.toFixed(3).replace(/^-(?=0\.000$)/, "")));
  bench.small = (value) => (value !== null && value > 0 && value < 0.001 ? "< 0.001" : bench.number(value));
  bench.hertz = (value) => {
    if (value === null || value === undefined) return NOTHING;
    return value < 0 ? `${(-value).toFixed(1)} i` : value.toFixed(1);
  };
  bench.count = (value) => {
    if (value === null || value === undefined || !Number.isFinite(value)) return NOTHING;
    return minus(Number.isInteger(value) ? String(value) : value.toFixed(1));
  };
  bench.plural = (n, one, many) => `${bench.count(n)} ${n === 1 ? one : many || `${one}s`}`;
  bench.shortened = (text, width, end = false) => {
    // A place on a member, "name@0.25", is told from the next one by its end.
    const tail = end && text.includes("@") ? text.slice(text.lastIndexOf("@")) : "";
    if (text.length <= width) return text;
    return tail.length < width - 2 ? `${text.slice(0, width - tail.length - 1)}…${tail}` : `${text.slice(0, width - 1)}…`;
  };

  function minus(text) {
    return text.replace(/-/g, "−");
  }

  // Return the letter of a group: a to z, then aa, ab, ...
  bench.letter = (n) => {
    const last = String.fromCharCode(97 + (n % 26));
    return n < 26 ? last : bench.letter(Math.floor(n / 26) - 1) + last;
  };

  const WORDS = {
    ok: ["✓", "ok"],
    failed: ["✕", "failed"],
    diverged: ["✕", "diverged"],
    timeout: ["✕", "ran out of time"],
    crashed: ["✕", "crashed"],
    "not-applicable": ["○", "not applicable"],
    missing: ["✕", "no result"],
  };
  // Return how a job ended, in words, and with its sign before them.
  bench.statusWord = (status) => (WORDS[status] || ["?", String(status)])[1];
  bench.statusText = (status) => `${(WORDS[status] || ["?"])[0]} ${bench.statusWord(status)}`;

  // Okabe and Ito's colours (the first follows the text's) with a dash pattern and a marker each, so
  // that curves are told apart without colour.
  const COLOURS = ["blue", "vermilion", "green", "purple", "orange", "sky", "ink", "olive"];
  const DASHES = ["", "7 3", "2 3", "9 3 2 3", "12 4", "4 2 1 2 1 2", "1 2", "6 2 2 2 2 2"];
  const MARKERS = ["circle", "square", "triangle", "diamond", "cross", "plus", "down", "star"];
  bench.palette = {
    size: 8,
    // Return {colour, dash, marker, width} of the n-th curve of a role.
    style(n, role = "other") {
      if (role === "measured") return { colour: "var(--ink)", dash: "", marker: "circle", width: 2.4, hollow: true };
      if (role === "nominal") return { colour: "var(--soft)", dash: "5 4", marker: "square", width: 1.8, hollow: true };
      const k = n % 8;
      return { colour: `var(--${COLOURS[k]})`, dash: DASHES[k], marker: MARKERS[k], width: 1.9, hollow: n % 16 >= 8 };
    },
  };
  // Addresses: #board and #case/<name>, the name as a URI component.
  bench.caseHref = (name) => `#case/${encodeURIComponent(name)}`;
  bench.route = (hash = location.hash) => {
    if (!hash.startsWith("#case/")) return { page: "board", name: null };
    try {
      return { page: "case", name: decodeURIComponent(hash.slice(6)) };
    } catch {
      return { page: "case", name: hash.slice(6) };
    }
  };

  // Return a region that scrolls sideways by itself, by keyboard too; where all fits it does not, so that
  // heads of tables stick to the window.
  bench.scroll = (label, child) => {
    const region = bench.el("div", { class: "wide", role: "region", tabindex: "0", "aria-label": label }, child);
    const watch = new ResizeObserver(() => region.classList.toggle("fits", child.offsetWidth <= region.clientWidth));
    for (const node of [region, child]) watch.observe(node);
    return region;
  };

  bench.median = (values) => {
    if (!values.length) return null;
    const sorted = Float64Array.from(values).sort();
    const half = sorted.length >> 1;
    return sorted.length % 2 ? sorted[half] : (sorted[half - 1] + sorted[half]) / 2;
  };

  const source = document.getElementById("data");
  bench.data = source ? JSON.parse(source.textContent) : null;
}
