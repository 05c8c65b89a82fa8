// Figures on Observable Plot and d3, all of one schema (docs/reports.md). Every figure is one stop of the
// keyboard: the arrow keys step through its points, whose text stands below; a table holds all numbers.
{
  const { el, svg, number } = bench;
  const LETTER = 6.5; // px a letter takes at 12 px, about
  const MOST_MARKERS = 9;
  const MOST_LABELS = 60;
  const MOST_NAMED = 6; // curves with their names at their ends
  const FAR = 4; // an axis leaves out what lies farther away than so many times the spread of the rest
  const HINT = "Point at the chart, or focus it and use the arrow keys, to read its values.";
  // Okabe and Ito's colours (the first follows the text's) with a dash pattern and a marker each, so
  // that curves are distinguished without colour.
  const LOOKS = [["blue", "", "circle"], ["vermilion", "7 3", "square"], ["green", "2 3", "triangle"], ["purple", "9 3 2 3", "diamond"],
    ["orange", "12 4", "times"], ["sky", "4 2 1 2 1 2", "plus"], ["ink", "1 2", "wye"], ["olive", "6 2 2 2 2 2", "asterisk"]];
  const ROLES = { measured: ["ink", "", "circle", 2.4], nominal: ["soft", "5 4", "square", 1.8] };
  const LINES = new Set(["line", "steps", "calibration"]);

  const tickText = (v) => number(Number(v.toPrecision(3)), 3).replace(/(\.\d*?)0+$/, "$1").replace(/\.$/, "");
  const named = ({ label, unit }) => (label && unit ? `${label}, ${unit}` : label || null);
  const say = (v) => (typeof v === "number" ? number(v, 4) : String(v ?? "–"));
  const usable = (v, axis) => v !== null && Number.isFinite(v) && (!axis.log || v > 0);

  // Return how the lines and the markers of a series are drawn.
  function styleOf(series, n) {
    const [colour, dash, symbol, strokeWidth] = ROLES[series.role] ?? [...LOOKS[n % 8], 1.9];
    const [stroke, hollow] = [`var(--${colour})`, series.role in ROLES || n % 16 >= 8];
    return { line: { stroke, strokeWidth, strokeDasharray: dash || null },
      mark: { symbol, stroke, strokeWidth: 1.6, fill: /times|plus|asterisk/.test(symbol) ? "none" : hollow ? "var(--panel)" : stroke } };
  }

  // Return [low, high] of an axis: what was asked for, else that of the values but the few far off the rest.
  // core/plot/chart.py has the same rule.
  function rangeOf(values, axis, { pad = 0, few = 0, zero = false }) {
    const [there, back] = axis.log ? [Math.log10, (v) => 10 ** v] : [Number, Number];
    const sorted = d3.sort(values.filter((v) => usable(v, axis)).map(there));
    let [low, high] = sorted.length ? [sorted[0], sorted.at(-1)] : [0, 1];
    const [a, b] = [sorted[few], sorted.at(-1 - few)];
    if (sorted.length > 4 && b > a) {
      if (high - b > FAR * (b - a)) high = b;
      if (a - low > FAR * (b - a)) low = a;
    }
    if (zero && !axis.log) [low, high] = [Math.min(low, 0), Math.max(high, 0)];
    const grow = low === high ? (axis.log ? 0.3 : Math.abs(low) * 0.1 || 1) : (high - low) * pad;
    return [axis.low ?? back(zero && low === 0 ? 0 : low - grow), axis.high ?? back(zero && high === 0 ? 0 : high + grow)];
  }

  // Return how an axis is cut up: its names where it has any, else its numbers.
  function axisOf(axis, key, room, values, options) {
    const scale = { label: named(axis), type: axis.log ? "log" : "linear", clamp: true };
    const plain = { tickSize: 0, tickPadding: 6, className: "tick" };
    if (!axis.names) {
      const domain = rangeOf(values, axis, options);
      const most = values.every(Number.isInteger) ? domain[1] - domain[0] : Infinity;
      const ticks = Math.max(2, Math.min(most, Math.floor(room / (key === "x" ? 75 : 55))));
      return { scale: { ...scale, domain }, plain: { ...plain, ticks, tickFormat: tickText }, space: key === "x" ? 42 : 56 };
    }
    const texts = axis.names.map((name) => bench.shortened(String(name), key === "x" ? 18 : Math.min(30, Math.floor(options.width / 3 / LETTER)), true));
    const wide = LETTER * (d3.max(texts, (text) => text.length) ?? 1);
    const turned = key === "x" && wide > room / texts.length - 4;
    const [first, last] = [-0.5, texts.length - 0.5];
    return {
      scale: { ...scale, domain: key === "x" ? [first, last] : [last, first] },
      plain: { ...plain, ticks: d3.range(0, texts.length, Math.max(1, Math.ceil((13 * texts.length) / room))), tickFormat: (k) => texts[k], tickRotate: turned ? -45 : 0 },
      space: key === "y" ? 16 + wide : turned ? 42 + 0.72 * wide : 42,
    };
  }

  // Every kind returns what Plot draws of a series, given its points, its style and where it stands among all.
  const dots = (points, { mark }, r = 4.5) => Plot.dot(points, { x: "x", y: "y", r, ...mark });
  const curve = (points, style, k, { kind, series }) => {
    const every = Math.ceil(points.length / MOST_MARKERS);
    const first = Math.floor((every * k) / series.length);
    return [
      Plot.areaY(points, { x: "x", y1: "low", y2: "high", fill: style.line.stroke, fillOpacity: 0.15 }),
      Plot.line(points, { x: "x", y: "y", ...style.line, curve: kind === "steps" ? "step-after" : "linear", className: "curve" }),
      dots(points.filter((_, i) => i % every === first), style, points.length > 40 ? 3.2 : 3.8),
    ];
  };
  const KINDS = {
    line: curve, steps: curve, calibration: (...given) => [Plot.line([[0, 0], [1, 1]], { className: "mark" }), curve(...given)], scatter: (points, style) => dots(points, style),
    bars: (points, style, k, { base, series }) => [
      Plot.rect(points, { x1: ({ x }) => x - 0.36 / series.length, x2: ({ x }) => x + 0.36 / series.length, y1: base, y2: "y", ...style.line, fill: style.line.stroke, fillOpacity: 0.55 }),
      series.length > 1 && dots(points, style, 3)],
    interval: (points, style) => [Plot.ruleY(points, { y: "y", x1: "low", x2: "high", ...style.line, strokeDasharray: null, strokeOpacity: 0.6 }), dots(points, style)],
  };

  // Return the points of a series in numbers, with a sign where they lie beyond the edge at which they stand.
  function pointsOf({ kind, series, x, y }, s, k, ends) {
    const shift = kind === "bars" ? (0.8 * (k - (series.length - 1) / 2)) / series.length : 0;
    const at = (axis, v) => (axis.names ? axis.names.indexOf(v) : v);
    const signs = [["◀", "x", -1], ["▶", "x", 1], ["▼", "y", -1], ["▲", "y", 1]];
    return s.x.map((_, i) => {
      const p = { i, k, x: at(x, s.x[i]) + shift, y: at(y, s.y[i]), low: s.low?.[i] ?? null, high: s.high?.[i] ?? null, text: s.names?.[i] ?? s.name };
      if (!usable(s.x[i] === null ? null : p.x, x) || !usable(p.y, y)) return { ...p, x: NaN, y: NaN };
      const [sign, way] = signs.find(([, key, side]) => side * p[key] > side * d3[side > 0 ? "max" : "min"](ends[key])) ?? [];
      return { ...p, value: p[way], sign: sign && `${sign} ${tickText(p[way])}`, far: Math.abs(p[way]) };
    });
  }

  // Return what Plot draws, seen by those alone who see: the page has its texts.
  function plotted(options) {
    const node = Plot.plot({ className: "canvas", style: { background: "none" }, ...options, marks: options.marks.flat(Infinity).filter(Boolean) });
    // Not left to a policy that may refuse styles: the page's own sheet says the same.
    node.querySelector("style").remove();
    node.setAttribute("aria-hidden", "true");
    return node;
  }
  const framed = (width, height, x, y, marks, more) => plotted({ width, height: height + 28 + x.space, marginTop: 28, marginRight: 16, marginBottom: x.space, marginLeft: y.space,
    x: x.scale, y: y.scale, marks: [marks, Plot.axisX(x.plain), Plot.axisY(y.plain)], ...more });

  function chartOf(figure, width, styles) {
    const { kind, series } = figure;
    const [joined, bars, interval] = [LINES.has(kind), kind === "bars", kind === "interval"];
    const all = (key) => series.flatMap((s) => s[key] ?? []);
    const spread = [...all("low"), ...all("high")];
    const few = joined ? 1 : Math.max(1, Math.floor(all("x").length / 10));
    const pad = kind === "scatter" ? 0.12 : 0.05;
    const fewOf = (own) => (own.some(Number.isFinite) ? 3 * few : few);
    const height = interval ? 18 * figure.y.names.length : 250;
    const y = axisOf(figure.y, "y", height, [...all("y"), ...(interval ? [] : spread)], { pad, few: fewOf(interval ? [] : spread), zero: bars, width });
    const x = axisOf(figure.x, "x", width - y.space - 16, [...all("x"), ...(interval ? spread : [])], { pad: joined ? 0 : pad, few: fewOf(interval ? spread : []) });
    const ends = { x: x.scale.domain, y: y.scale.domain };
    const points = series.map((s, k) => pointsOf(figure, s, k, ends));
    const base = interval || figure.y.log || ends.y[0] > 0 || ends.y[1] < 0 ? ends.y[0] : 0;
    const lines = (figure.marks ?? []).filter(({ axis, value }) => value >= d3.min(ends[axis]) && value <= d3.max(ends[axis]));
    const node = framed(width, height, x, y, [
      !x.plain.tickRotate && !figure.x.names && Plot.gridX({ ticks: x.plain.ticks, className: "grid", strokeOpacity: 1 }),
      !figure.y.names && Plot.gridY({ ticks: y.plain.ticks, className: "grid", strokeOpacity: 1 }), Plot.ruleY([base], { className: "axis" }),
      lines.map(({ axis, value }) => (axis === "x" ? Plot.ruleX : Plot.ruleY)([value], { className: "mark" })),
      lines.map(({ axis, value, label }) => Plot.text([label], axis === "y" ? { y: [value], frameAnchor: "right", textAnchor: "end", dy: -7, className: "tick" }
        : { x: [value], frameAnchor: "top", lineAnchor: "bottom", textAnchor: value > d3.mean(ends.x) ? "end" : "start", dx: value > d3.mean(ends.x) ? -4 : 4, className: "tick" })),
      points.map((row, k) => KINDS[kind](row, styles[k], k, { ...figure, base })),
    ]);
    const [fx, fy] = [node.scale("x").apply, node.scale("y").apply];
    const shown = points.map((row) => row.filter((p) => Number.isFinite(p.x)).map((p) => ({ ...p, px: fx(p.x), py: fy(p.y) })));
    const beyond = shown.flatMap((row) => (joined ? d3.groups(row.filter((p) => p.sign), (p) => p.sign[0]).map(([, own]) => d3.greatest(own, (p) => p.far)) : row.filter((p) => p.sign)));
    const write = bench.writer(node, [y.space, 18, width - 4, 28 + height], shown.flat());
    const named = kind === "scatter" && shown.flat().length <= MOST_LABELS ? d3.sort(shown.flat(), (p) => !p.sign, (p) => p.px) : [];
    for (const p of named) write([bench.shortened(p.text, 22), p.sign].filter(Boolean).join(" "), [p.px, p.py], { must: p.sign, far: 86 });
    if (!named.length) for (const p of beyond) write(p.sign, [p.px, p.py], { must: true });
    if (joined && series.length > 1 && series.length <= MOST_NAMED) for (const p of shown.map((row) => row.at(-1)).filter(Boolean)) write(bench.shortened(p.text, 22), [p.px, p.py]);
    return { node, points: shown };
  }

  const ROUND = [[35, 325, 145, 215, 90, 270, 0, 180].map((angle) => (angle * Math.PI) / 180), [10, 16, 28, 42, 60, 86]];
  // Return what writes texts next to points where nothing is in the way, with a line to the farther ones; those
  // that must stand have their first place at last.
  bench.writer = (layer, [left, top, right, bottom], points = []) => {
    const taken = points.map(({ px, py }) => [px - 5, py - 5, px + 5, py + 5]);
    const free = ([l, t, r, b]) => l >= left && r <= right && t >= top && b <= bottom && !taken.some((o) => l < o[2] && r > o[0] && t < o[3] && b > o[1]);
    return (text, [x, y], { name = "", must = false, far = 16 } = {}) => {
      const wide = (name === "strong" ? 1.15 : 1) * LETTER * text.length;
      const spots = d3.cross(ROUND[1].filter((away) => away <= far), ROUND[0], (away, angle) => {
        const [dx, dy] = [Math.cos(angle), -Math.sin(angle)];
        const [l, mid] = [x + away * dx - (dx < -0.5 ? wide : dx < 0.5 ? wide / 2 : 0), y + away * dy + 4 * Math.sign(Math.round(dy))];
        return [l, mid - 7, l + wide, mid + 7];
      });
      const spot = spots.find(free) ?? (must ? spots[x + wide > right ? 2 : 0] : null);
      if (!spot) return;
      taken.push(spot);
      const [tx, ty] = [Math.max(spot[0], Math.min(spot[2], x)), Math.max(spot[1], Math.min(spot[3], y))];
      if (Math.hypot(tx - x, ty - y) > 18) layer.prepend(svg("line", { class: "leader", x1: x, y1: y, x2: tx, y2: ty }));
      layer.append(svg("text", { class: `label ${name}`, x: Math.max(Math.min(spot[0], right - wide), 2), y: spot[3] - 3 }, text));
    };
  };

  const scheme = matchMedia("(prefers-color-scheme: dark)");

  // A matrix: one picture under its axes, numbers where they have room, and the scale of the colours.
  function matrixOf({ x: across, y: down, value, values }, width) {
    const [nx, ny] = [across.names.length, down.names.length];
    const cells = values.flatMap((row, k) => row.map((v, i) => ({ i, k, v: usable(v, value) ? v : null })));
    const tall = Math.max(ny > 40 ? 2 : 13, Math.min(40, (width - 120) / nx));
    const y = axisOf(down, "y", tall * ny, [], { width });
    const room = width - y.space - 16;
    const x = axisOf(across, "x", room, [], {});
    const domain = rangeOf(cells.map(({ v }) => v), value, { few: Math.max(1, Math.floor(cells.length / 10)) });
    // Viridis stays in order in grey and for the colour-blind: dark is large on a light page, bright on a dark one.
    const color = { type: value.log ? "log" : "linear", domain, clamp: true, interpolate: (share) => d3.interpolateViridis(scheme.matches ? share : 1 - share) };
    const shade = Plot.scale({ color }).apply;
    const node = framed(width, tall * ny, x, y, [
      Plot.raster(cells, { fill: "v", width: nx, height: ny, x1: -0.5, x2: nx - 0.5, y1: -0.5, y2: ny - 0.5, imageRendering: "pixelated" }), Plot.frame({ className: "axis" }),
      tall > 15 && room / nx > 34 && Plot.text(cells.filter(({ v }) => v !== null), { x: "i", y: "k", text: ({ v }) => number(v, 2),
        fill: { value: ({ v }) => (d3.lab(shade(v)).l > 60 ? "#000" : "#fff"), scale: null }, className: "in-cell" }),
    ], { color });
    const bar = Plot.legend({ color, label: named(value), tickFormat: "~g", width: Math.min(280, width), className: "canvas" });
    bar.querySelector("style").remove();
    const [fx, fy] = [node.scale("x").apply, node.scale("y").apply];
    return { node, bar, points: d3.groups(cells, ({ k }) => k).map(([, row]) => row.map((c) => ({ ...c, px: fx(c.i), py: fy(c.k) }))) };
  }

  function pointText(figure, { i, k, v }) {
    if (figure.kind === "cells") return `${figure.y.names[k]} – ${figure.x.names[i]}: ${say(v)} ${figure.value.unit ?? ""}`;
    const s = figure.series[k];
    const range = (s.low?.[i] ?? null) !== null ? ` (${say(s.low[i])} to ${say(s.high[i])})` : "";
    return `${s.names?.[i] ?? s.name}: ${named(figure.x)} ${say(s.x[i])}${figure.kind === "interval" ? "" : `, ${named(figure.y)} ${say(s.y[i])}`}${range}`;
  }

  // Let the arrow keys and the pointer step through the points; returns what to do after drawing.
  function stepping(figure, plot, readout) {
    let [rows, at, node] = [[], null, null];
    const cursor = svg("circle", { class: "cursor", r: 8 });
    const show = (row, column) => {
      at = [row, Math.max(0, Math.min(rows[row].length - 1, column))];
      const p = rows[row][at[1]];
      d3.select(cursor).attr("cx", p.px).attr("cy", p.py);
      node.append(cursor);
      readout.textContent = pointText(figure, p);
    };
    plot.addEventListener("keydown", (event) => {
      const move = { ArrowRight: [0, 1], ArrowLeft: [0, -1], ArrowDown: [1, 0], ArrowUp: [-1, 0], Home: [0, -1e9], End: [0, 1e9] }[event.key];
      if (!move || !rows.length) return;
      event.preventDefault();
      if (at) show((at[0] + move[0] + rows.length) % rows.length, at[1] + move[1]);
      else show(0, 0);
    });
    plot.addEventListener("pointermove", (event) => {
      const [x, y] = d3.pointer(event, node);
      const best = d3.least(rows.flatMap((row, k) => row.map((p, i) => [Math.hypot(p.px - x, p.py - y), k, i])), ([far]) => far);
      if (best?.[0] < 40) show(best[1], best[2]);
    });
    return (drawn) => {
      [rows, node] = [drawn.points.filter((row) => row.length), drawn.node];
      if (at && rows[at[0]]) show(...at);
    };
  }

  function legend(figure, styles) {
    const sample = ({ line, mark }) => plotted({ className: "sample", width: 36, height: 14, margin: 7, axis: null, x: { domain: [0, 2] }, y: { domain: [0, 2] },
      marks: [LINES.has(figure.kind) && Plot.line([[-0.5, 1], [2.5, 1]], line), Plot.dot([[1, 1]], { r: 3.8, ...mark })] });
    return el("ul", { class: "legend", "aria-label": "Legend" }, figure.series.map(({ name }, k) => el("li", {}, sample(styles[k]), name)));
  }

  function numbersOf({ kind, title, x, y, series, values }) {
    const figure = (v) => (typeof v === "number" || v === null ? bench.cell(v, say) : say(v));
    const ranges = kind !== "cells" && series.some((s) => s.low);
    const [heads, rows] = kind === "cells" ? [[named(y), ...x.names], values.map((row, k) => [y.names[k], ...row.map(figure)])]
      : [["Series", named(x), named(y), ...(ranges ? ["low", "high"] : [])],
        series.flatMap((s) => s.x.map((v, i) => [s.names?.[i] ?? s.name, ...[v, s.y[i], ...(ranges ? [s.low?.[i] ?? null, s.high?.[i] ?? null] : [])].map(figure)]))];
    return bench.scroll(bench.table(`Numbers of: ${title}`, heads, rows));
  }

  // Return a <figure> that draws itself to the width it is given; the schema is that of docs/reports.md.
  bench.draw = (figure) => {
    const [cells, series] = [figure.kind === "cells", figure.series ?? []];
    let [free, width] = [0, 0];
    const styles = series.map((s) => styleOf(s, s.style ?? (s.role in ROLES ? 0 : free++)));
    const readout = el("p", { class: "readout", "aria-live": "polite" }, HINT);
    const label = `${figure.title}. ${cells ? named(figure.value) : [named(figure.y), named(figure.x)].filter(Boolean).join(" over ")}. Arrow keys step through the points.`;
    const plot = el("div", { class: "plot", tabindex: "0", role: "application", "aria-roledescription": "chart", "aria-label": label });
    const found = stepping(figure, plot, readout);
    const redraw = () => {
      if (width < 40) return;
      const drawn = cells ? matrixOf(figure, width) : chartOf(figure, width, styles);
      plot.replaceChildren(...[drawn.bar, drawn.node].filter(Boolean));
      found(drawn);
    };
    new ResizeObserver(([{ contentRect }]) => {
      if (Math.abs(contentRect.width - width) <= 1) return;
      width = Math.floor(contentRect.width);
      redraw();
    }).observe(plot);
    plot.addEventListener("recolour", redraw);
    return el("figure", { class: "chart" },
      el("figcaption", {}, el("strong", {}, figure.title), figure.note && el("span", {}, figure.note)),
      series.length > 1 && legend(figure, styles), plot, readout, bench.fold("Numbers", () => numbersOf(figure), "numbers"));
  };
  // A picture of a matrix has the colours that it was painted with.
  scheme.addEventListener("change", () => document.querySelectorAll(".plot").forEach((plot) => plot.dispatchEvent(new Event("recolour"))));
}
