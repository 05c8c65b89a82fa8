// The namespace that all parts of the page share: data, elements, numbers, tables, addresses.
// Every file keeps its own names to itself in a block.
const bench = {};
{
  const NOTHING = "–";

  function put(node, attrs, children) {
    for (const [name, value] of Object.entries(attrs)) {
      if (value === null || value === undefined || value === false) continue;
      if (typeof value === "function") node.addEventListener(name.replace(/^on/, ""), value);
      else if (/^on/i.test(name)) throw new Error(`${name} takes a function`);
      else if (name === "href" && !String(value).startsWith("#")) throw new Error("links stay on the page");
      else if (name === "style") for (const [k, v] of Object.entries(value)) node.style.setProperty(k, v);
      else node.setAttribute(name, value === true ? "" : String(value));
    }
    // What is no node becomes text, never markup.
    node.append(...children.flat(Infinity).filter((child) => (child ?? false) !== false));
    return node;
  }
  const el = (tag, attrs = {}, ...children) => put(document.createElement(tag), attrs, children);
  const svg = (tag, attrs = {}, ...children) => put(document.createElementNS("http://www.w3.org/2000/svg", tag), attrs, children);

  // Return the text of a number with some significant digits, a dash for nothing.
  const number = (value, digits = 3) => {
    if (!Number.isFinite(value)) return NOTHING;
    const size = Math.abs(value);
    if (size === 0) return "0";
    if (size < 1e-4 || size >= 1e7) return minus(value.toExponential(Math.max(digits - 2, 0)).replace("e+", "e"));
    const whole = Math.floor(Math.log10(Number(size.toPrecision(digits)))) + 1;
    return minus(value.toFixed(Math.max(digits - whole, 0)));
  };
  const minus = (text) => text.replace(/-/g, "−");
  const count = (value) => (!Number.isFinite(value) ? NOTHING : minus(Number.isInteger(value) ? String(value) : value.toFixed(1)));
  Object.assign(bench, {
    el, svg, number, count,
    // Parts of a whole have three decimals; rounding errors are none, and nothing either.
    share: (value) => (Number.isFinite(value) ? minus(value.toFixed(3).replace(/^-(?=0\.000$)/, "")) : NOTHING),
    small: (value) => (value > 0 && value < 0.001 ? "< 0.001" : number(value)),
    hertz: (value) => (!Number.isFinite(value) ? NOTHING : value < 0 ? `${(-value).toFixed(1)} i` : value.toFixed(1)),
    percent: (value, digits) => `${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(digits)}`,
    plural: (n, one, many = `${one}s`) => `${count(n)} ${n === 1 ? one : many}`,
    shortened(text, width, end = false) {
      // A place on a member, "name@0.25", is distinguished from the next one by its end.
      const tail = end && text.includes("@") ? text.slice(text.lastIndexOf("@")) : "";
      if (text.length <= width) return text;
      return tail.length < width - 2 ? `${text.slice(0, width - tail.length - 1)}…${tail}` : `${text.slice(0, width - 1)}…`;
    },
    median(values) {
      const sorted = Float64Array.from(values).sort();
      const half = sorted.length >> 1;
      return !sorted.length ? null : sorted.length % 2 ? sorted[half] : (sorted[half - 1] + sorted[half]) / 2;
    },
  });

  const WORDS = {
    ok: ["✓", "ok"], failed: ["✕", "failed"], diverged: ["✕", "diverged"], timeout: ["✕", "ran out of time"],
    crashed: ["✕", "crashed"], "not-applicable": ["○", "not applicable"], missing: ["✕", "no result"],
  };
  // Return how a job ended, in words, and with its sign before them.
  bench.statusWord = (status) => (WORDS[status] ?? ["?", String(status)])[1];
  bench.statusText = (status) => `${(WORDS[status] ?? ["?"])[0]} ${bench.statusWord(status)}`;

  // Addresses: #board and #case/<name>, the name as a URI component.
  bench.caseHref = (name) => `#case/${encodeURIComponent(name)}`;
  bench.caseLink = ({ name }) => el("a", { href: bench.caseHref(name) }, name);
  bench.route = (hash = location.hash) => {
    if (!hash.startsWith("#case/")) return { page: "board", name: null };
    try {
      return { page: "case", name: decodeURIComponent(hash.slice(6)) };
    } catch {
      return { page: "case", name: hash.slice(6) };
    }
  };

  bench.button = (text, onclick, more) => el("button", { type: "button", class: "button", onclick, ...more }, text);
  bench.tick = (label, checked, change) => el("label", {}, el("input", { type: "checkbox", checked, onchange: ({ target }) => change(target.checked) }), ` ${label}`);
  bench.select = (label, options, chosen, change) => el("select", { "aria-label": label, onchange: ({ target }) => change(target.value) },
    options.map(([value, text]) => el("option", { value, selected: value === chosen }, text)));
  // Return what is made once it is unfolded.
  bench.fold = (summary, make, name) => {
    const node = el("details", { class: name, ontoggle: () => node.children.length < 2 && node.append(make()) }, el("summary", {}, summary));
    return node;
  };

  // Return a cell with a figure; one with its share of a colour, -1 (blue) to 1 (vermilion).
  const cell = (value, say = number, attrs = {}) => el("td", { "data-value": value ?? "", ...attrs, class: `right ${attrs.class ?? ""}` }, say(value ?? null));
  bench.cell = cell;
  bench.tone = (share) => ({ "--tone": share < 0 ? "var(--blue)" : "var(--vermilion)", "--share": `${Math.round(Math.abs(share) * 45)}%` });

  // Return a table of cells or texts; the first of every row is its head.
  bench.table = (label, heads, rows, name) => {
    const isRight = (k) => rows[0]?.[k]?.classList?.contains("right");
    const line = ([first, ...rest]) => el("tr", {}, first.tagName === "TH" ? first : el("th", { scope: "row" }, first), rest.map((one) => (one?.tagName === "TD" ? one : el("td", {}, one))));
    return el("table", { class: name, "aria-label": label },
      el("thead", {}, el("tr", {}, heads.map((head, k) => el("th", { scope: "col", class: isRight(k) ? "right" : null }, head)))),
      el("tbody", {}, rows.map(line)));
  };
  // Return a region that scrolls a table sideways by itself, by keyboard too; where all fits it does not,
  // so that heads of tables stick to the window.
  bench.scroll = (table) => {
    const region = el("div", { class: "wide", role: "region", tabindex: "0", "aria-label": table.getAttribute("aria-label") }, table);
    const watch = new ResizeObserver(() => region.classList.toggle("fits", table.offsetWidth <= region.clientWidth));
    for (const node of [region, table]) watch.observe(node);
    return region;
  };

  bench.data = JSON.parse(document.getElementById("data").textContent);
}
