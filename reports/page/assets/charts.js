// Figures on Observable Plot and d3, all of one schema (docs/plot.md). Every figure is one stop of the
// keyboard: the arrow keys step through its points, whose text stands below; a table holds all numbers.
{
  const { el, svg, number } = bench;
  const LETTER = 6.6; // px a letter takes at 12 px, about
  const MOST_MARKERS = 9;
  const MOST_LABELS = 60;
  const FAR = 4; // an axis leaves out what lies farther away than so many times the spread of the rest
  const SYMBOLS = {
    circle: d3.symbolCircle, square: d3.symbolSquare, triangle: d3.symbolTriangle, diamond: d3.symbolDiamond,
    cross: d3.symbolTimes, plus: d3.symbolPlus, down: d3.symbolWye, star: d3.symbolAsterisk,
  };
  const LINES = new Set(["line", "steps", "calibration"]);

  // What a marker looks like, whoever draws it.
  const markOf = (style, r) => ({
    symbol: SYMBOLS[style.marker], r, stroke: style.colour, strokeWidth: 1.6,
    fill: /cross|plus|star/.test(style.marker) ? "none" : style.hollow ? "var(--panel)" : style.colour,
  });

  // Return a marker at a point; the style comes from bench.palette.
  bench.marker = (style, x, y, r = 4) => {
    const { symbol, fill, stroke, strokeWidth } = markOf(style, r);
    return svg("path", { d: d3.symbol(symbol, Math.PI * r * r)(), transform: `translate(${x} ${y})`, fill, stroke, "stroke-width": strokeWidth });
  };

  const tickText = (v) => number(Number(v.toPrecision(3)), 3).replace(/(\.\d*?)0+$/, "$1").replace(/\.$/, "");
  const named = (axis) => (!axis.label ? null : axis.unit ? `${axis.label}, ${axis.unit}` : axis.label);
  const say = (v) => (typeof v === "number" ? number(v, 4) : String(v ?? "–"));
  const usable = (v, axis) => v !== null && Number.isFinite(v) && (!axis.log || v > 0);

  // Return [low, high] of an axis: what was asked for, else that of the values but the few far off the rest.
  // core/plot/chart.py has the same rule.
  function rangeOf(values, axis, { pad, few, zero }) {
    const log = axis.log;
    const sorted = d3.sort(values.filter((v) => usable(v, axis)).map((v) => (log ? Math.log10(v) : v)));
    if (!sorted.length) sorted.push(log ? -1 : 0, log ? 0 : 1);
    const last = sorted.length - 1;
    let [low, high] = [sorted[0], sorted[last]];
    if (last >= 4) {
      const [a, b] = [sorted[few], sorted[last - few]];
      if (high - b > FAR * (b - a) && b > a) high = b;
      if (a - low > FAR * (b - a) && b > a) low = a;
    }
    if (zero && !log) [low, high] = [Math.min(low, 0), Math.max(high, 0)];
    const grow = low === high ? (log ? 0.3 : Math.abs(low) * 0.1 || 1) : (high - low) * pad;
    if (!(zero && low === 0)) low -= grow;
    if (!(zero && high === 0)) high += grow;
    const back = (v) => (log ? 10 ** v : v);
    return [axis.low ?? back(low), axis.high ?? back(high)];
  }

  // A logarithmic axis of little more than a decade has the ticks of a linear one.
  function ticksOf([low, high], log, wanted, whole) {
    const linear = d3.ticks(low, high, wanted).filter((t) => !whole || Number.isInteger(t));
    if (!log) return linear;
    const all = d3.scaleLog([low, high], [0, 1]).ticks(wanted);
    const lists = [/^[1-9]e/, /^[125]e/, /^1e/].map((lead) => all.filter((t) => lead.test(t.toExponential())));
    const fit = lists.find((list) => list.length <= wanted + 1) ?? lists[2];
    return fit.length > 2 || high > 20 * low ? fit : linear;
  }

  // Return how an axis is cut up: its names where it has any, else its numbers.
  function axisOf(figure, key, room, values, options) {
    const axis = figure[key];
    const names = axis.names ?? null;
    if (!names) {
      const domain = rangeOf(values, axis, options);
      const ticks = ticksOf(domain, axis.log, Math.max(2, Math.floor(room / (key === "x" ? 75 : 55))), values.every(Number.isInteger));
      return { domain, type: axis.log ? "log" : "linear", ticks, tickFormat: tickText, longest: d3.max(ticks, (t) => tickText(t).length) ?? 1 };
    }
    const size = key === "x" ? 18 : Math.min(30, Math.floor(options.width / 3 / LETTER));
    const texts = names.map((name) => bench.shortened(String(name), size, true));
    const longest = d3.max(texts, (t) => t.length) ?? 1;
    const turned = key === "x" && longest * LETTER > room / names.length - 4;
    const every = Math.max(1, Math.ceil((13 * names.length) / room));
    return { domain: key === "x" ? [-0.5, names.length - 0.5] : [names.length - 0.5, -0.5], type: "linear", names, turned,
      ticks: d3.range(0, names.length, every), tickFormat: (k) => texts[k], longest };
  }

  // Every kind returns what Plot draws of a series, given its points and its style.
  const curve = (figure, points, style, k) => {
    const every = Math.max(1, Math.ceil(points.length / MOST_MARKERS));
    const first = Math.floor((every * k) / figure.series.length) % every;
    return [
      points.some((p) => p.low !== null) && Plot.areaY(points, { x: "x", y1: "low", y2: "high", fill: style.colour, fillOpacity: 0.15, clip: true }),
      Plot.line(points, { x: "x", y: "y", stroke: style.colour, strokeWidth: style.width, strokeDasharray: style.dash || null,
        curve: figure.kind === "steps" ? "step-after" : "linear", className: "curve", clip: true }),
      Plot.dot(points.filter((p, i) => p.good && i % every === first), { x: "atX", y: "atY", ...markOf(style, points.length > 40 ? 3.2 : 3.8) }),
    ];
  };
  const KINDS = {
    line: curve, steps: curve, calibration: curve,
    scatter: (figure, points, style) => [Plot.dot(points, { x: "atX", y: "atY", ...markOf(style, 4.5) })],
    bars: (figure, points, style, k, base) => {
      const wide = 0.8 / figure.series.length;
      const marks = [Plot.rect(points, { x1: (p) => p.atX - wide * 0.45, x2: (p) => p.atX + wide * 0.45, y1: base, y2: "atY",
        fill: style.colour, fillOpacity: style.hollow ? 0.12 : 0.55, stroke: style.colour, strokeWidth: 1.5, strokeDasharray: style.dash || null })];
      return figure.series.length > 1 ? [...marks, Plot.dot(points, { x: "atX", y: "atY", ...markOf(style, 3) })] : marks;
    },
    interval: (figure, points, style) => [
      Plot.link(points.filter((p) => p.low !== null), { x1: "low", x2: "high", y1: "atY", y2: "atY", stroke: style.colour, strokeWidth: 2.2, strokeOpacity: 0.6, clip: true }),
      Plot.dot(points, { x: "atX", y: "atY", ...markOf(style, 4.5) }),
    ],
  };

  // Return the points of a series where they are drawn: on the edge where they lie beyond it.
  function pointsOf(figure, s, k, x, y) {
    const inside = (v, { domain }) => Math.max(Math.min(...domain), Math.min(Math.max(...domain), v));
    const shift = figure.kind === "bars" ? ((k - (figure.series.length - 1) / 2) * 0.8) / figure.series.length : 0;
    const own = { x: (i) => (x.names ? x.names.indexOf(s.x[i]) + shift : s.x[i]), y: (i) => (y.names ? y.names.indexOf(s.y[i]) : s.y[i]) };
    return s.x.map((_, i) => {
      const [vx, vy] = [own.x(i), own.y(i)];
      const good = usable(vx, figure.x) && usable(vy, figure.y);
      const [atX, atY] = [inside(vx, x), inside(vy, y)];
      const beyond = !good ? "" : vy > atY ? "▲" : vy < atY ? "▼" : vx > atX ? "▶" : vx < atX ? "◀" : "";
      return { i, s: k, good, atX, atY, beyond, x: good ? vx : NaN, y: good ? vy : NaN, low: s.low?.[i] ?? null, high: s.high?.[i] ?? null,
        text: s.names?.[i] ?? s.name, value: beyond === "▶" || beyond === "◀" ? vx : vy };
    });
  }

  function plotOf(figure, width, styles) {
    const bars = figure.kind === "bars";
    const flat = (key) => figure.series.flatMap((s) => s[key] ?? []);
    const cat = (key) => (figure[key].names || (key === "x" ? bars : figure.kind === "interval") ? { ...figure[key], names: figure[key].names ?? [...new Set(flat(key))] } : figure[key]);
    figure = { ...figure, x: cat("x"), y: cat("y") };
    const height = figure.height ?? (figure.y.names ? 24 * figure.y.names.length + 64 : 320);
    const spread = [...flat("low"), ...flat("high")];
    const few = LINES.has(figure.kind) ? 1 : Math.max(1, Math.floor(flat("x").length / 10));
    const more = figure.kind === "scatter" ? 0.12 : 0.05;
    const y = axisOf(figure, "y", height - 70, [...flat("y"), ...(figure.kind === "interval" ? [] : spread)], { pad: more, few: figure.kind === "interval" || !spread.length ? few : 3 * few, zero: bars, width });
    const left = 16 + y.longest * LETTER;
    const x = axisOf(figure, "x", width - left - 16, [...flat("x"), ...(figure.kind === "interval" ? spread : [])], { pad: LINES.has(figure.kind) ? 0 : more, few: figure.kind === "interval" && spread.length ? 3 * few : few, zero: false });
    const points = figure.series.map((s, k) => pointsOf(figure, s, k, x, y));
    const base = y.domain[0] > 0 || figure.y.log ? y.domain[0] : 0;
    const outside = points.flatMap((row) => LINES.has(figure.kind) ? d3.groups(row.filter((p) => p.beyond), (p) => p.beyond).map(([, some]) => d3.greatest(some, (p) => Math.abs(p.value))) : row.filter((p) => p.beyond));
    const lines = (figure.marks ?? []).filter((m) => m.value >= Math.min(...(m.axis === "x" ? x : y).domain) && m.value <= Math.max(...(m.axis === "x" ? x : y).domain));
    const across = (m) => (m.axis === "x" ? Plot.ruleX : Plot.ruleY)([m.value], { className: "mark" });
    const axis = ({ ticks, tickFormat, turned }) => ({ ticks, tickFormat, tickSize: 0, tickPadding: 6, className: "tick", ...(turned ? { tickRotate: -45 } : {}) });
    const node = Plot.plot({
      className: "canvas", width, height, marginLeft: left, marginRight: 16, marginTop: 28,
      marginBottom: 42 + (x.turned ? x.longest * LETTER * 0.72 : 0), style: { background: "none" },
      x: { domain: x.domain, type: x.type, label: named(figure.x) }, y: { domain: y.domain, type: y.type, label: named(figure.y) },
      marks: [
        x.names ? null : Plot.gridX(x.ticks, { className: "grid", strokeOpacity: 1 }), y.names ? null : Plot.gridY(y.ticks, { className: "grid", strokeOpacity: 1 }),
        Plot.axisX(axis(x)), Plot.axisY(axis(y)), Plot.ruleY([y.names ? y.domain[0] : base], { className: "axis" }),
        lines.map(across), figure.kind === "calibration" ? Plot.line([[0, 0], [1, 1]], { className: "mark" }) : null,
        points.map((row, k) => KINDS[figure.kind](figure, LINES.has(figure.kind) ? row : row.filter((p) => p.good), styles[k], k, base)),
      ].flat(2).filter(Boolean),
    });
    // Not left to a policy that may refuse styles: the page's own sheet says the same.
    node.querySelector("style").remove();
    node.setAttribute("aria-hidden", "true");
    const [fx, fy] = [node.scale("x").apply, node.scale("y").apply];
    const shown = points.map((row) => row.filter((p) => p.good).map((p) => ({ ...p, px: fx(p.atX), py: fy(p.atY) })));
    const box = { left, right: width - 8, top: 22, bottom: fy(y.domain[0]) };
    for (const m of lines) node.append(svg("text", m.axis === "x" ? { class: "tick label", x: fx(m.value) + 4, y: 24 } : { class: "tick label end", x: width - 20, y: fy(m.value) - 5 }, m.label));
    for (const p of outside) {
      const start = fx(p.atX) < width / 2;
      node.append(svg("text", { class: start ? "label" : "label end", x: fx(p.atX) + (start ? 7 : -7), y: fy(p.atY) + (p.beyond === "▼" ? -4 : 10) }, `${p.beyond} ${tickText(p.value)}`));
    }
    const flatPoints = shown.flat();
    if (figure.kind === "scatter" && flatPoints.length <= MOST_LABELS) placeLabels(node, box, d3.sort(flatPoints, (p) => p.px), flatPoints);
    if (LINES.has(figure.kind) && figure.series.length <= 6 && figure.series.length > 1) placeLabels(node, box, shown.map((row) => row.at(-1)).filter(Boolean), flatPoints, 16);
    return { node, points: shown };
  }

  // Write names beside points where nothing is in the way; those that find no room near get a line.
  function placeLabels(node, box, points, others, farthest = 86) {
    const pen = document.createElement("canvas").getContext("2d");
    pen.font = `12px ${getComputedStyle(document.body).fontFamily}`;
    const taken = others.map((p) => ({ l: p.px - 6, r: p.px + 6, t: p.py - 6, b: p.py + 6 }));
    const free = (r) => r.l >= box.left && r.r <= box.right && r.t >= box.top && r.b <= box.bottom && !taken.some((o) => r.l < o.r && r.r > o.l && r.t < o.b && r.b > o.t);
    for (const p of points) {
      const text = bench.shortened(p.text, 22);
      const w = pen.measureText(text).width + 3;
      const spots = d3.cross([8, 16, 26, 38, 52, 68, 86].filter((far) => far <= farthest), [0, 180, 90, 270, 45, 315, 135, 225, 20, 160, 200, 340], (far, angle) => {
        const [c, s] = [Math.cos((angle * Math.PI) / 180), Math.sin((angle * Math.PI) / 180)];
        const l = p.px + c * far - (c < -0.5 ? w : Math.abs(c) <= 0.5 ? w / 2 : 0);
        const mid = p.py - s * (far + (Math.abs(c) < 0.9 ? 3 : 0));
        return { far, l, r: l + w, t: mid - 7, b: mid + 7 };
      });
      const spot = spots.find(free);
      if (!spot) continue;
      taken.push(spot);
      const to = Math.max(spot.l, Math.min(spot.r, p.px));
      if (spot.far > 16) node.prepend(svg("line", { class: "leader", x1: p.px, y1: p.py, x2: to, y2: Math.max(spot.t, Math.min(spot.b, p.py)) }));
      node.append(svg("text", { class: "label", x: spot.l + 1, y: spot.b - 3 }, text));
    }
  }

  const scheme = matchMedia("(prefers-color-scheme: dark)");
  // Viridis stays in order in grey and for the colour-blind: dark is large on a light page, bright on a dark one.
  const shadeOf = (share, dark = scheme.matches) => d3.interpolateViridis(dark ? share : 1 - share);

  // A matrix: one picture under its axes, numbers where they have room, and the scale of the colours.
  function cellsOf(figure, width) {
    const { x: across, y: down, value, values } = figure;
    const flat = values.flat().map((v) => (usable(v, value) ? v : null));
    const x = axisOf(figure, "x", width - 120, [], {});
    const rowsTall = Math.max(down.names.length > 40 ? 2 : 13, Math.min(40, (width - 120) / across.names.length));
    const y = axisOf(figure, "y", rowsTall * down.names.length, [], { width });
    const left = 16 + y.longest * LETTER;
    const domain = rangeOf(flat, value, { pad: 0, few: Math.max(1, Math.floor(flat.length / 10)) });
    const color = { type: value.log ? "log" : "linear", domain, interpolate: (share) => shadeOf(share), clamp: true };
    const roomy = rowsTall > 15 && (width - left - 16) / across.names.length > 34;
    const axis = ({ ticks, tickFormat, turned }) => ({ ticks, tickFormat, tickSize: 0, tickPadding: 6, className: "tick", ...(turned ? { tickRotate: -45 } : {}) });
    const bottom = 42 + (x.turned ? x.longest * LETTER * 0.72 : 0);
    const cells = flat.map((v, k) => ({ v, x: k % across.names.length, y: Math.floor(k / across.names.length) }));
    const node = Plot.plot({ className: "canvas", width, height: 28 + bottom + rowsTall * down.names.length, marginLeft: left, marginRight: 16, marginTop: 28, marginBottom: bottom, style: { background: "none" },
      x: { domain: x.domain, type: "linear", label: named(across) }, y: { domain: y.domain, type: "linear", label: named(down) }, color,
      marks: [
        Plot.raster(flat, { width: across.names.length, height: down.names.length, x1: -0.5, x2: across.names.length - 0.5, y1: -0.5, y2: down.names.length - 0.5, fill: (v) => v, imageRendering: "pixelated" }),
        Plot.frame({ className: "axis" }), Plot.axisX(axis(x)), Plot.axisY(axis(y)),
        roomy ? Plot.text(cells.filter((c) => c.v !== null), { x: "x", y: "y", text: (c) => number(c.v, 2), className: "in-cell" }) : null,
      ] });
    node.querySelector("style").remove();
    node.setAttribute("aria-hidden", "true");
    node.querySelectorAll(".in-cell text").forEach((text, k) => {
      const shade = node.scale("color").apply(cells.filter((c) => c.v !== null)[k].v);
      text.style.fill = d3.lab(shade).l > 60 ? "#000" : "#fff";
    });
    const bar = Plot.legend({ color, label: named(value), tickFormat: tickText, width: Math.min(280, width), className: "canvas" });
    bar.querySelector("style").remove();
    const [fx, fy] = [node.scale("x").apply, node.scale("y").apply];
    const points = values.map((row, s) => row.map((v, i) => ({ i, s, px: fx(i), py: fy(s), value: v })));
    return { node, points, bar };
  }

  function pointText(figure, p) {
    if (figure.kind === "cells") return `${figure.y.names[p.s]} – ${figure.x.names[p.i]}: ${say(p.value)} ${figure.value.unit}`;
    const s = figure.series[p.s];
    const range = s.low && s.low[p.i] !== null ? ` (${say(s.low[p.i])} to ${say(s.high[p.i])})` : "";
    return `${s.names?.[p.i] ?? s.name}: ${named(figure.x)} ${say(s.x[p.i])}${figure.kind === "interval" ? "" : `, ${named(figure.y)} ${say(s.y[p.i])}`}${range}`;
  }

  // Let the arrow keys and the pointer step through the points; returns what to do after drawing.
  function stepping(figure, plot, readout) {
    let rows = [];
    let at = null;
    const show = (row, column) => {
      at = [row, column];
      const p = rows[row][column];
      plot.querySelectorAll(".cursor").forEach((node) => node.remove());
      plot.querySelector("svg").append(svg("circle", { class: "cursor", cx: p.px, cy: p.py, r: 8 }));
      readout.textContent = pointText(figure, p);
    };
    plot.addEventListener("keydown", (event) => {
      const move = { ArrowRight: [0, 1], ArrowLeft: [0, -1], ArrowDown: [1, 0], ArrowUp: [-1, 0], Home: [0, -1e9], End: [0, 1e9] }[event.key];
      if (!move || !rows.length) return;
      event.preventDefault();
      if (!at) return show(0, 0);
      const row = (at[0] + move[0] + rows.length) % rows.length;
      show(row, Math.max(0, Math.min(rows[row].length - 1, at[1] + move[1])));
    });
    plot.addEventListener("pointermove", (event) => {
      const [x, y] = d3.pointer(event, plot.querySelector("svg"));
      const far = (p) => (p.px - x) ** 2 + (p.py - y) ** 2;
      const best = d3.least(rows.flat(), far);
      if (best && far(best) < 1600) for (const [k, row] of rows.entries()) if (row.includes(best)) show(k, row.indexOf(best));
    });
    return (found) => {
      rows = found.filter((row) => row.length);
      if (at && rows[at[0]]?.[at[1]]) show(...at);
    };
  }

  function legend(figure, styles) {
    const items = figure.series.map((s, k) => {
      const st = styles[k];
      const line = LINES.has(figure.kind) && svg("line", { x1: 1, x2: 35, y1: 7, y2: 7, stroke: st.colour, "stroke-width": st.width, "stroke-dasharray": st.dash || null });
      return el("li", {}, svg("svg", { width: 36, height: 14, "aria-hidden": "true" }, line, bench.marker(st, 18, 7, 3.8)), s.name);
    });
    return el("ul", { class: "legend", "aria-label": "Legend" }, items);
  }

  function numbersOf(figure) {
    const cells = figure.kind === "cells";
    const ranges = !cells && figure.series.some((s) => s.low);
    const heads = cells ? [named(figure.y), ...figure.x.names] : ["Series", named(figure.x), named(figure.y), ...(ranges ? ["low", "high"] : [])];
    const lines = cells ? figure.values.map((row, k) => [figure.y.names[k], ...row])
      : figure.series.flatMap((s) => s.x.map((x, i) => [s.names?.[i] ?? s.name, x, s.y[i], ...(ranges ? [s.low?.[i], s.high?.[i]] : [])]));
    const row = ([name, ...rest]) => el("tr", {}, el("th", { scope: "row" }, name), rest.map((v) => el("td", { "data-value": v ?? null }, say(v))));
    return bench.scroll(`Numbers of: ${figure.title}`, el("table", { class: "plain" }, el("thead", {}, el("tr", {}, heads.map((h) => el("th", { scope: "col" }, h)))), el("tbody", {}, lines.map(row))));
  }

  // Return a <figure> that draws itself to the width it is given; the schema is that of docs/plot.md.
  bench.draw = (figure) => {
    const series = figure.series ?? [];
    let free = 0;
    const styles = series.map((s) => bench.palette.style(s.style ?? (s.role === "measured" || s.role === "nominal" ? 0 : free++), s.role));
    const readout = el("p", { class: "readout", "aria-live": "polite" }, figure.hint || "Point at the chart, or focus it and use the arrow keys, to read its values.");
    const label = `${figure.title}. ${figure.kind === "cells" ? named(figure.value) : [named(figure.y), named(figure.x)].filter(Boolean).join(" over ")}. Arrow keys step through the points.`;
    const plot = el("div", { class: "plot", tabindex: "0", role: "application", "aria-roledescription": "chart", "aria-label": label });
    const found = stepping(figure, plot, readout);
    const details = el("details", { class: "numbers", ontoggle: () => details.children.length < 2 && details.append(numbersOf(figure)) }, el("summary", {}, "Numbers"));
    const node = el("figure", { class: "chart" },
      el("figcaption", {}, el("strong", {}, figure.title), figure.note ? el("span", {}, figure.note) : null),
      series.length > 1 ? legend(figure, styles) : null, plot, readout, details);
    let width = 0;
    const redraw = (room) => {
      width = room;
      const drawn = figure.kind === "cells" ? cellsOf(figure, width) : plotOf(figure, width, styles);
      plot.replaceChildren(...[drawn.bar, drawn.node].filter(Boolean));
      found(drawn.points);
    };
    new ResizeObserver(([entry]) => {
      const room = Math.floor(entry.contentRect.width);
      if (room > 40 && Math.abs(room - width) > 1) redraw(room);
    }).observe(plot);
    // A picture of a matrix has the colours that it was painted with.
    if (figure.kind === "cells") plot.addEventListener("recolour", () => width && redraw(width));
    return node;
  };
  scheme.addEventListener("change", () => document.querySelectorAll(".plot").forEach((plot) => plot.dispatchEvent(new Event("recolour"))));
  bench.shade = shadeOf;
}
