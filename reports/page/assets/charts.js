// Charts in SVG: lines, bars, scatter, performance profiles. Every chart is one stop of the keyboard:
// the arrow keys step through its points, whose text stands below; a table holds all numbers.
{
  const { el, svg, number } = bench;
  const LETTER = 6.6; // px a letter takes at 12 px, about
  const MOST_MARKERS = 9;

  // A logarithmic axis of less than about a decade has the ticks of a linear one.
  function ticksOf(low, high, log, wanted, least = 0) {
    const found = [];
    const decades = log ? Math.log10(high / low) : 0;
    for (let stride = Math.ceil(decades / wanted); stride > 0 && found.length < 2; stride -= 1) {
      const steps = decades * 3 <= wanted + 1 ? [1, 2, 5] : [1];
      found.length = 0;
      for (let e = Math.floor(Math.log10(low)); e <= Math.ceil(Math.log10(high)); e += 1)
        for (const s of steps) if (e % stride === 0 && within(s * 10 ** e, low, high)) found.push(s * 10 ** e);
    }
    if (found.length > 2 || decades > 1.3) return found;
    found.length = 0;
    const raw = Math.max((high - low) / Math.max(wanted, 2), least);
    const base = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map((s) => s * base).find((s) => s >= raw * 0.999);
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + step * 1e-9; k += 1) found.push(k * step);
    return found;
  }
  function within(v, low, high) {
    return v >= low * 0.999 && v <= high * 1.001;
  }
  function usable(value, log) {
    return value !== null && Number.isFinite(value) && (!log || value > 0);
  }
  function rangeOf(values, log, pad, floor) {
    const good = values.filter((v) => usable(v, log));
    let low = good.length ? Math.min(...good) : log ? 0.1 : 0;
    let high = good.length ? Math.max(...good) : 1;
    if (floor !== undefined) low = Math.min(low, floor);
    if (log) {
      const grow = low === high ? 2 : (high / low) ** pad;
      return [low / grow, high * grow];
    }
    const grow = low === high ? Math.abs(low) * 0.1 || 1 : (high - low) * pad;
    return [floor === low ? low : low - grow, high + grow];
  }
  function scaleOf([low, high], from, to, log) {
    const f = log ? Math.log10 : (v) => v;
    const [a, b] = [f(low), f(high)];
    return (v) => from + ((f(v) - a) / (b - a || 1)) * (to - from);
  }
  // A tick's text, with no more digits than it needs.
  function tickText(v) {
    return number(Number(v.toPrecision(3)), 3).replace(/(\.\d*?)0+$/, "$1").replace(/\.$/, "");
  }

  // Draw the frame: grid, ticks, names of the axes. Returns {node, x, y, box}.
  function frame(spec, width, ranges, names = null) {
    const height = spec.height || 320;
    const yTicks = ticksOf(...ranges.y, spec.logY, Math.max(3, Math.floor(height / 60)));
    const left = 34 + Math.max(...yTicks.map((t) => tickText(t).length)) * LETTER;
    const tilt = names && names.some((n) => n.length * LETTER > (width - left - 14) / names.length - 4);
    const longest = tilt ? Math.min(Math.max(...names.map((n) => n.length)), 18) * LETTER * 0.72 : 0;
    const box = { left, right: width - 14, top: 10, bottom: height - 46 - longest };
    const x = names
      ? scaleOf([-0.5, names.length - 0.5], box.left, box.right, false)
      : scaleOf(ranges.x, box.left, box.right, spec.logX);
    const y = scaleOf(ranges.y, box.bottom, box.top, spec.logY);
    const node = svg("svg", { viewBox: `0 0 ${width} ${height}`, width, height, class: "canvas" });
    for (const t of yTicks)
      node.append(
        svg("line", { class: "grid", x1: box.left, x2: box.right, y1: y(t), y2: y(t) }),
        svg("text", { class: "tick end", x: box.left - 6, y: y(t) + 4 }, tickText(t)),
      );
    const wanted = Math.max(2, Math.floor((box.right - box.left) / 75));
    const counted = spec.series.every((s) => s.x.every(Number.isInteger));
    const xTicks = names ? [] : ticksOf(...ranges.x, spec.logX, wanted, counted ? 1 : 0);
    for (const t of xTicks)
      node.append(
        svg("line", { class: "grid", x1: x(t), x2: x(t), y1: box.top, y2: box.bottom }),
        svg("text", { class: "tick mid", x: x(t), y: box.bottom + 17 }, tickText(t)),
      );
    (names || []).forEach((name, k) => {
      const at = { x: x(k), y: box.bottom + 15 };
      const turned = tilt ? { transform: `rotate(-45 ${at.x} ${at.y})`, class: "tick end" } : { class: "tick mid" };
      node.append(svg("text", { ...at, ...turned }, bench.shortened(name, tilt ? 18 : 60)));
    });
    node.append(
      svg("line", { class: "axis", x1: box.left, x2: box.right, y1: box.bottom, y2: box.bottom }),
      svg("line", { class: "axis", x1: box.left, x2: box.left, y1: box.top, y2: box.bottom }),
      svg("text", { class: "name mid", x: (box.left + box.right) / 2, y: height - 8 }, spec.xLabel || ""),
      svg("text", { class: "name mid", transform: `translate(13 ${(box.top + box.bottom) / 2}) rotate(-90)` }, spec.yLabel || ""),
    );
    return { node, x, y, box };
  }

  function stylesOf(spec) {
    let free = 0;
    return spec.series.map((s) => {
      const own = s.role === "measured" || s.role === "nominal";
      return bench.palette.style(s.style !== undefined ? s.style : own ? 0 : free++, s.role);
    });
  }

  function drawLines(spec, width, styles) {
    const all = (key) => spec.series.flatMap((s) => s[key]);
    const ranges = {
      x: spec.xRange || rangeOf(all("x"), spec.logX, 0),
      y: spec.yRange || rangeOf(all("y"), spec.logY, 0.05),
    };
    const { node, x, y } = frame(spec, width, ranges);
    const points = spec.series.map((s, k) => {
      const found = [];
      let path = "";
      let pen = false;
      s.x.forEach((value, i) => {
        if (!usable(value, spec.logX) || !usable(s.y[i], spec.logY)) return void (pen = false);
        const [px, py] = [x(value), y(s.y[i])];
        const to = `${px.toFixed(1)} ${py.toFixed(1)}`;
        path += pen ? (spec.steps ? `H${px.toFixed(1)}V${py.toFixed(1)}` : `L${to}`) : `M${to}`;
        pen = true;
        found.push({ px, py, i, s: k });
      });
      const st = styles[k];
      node.append(
        svg("path", { class: "curve", d: path || "M0 0", stroke: st.colour, "stroke-dasharray": st.dash || null, "stroke-width": st.width }),
      );
      const every = Math.max(1, Math.ceil(found.length / MOST_MARKERS));
      const first = Math.floor((every * k) / Math.max(spec.series.length, 1));
      found.forEach((p, i) => {
        if (i % every === first % every) node.append(bench.marker(st, p.px, p.py, found.length > 40 ? 3.2 : 3.8));
      });
      return found;
    });
    return { node, points };
  }

  function drawBars(spec, width, styles) {
    const names = [...new Set(spec.series.flatMap((s) => s.x.map(String)))];
    const values = spec.series.flatMap((s) => s.y);
    const y = spec.yRange || rangeOf(values, spec.logY, 0.05, spec.logY ? undefined : 0);
    if (!spec.logY && Math.max(...values.map((v) => v || 0)) <= 0) y[1] = 0;
    const drawn = frame(spec, width, { y }, names);
    const room = ((drawn.x(1) - drawn.x(0)) * 0.8) / Math.max(spec.series.length, 1);
    const zero = drawn.y(spec.logY ? y[0] : Math.max(0, y[0]));
    const points = spec.series.map((s, k) =>
      s.x.flatMap((name, i) => {
        if (!usable(s.y[i], spec.logY)) return [];
        const px = drawn.x(names.indexOf(String(name))) + (k - (spec.series.length - 1) / 2) * room;
        const py = drawn.y(s.y[i]);
        const shape = { x: px - room * 0.45, y: Math.min(py, zero), width: room * 0.9, height: Math.max(Math.abs(py - zero), 1) };
        const st = styles[k];
        drawn.node.append(
          svg("rect", { ...shape, fill: st.colour, "fill-opacity": st.hollow ? 0.12 : 0.55, stroke: st.colour, "stroke-width": 1.5, "stroke-dasharray": st.dash || null }),
        );
        if (room > 9) drawn.node.append(bench.marker(st, px, py, 3));
        return [{ px, py, i, s: k }];
      }),
    );
    return { node: drawn.node, points };
  }

  let pen = null;
  function widthOf(text) {
    if (!pen) {
      pen = document.createElement("canvas").getContext("2d");
      pen.font = `12px ${getComputedStyle(document.body).fontFamily}`;
    }
    return pen.measureText(text).width;
  }

  // Place labels beside points where nothing is in the way; those that find no room get a line.
  function placeLabels(node, box, points) {
    const taken = points.map((p) => ({ l: p.px - 6, r: p.px + 6, t: p.py - 6, b: p.py + 6 }));
    const free = (r) =>
      r.l >= box.left && r.r <= box.right && r.t >= box.top && r.b <= box.bottom &&
      !taken.some((o) => r.l < o.r && r.r > o.l && r.t < o.b && r.b > o.t);
    for (const p of points) {
      const w = widthOf(p.text) + 3;
      for (const far of [8, 16, 26, 38, 52, 68, 86]) {
        const spots = [0, 180, 90, 270, 45, 315, 135, 225, 20, 160, 200, 340].map((angle) => {
          const [c, s] = [Math.cos((angle * Math.PI) / 180), Math.sin((angle * Math.PI) / 180)];
          const l = p.px + c * far - (c < -0.5 ? w : Math.abs(c) <= 0.5 ? w / 2 : 0);
          const mid = p.py - s * (far + (Math.abs(c) < 0.9 ? 3 : 0));
          return { l, r: l + w, t: mid - 7, b: mid + 7 };
        });
        const spot = spots.find(free);
        if (!spot) continue;
        taken.push(spot);
        if (far > 16) {
          const to = Math.max(spot.l, Math.min(spot.r, p.px));
          node.prepend(svg("line", { class: "leader", x1: p.px, y1: p.py, x2: to, y2: p.py < spot.t ? spot.t : p.py > spot.b ? spot.b : p.py }));
        }
        node.append(svg("text", { class: "label", x: spot.l + 1, y: spot.b - 3 }, p.text));
        break;
      }
    }
  }

  function drawScatter(spec, width, styles) {
    const ranges = {
      x: spec.xRange || rangeOf(spec.series.flatMap((s) => s.x), spec.logX, 0.12),
      y: spec.yRange || rangeOf(spec.series.flatMap((s) => s.y), spec.logY, 0.12),
    };
    const { node, x, y, box } = frame(spec, width, ranges);
    for (const line of spec.lines || [])
      if (usable(line.y, spec.logY) && line.y >= ranges.y[0] && line.y <= ranges.y[1])
        node.append(
          svg("line", { class: "mark", x1: box.left, x2: box.right, y1: y(line.y), y2: y(line.y) }),
          svg("text", { class: "tick end", x: box.right - 4, y: y(line.y) - 5 }, line.label),
        );
    const points = spec.series.map((s, k) =>
      s.x.flatMap((value, i) =>
        usable(value, spec.logX) && usable(s.y[i], spec.logY)
          ? [{ px: x(value), py: y(s.y[i]), i, s: k, text: bench.shortened((s.names && s.names[i]) || s.label, 22) }]
          : [],
      ),
    );
    const flat = points.flat().sort((a, b) => a.px - b.px);
    for (const p of flat) node.append(bench.marker(styles[p.s], p.px, p.py, 4.5));
    if (flat.length <= 60) placeLabels(node, box, flat);
    return { node, points };
  }

  function pointText(spec, p) {
    const s = spec.series[p.s];
    const say = (v) => (typeof v === "number" ? number(v, 4) : String(v));
    const name = (s.names && s.names[p.i]) || s.label;
    return `${name}: ${spec.xLabel} ${say(s.x[p.i])}, ${spec.yLabel} ${say(s.y[p.i])}`;
  }

  // Let the arrow keys and the pointer step through the points; returns what to do after drawing.
  function stepping(spec, plot, readout) {
    let points = [];
    let at = [0, 0];
    const show = (p) => {
      plot.querySelectorAll(".cursor").forEach((node) => node.remove());
      plot.firstChild.append(svg("circle", { class: "cursor", cx: p.px, cy: p.py, r: 8 }));
      readout.textContent = pointText(spec, p);
    };
    plot.addEventListener("keydown", (event) => {
      const move = { ArrowRight: [0, 1], ArrowLeft: [0, -1], ArrowDown: [1, 0], ArrowUp: [-1, 0], Home: [0, -1e9], End: [0, 1e9] }[event.key];
      const rows = points.filter((row) => row.length);
      if (!move || !rows.length) return;
      event.preventDefault();
      const row = (at[0] + move[0] + rows.length) % rows.length;
      at = [row, Math.max(0, Math.min(rows[row].length - 1, at[1] + move[1]))];
      show(rows[row][at[1]]);
    });
    plot.addEventListener("pointermove", (event) => {
      const rect = plot.firstChild.getBoundingClientRect();
      const [x, y] = [event.clientX - rect.left, event.clientY - rect.top];
      let best = null;
      for (const p of points.flat()) {
        const d = (p.px - x) ** 2 + (p.py - y) ** 2;
        if (!best || d < best.d) best = { d, p };
      }
      if (best && best.d < 1600) show(best.p);
    });
    return (found) => void (points = found);
  }

  function legend(spec, styles) {
    const items = spec.series.map((s, k) => {
      const st = styles[k];
      const line = spec.kind === "scatter" || spec.kind === "bars" ? null
        : svg("line", { x1: 1, x2: 35, y1: 7, y2: 7, stroke: st.colour, "stroke-width": st.width, "stroke-dasharray": st.dash || null });
      return el("li", {}, svg("svg", { width: 36, height: 14, "aria-hidden": "true" }, line, bench.marker(st, 18, 7, 3.8)), s.label);
    });
    return el("ul", { class: "legend", "aria-label": "Legend" }, items);
  }

  function numbersOf(spec) {
    const say = (v) => (typeof v === "number" ? number(v, 4) : String(v === null ? "–" : v));
    const rows = spec.series.flatMap((s) =>
      s.x.map((x, i) =>
        el("tr", {}, el("th", { scope: "row" }, (s.names && s.names[i]) || s.label), el("td", {}, say(x)), el("td", {}, say(s.y[i]))),
      ),
    );
    const heads = ["Series", spec.xLabel, spec.yLabel].map((h) => el("th", { scope: "col" }, h));
    return bench.scroll(`Numbers of: ${spec.title}`, el("table", { class: "plain" }, el("thead", {}, el("tr", {}, heads)), el("tbody", {}, rows)));
  }

  function chart(kind, draw, given) {
    const spec = { ...given, kind };
    const styles = stylesOf(spec);
    const readout = el("p", { class: "readout", "aria-live": "polite" }, spec.hint || "Point at the chart, or focus it and use the arrow keys, to read its values.");
    const label = `${spec.title}. ${spec.yLabel} over ${spec.xLabel}. Arrow keys step through the points.`;
    const plot = el("div", { class: "plot", tabindex: "0", role: "application", "aria-roledescription": "chart", "aria-label": label });
    const found = stepping(spec, plot, readout);
    const details = el("details", { class: "numbers", ontoggle: () => details.children.length < 2 && details.append(numbersOf(spec)) }, el("summary", {}, "Numbers"));
    const figure = el("figure", { class: "chart" },
      el("figcaption", {}, el("strong", {}, spec.title), spec.note ? el("span", {}, spec.note) : null),
      spec.series.length > 1 && !spec.noLegend ? legend(spec, styles) : null, plot, readout, details);
    let width = 0;
    const redraw = (room) => {
      if (!room || Math.abs(room - width) < 2) return;
      width = room;
      const { node, points } = draw(spec, width, styles);
      plot.replaceChildren(node);
      found(points);
    };
    redraw(640);
    new ResizeObserver((entries) => redraw(Math.floor(entries[0].contentRect.width))).observe(plot);
    return figure;
  }

  bench.charts = {
    line: (spec) => chart("line", drawLines, spec),
    bars: (spec) => chart("bars", drawBars, spec),
    scatter: (spec) => chart("scatter", drawScatter, spec),
    profile: (spec) => chart("profile", drawLines, { logX: true, steps: true, yRange: [0, 1.02], ...spec }),
  };
}
