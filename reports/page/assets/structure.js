/* The structure view: one projection and one set of marks for mode shapes and for what was found. */
{
  const { el, svg } = bench;
  // How a mode shape is first seen, and where nothing moves: azimuth and elevation in degrees.
  const START = { "out-of-plane": [32, 34], "in-plane": [14, 12], "3d": [34, 24] };
  const FLAT = { "out-of-plane": [0, 90], "in-plane": [0, 0], "3d": START["3d"] };
  const CYCLE = 2400; // ms of one period on the screen
  const REACH = 0.22; // of the radius of the structure, a reading of 1 at an amplitude of 1
  const LETTER = 6.4; // px a letter takes at 12 px
  const MOST_LABELS = 12; // of findings that are told in words on the drawing
  const LONGEST = 40; // letters beside a place
  const ROBUST = 3; // medians at which colours of changes end
  const BLOCKS = { used: "used", higher: "held out", modified: "modified, held out" };
  const HELP =
    "Arrow keys or dragging turn the structure, + and - or two fingers or the wheel (once it has the focus) zoom, " +
    "R resets, space plays and pauses, N and P go to the next and previous mode.";

  const add = (a, b, factor = 1) => a.map((value, k) => value + factor * b[k]);
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const mix = (a, b, share) => a.map((value, k) => (1 - share) * value + share * b[k]);
  const move = ([x, y]) => `M${x.toFixed(1)},${y.toFixed(1)}`;
  const straight = (points) => points.map((p, i) => `${i ? "L" : "M"}${p[0].toFixed(1)},${p[1].toFixed(1)}`).join("");
  const smooth = d3.line().curve(d3.curveCardinal).digits(1);

  /** Return centre and size (radius in m) of the nodes. */
  const extent = (nodes) => {
    const sides = [0, 1, 2].map((k) => d3.extent(nodes, (node) => node[k]));
    return { centre: sides.map(([low, high]) => (low + high) / 2), radius: Math.max(Math.hypot(...sides.map(([low, high]) => high - low)) / 2, 1e-9) };
  };

  /** Return the nodes of every member in order, as chains to draw smooth lines through. */
  const chainsOf = (stage) => stage.elements.reduce((found, [start, stop], i) => {
    const last = found.at(-1);
    if (last && last.member === stage.member_of[i] && last.nodes.at(-1) === start) last.nodes.push(stop);
    else found.push({ member: stage.member_of[i], nodes: [start, stop] });
    return found;
  }, []).map(({ nodes }) => nodes);

  /** Return the motion of a sensor in a shape: of its node, or of the nearest point of an element. */
  const motionAt = (stage, shape, { node, xyz }) => {
    if (node !== null && node !== undefined) return shape[node];
    const spots = stage.elements.map(([i, j]) => {
      const along = add(stage.nodes[j], stage.nodes[i], -1);
      const share = Math.min(Math.max(dot(add(xyz, stage.nodes[i], -1), along) / (dot(along, along) || 1), 0), 1);
      return { i, j, share, gap: Math.hypot(...add(xyz, mix(stage.nodes[i], stage.nodes[j], share), -1)) };
    });
    const best = d3.least(spots, ({ gap }) => gap) ?? { i: 0, j: 0, share: 0 };
    return mix(shape[best.i], shape[best.j], best.share);
  };

  /** Return what the sensors read of a shape; null for rotations, which shapes do not have. */
  const readings = (stage, shape) => stage.sensors.map((sensor) => (sensor.rotation ? null : dot(motionAt(stage, shape, sensor), sensor.axis)));

  /** Return the factor that brings measured readings nearest to predicted ones, and their MAC. */
  const match = (measured, predicted) => {
    const known = d3.zip(measured, predicted).filter(([m, p]) => m !== null && p !== null);
    const [mm, mp, pp] = [d3.sum(known, ([m]) => m * m), d3.sum(known, ([m, p]) => m * p), d3.sum(known, ([, p]) => p * p)];
    return { factor: mm ? mp / mm : 0, mac: mm * pp ? (mp * mp) / (mm * pp) : 0 };
  };

  /** Return the projection of points in m to px, with the directions of the page. */
  const camera = ({ turn: [azimuth, elevation], zoom, fit }, frame, width, height) => {
    const [a, e] = [(azimuth * Math.PI) / 180, (elevation * Math.PI) / 180];
    const right = [Math.cos(a), Math.sin(a), 0];
    const up = [-Math.sin(e) * Math.sin(a), Math.sin(e) * Math.cos(a), Math.cos(e)];
    const scale = (zoom * fit * Math.min(width, height * 1.6)) / (2 * frame.radius);
    const project = (xyz) => {
      const from = add(xyz, frame.centre, -1);
      return [width / 2 + scale * dot(from, right), height / 2 - scale * dot(from, up)];
    };
    return { project, right, up };
  };

  /** Return the scale at which the structure fills the drawing with its shapes. */
  const fitted = (turn, frame, stage, reach, width, height, margin = 40) => {
    const { project } = camera({ turn, zoom: 1, fit: 1 }, frame, width, height);
    const axes = reach ? [...new Map(stage.sensors.filter(({ rotation }) => !rotation).map(({ axis }) => [axis.map(Math.abs).join(), axis])).values()] : [];
    const points = stage.nodes.flatMap((node) => [node, ...axes.flatMap((axis) => [add(node, axis, reach), add(node, axis, -reach)])]).map(project);
    const half = (k, size) => Math.max(...points.map((p) => Math.abs(p[k] - size / 2)), 1);
    return Math.min((width / 2 - margin) / half(0, width), (height / 2 - 30) / half(1, height));
  };

  /** Return what was found with its lines and points in m; changes of elements where nothing better is known. */
  const foundIn = (stage, exhibit) => {
    const whole = stage.members.length ? stage.members.map(({ ends }) => ends.map((end) => stage.joints[end].xyz)) : stage.elements.map((pair) => pair.map((k) => stage.nodes[k]));
    const given = exhibit?.findings ?? [];
    if (given.length) {
      return given.map((finding) => ({ ...finding, lines: finding.kind === "all" ? whole
        : finding.kind === "pair" && finding.points.length === 2 ? [finding.points]
          : finding.spans.filter(({ member }) => whole[member]).map(({ member, start, end }) => [mix(...whole[member], start), mix(...whole[member], end)]) }));
    }
    return (exhibit?.elements ?? []).map((value, k) => ({ kind: "element", symbol: "change", norm: true, points: [], value,
      label: `${stage.element_labels[k] || "joint arm"} ${value === null ? "?" : percent(value, "")}`, lines: [stage.elements[k].map((node) => stage.nodes[node])] })).filter(({ value }) => value);
  };

  const percent = (value, plus = "+") => `${value < 0 ? "\u2212" : plus}${d3.format(Math.abs(value) >= 0.0995 ? ".0f" : ".2~r")(100 * Math.abs(value))} %`;

  /** Return the change at which colours end: the largest, or three medians where that is less. */
  const scaleEnd = (found) => {
    const sizes = found.filter(({ symbol, value }) => symbol === "change" && value).map(({ value }) => Math.abs(value));
    return Math.min(d3.max(sizes) ?? 1, ROBUST * (d3.median(sizes) ?? 1));
  };

  /** Return what writes names at free places around points, where there are any. */
  const namer = (layer, width, taken = []) => (text, [x, y], kind = "", must = false) => {
    const wide = (kind === "strong" ? 1.15 : 1) * LETTER * text.length;
    const spots = [[8, -7], [8, 15], [-8 - wide, -7], [-8 - wide, 15], [-wide / 2, -12], [-wide / 2, 21]];
    const boxAt = ([dx, dy]) => ({ l: x + dx - 1, r: x + dx + wide + 1, t: y + dy - 11, b: y + dy + 3 });
    const free = (o) => o.l >= 0 && o.r <= width && !taken.some((box) => o.l < box.r && o.r > box.l && o.t < box.b && o.b > box.t);
    const spot = spots.find((one) => free(boxAt(one))) ?? (must ? spots[0] : null);
    if (!spot) return;
    taken.push(boxAt(spot));
    layer.append(svg("text", { x: Math.max(Math.min(x + spot[0], width - wide - 3), 2), y: y + spot[1], class: kind }, text));
  };

  const zigzag = (from, to) => {
    const [dx, dy] = add(to, from, -1);
    const length = Math.hypot(dx, dy) || 1;
    const side = (share, off) => [from[0] + share * dx - (off * dy) / length, from[1] + share * dy + (off * dx) / length];
    return straight([from, ...d3.range(1, 9).map((k) => side(k / 9, k % 2 ? 4 : -4)), to]) + straight([side(1, -7), side(1, 7)]);
  };

  const arrow = (from, to) => {
    const [dx, dy] = add(to, from, -1);
    const length = Math.hypot(dx, dy);
    const head = Math.min(8, 0.6 * length) / (length || 1);
    const back = (side) => [to[0] - head * (dx - 0.5 * side * dy), to[1] - head * (dy + 0.5 * side * dx)];
    return straight([from, to]) + (length < 2 ? "" : straight([back(1), to, back(-1)]));
  };

  const SIGNS = {
    spring: ([x, y]) => svg("circle", { cx: x, cy: y, r: 6, class: "ring" }),
    mass: ([x, y]) => svg("rect", { x: x - 6, y: y - 6, width: 12, height: 12, class: "solid" }),
    fault: ([x, y]) => svg("path", { d: straight([[x - 6, y - 6], [x + 6, y + 6]]) + straight([[x - 6, y + 6], [x + 6, y - 6]]), class: "cross" }),
    change: ([x, y]) => svg("circle", { cx: x, cy: y, r: 6, class: "solid" }),
  };

  /** Draw what was found: coloured members, a ring at a spring's end, a square at a mass. */
  const drawFound = (layer, write, found, end, project) => {
    const words = found.length <= MOST_LABELS;
    const order = d3.sort(found, ({ kind }) => (kind === "all" ? 0 : 1), ({ value }) => Math.abs(value ?? 0));
    const told = [];
    for (const { label, lines, points, symbol, value, kind, norm } of order) {
      const share = value ? Math.min(Math.abs(value) / (end || 1), 1) : 1;
      const sort = value === null || symbol !== "change" ? "other" : norm ? "norm" : value > 0 ? "more" : "less";
      const [flat, middles] = [lines.map((line) => line.map(project)), kind === "all" || kind === "pair" ? [] : lines.map((line) => project(mix(...line, 0.5)))];
      const group = svg("g", { class: `found ${sort}`, style: { "--share": `${Math.round(35 + 65 * share)}%` } }, svg("title", {}, label));
      if (symbol === "change" || kind === "pair") group.append(svg("path", { d: flat.map(straight).join(""), "stroke-width": (3 + 5 * share).toFixed(1), "stroke-dasharray": kind === "pair" ? "5 4" : null }));
      const at = [...(kind === "pair" ? [] : points.map(project)), ...(symbol === "change" ? [] : middles)];
      group.append(...at.map(SIGNS[symbol]));
      layer.append(group);
      const anchor = [...at, ...middles][0];
      const short = bench.shortened(label, LONGEST);
      if (kind === "all") told.push([`everywhere: ${short}`, [4, 22], "strong", true]);
      else if (anchor) told.push(words ? [short, anchor, "strong", true] : [percent(value ?? 0, norm ? "" : "+"), anchor]);
    }
    // The largest come first where there is not room for all.
    for (const one of told.reverse().slice(0, 2 * MOST_LABELS)) write(...one);
  };

  /** Draw joints, sensors, attachments and the directions of the page. */
  const drawFixed = (layer, write, stage, show, { project, right, up }, radius, height) => {
    const mark = (kind, d) => layer.append(svg("path", { class: kind, d }));
    for (const { node, xyz, name, type } of stage.joints) {
      const [x, y] = project(stage.nodes[node] ?? xyz);
      layer.append(svg("circle", { cx: x, cy: y, r: 3, class: "joint" }));
      if (show.joints) write(type && type !== name ? `${name} (${type})` : name, [x, y], "", true);
    }
    for (const { xyz, axis, stiffness } of show.attached ? stage.springs : []) {
      const [from, tip] = [project(xyz), project(add(xyz, axis, -0.12 * radius))];
      const to = Math.hypot(...add(tip, from, -1)) < 12 ? add(from, [0, 26]) : tip;
      mark("attached line", zigzag(from, to));
      write(`${bench.heat.scientific(stiffness)} N/m`, to, "", true);
    }
    for (const { xyz, fixed } of show.attached ? stage.supports : []) {
      const [x, y] = project(xyz);
      mark("attached", `${straight([[x, y], [x - 8, y + 13], [x + 8, y + 13]])}Z`);
      write(`held ${fixed.join(" ")}`, [x, y + 8], "", true);
    }
    for (const { xyz, kg } of show.attached ? stage.masses : []) {
      const [x, y] = project(xyz);
      mark("attached", `M${x - 5},${y - 5}h10v10h-10Z`);
      write(kg < 1 ? `${Number((1000 * kg).toPrecision(3))} g` : `${Number(kg.toPrecision(3))} kg`, [x, y], "", true);
    }
    for (const { xyz, axis, rotation, label } of stage.sensors) {
      const at = project(xyz);
      mark("measured", `M${at[0] - 2.5},${at[1] - 2.5}h5v5h-5Z${show.sensors && !rotation ? arrow(at, project(add(xyz, axis, 0.09 * radius))) : ""}`);
      if (show.sensors) write(label, at, "measured-name");
    }
    ["x", "y", "z"].forEach((name, k) => {
      const way = [right[k], -up[k]];
      mark("axis", arrow([34, height - 34], add([34, height - 34], way, 24)));
      if (24 * Math.hypot(...way) > 6) layer.append(svg("text", { x: 31 + 32 * way[0], y: height - 30 + 32 * way[1], class: "soft" }, name));
    });
  };

  /** Return the lines of a structure as one path; nodes without elements are dots. */
  const outline = (chains, points) => chains.length ? chains.map((nodes) => smooth(nodes.map((node) => points[node]))).join("") : points.map((p) => `${move(p)}h0`).join("");

  const hz = (value) => (value < 0 ? `${(-value).toPrecision(5)}i` : Number(value.toPrecision(5)).toString()) + " Hz";
  const same = (a, b) => (a ?? null) === (b ?? null);

  /** Return the modes that can be picked: every measured one, then what the model has besides. */
  const modesOf = (stage, entry) => {
    const own = entry && entry.exhibit ? entry.exhibit.modes : [];
    const measured = stage.measured.map((mode) => ({
      measured: mode,
      predicted: own.find((item) => item.paired === mode.mode && same(item.modification, mode.modification)) ?? null,
    }));
    const alone = own.filter((item) => item.paired === null).map((item) => ({ measured: null, predicted: item }));
    return [...measured, ...alone];
  };

  const keyOf = (mode) =>
    mode.measured ? `m${mode.measured.mode}/${mode.measured.modification ?? ""}`
      : `p${mode.predicted.hz}/${mode.predicted.modification ?? ""}`;

  const optionText = (mode) => {
    const { measured, predicted } = mode;
    if (!measured) return `not measured, ${hz(predicted.hz)}`;
    return `${measured.mode} (${BLOCKS[measured.block]}), ${hz(measured.hz)}`;
  };

  /** Return the sentence under the picture. */
  const sentence = (mode, name, mac, scored) => {
    const { measured, predicted } = mode;
    const change = (measured ?? predicted).modification;
    const after = change ? `, with \u201c${change}\u201d` : "";
    if (!measured) return `${name}: a mode at ${hz(predicted.hz)} that no measured mode belongs to${after}`;
    const head = `Mode ${measured.mode} (${BLOCKS[measured.block]})${after}: measured ${hz(measured.hz)}`;
    if (!name) return `${head}; no predicted shapes are stored`;
    const own = predicted ? predicted.hz : scored ? scored.predicted_hz : null;
    if (own === null) return `${head}; ${name} has no ${change && !scored ? "stored shape" : "mode"} that belongs to it`;
    const size = Math.abs(100 * (own / measured.hz - 1)).toFixed(2);
    const signed = `${Number(size) === 0 ? "" : own < measured.hz ? "\u2212" : "+"}${size} %`;
    const likeness = mac === null ? "" : `, MAC ${mac.toFixed(3)}`;
    return `${head}, ${name} ${hz(own)} (${signed})${likeness}${predicted ? "" : "; its shape is not stored"}`;
  };

  const choice = (label, options, change) => {
    const select = el("select", { "aria-label": label }, ...options);
    select.addEventListener("change", () => change(select.value));
    return [el("label", { class: "case-field" }, `${label} `, select), select];
  };

  const option = (value, text) => {
    const item = el("option", {}, text);
    item.value = value;
    return item;
  };

  const button = (label, sign, act) => {
    return el("button", { type: "button", class: "case-button", "aria-label": label, title: label, onclick: act }, sign);
  };

  const check = (label, on, change) => {
    const box = el("input", { type: "checkbox" });
    box.checked = on;
    box.addEventListener("change", () => change(box.checked));
    return el("label", { class: "case-check" }, box, ` ${label}`);
  };

  /** Fill the list of modes, in groups by modification. */
  const fillModes = (select, modes) => {
    const groups = new Map();
    modes.forEach((mode) => {
      const change = (mode.measured ?? mode.predicted).modification;
      const name = `${change ? `With \u201c${change}\u201d` : "As tested"}${mode.measured ? "" : ", model only"}`;
      if (!groups.has(name)) groups.set(name, el("optgroup", { label: name }));
      groups.get(name).append(option(keyOf(mode), optionText(mode)));
    });
    select.replaceChildren(...groups.values());
  };

  /** Play: call paint with the phase of the motion while the view is in the page and on screen. */
  const player = (node, paint) => {
    const state = { playing: false, phase: 1, angle: 0 };
    let [seen, timer, last] = [true, null, 0];
    state.go = () => {
      timer?.stop();
      last = 0;
      timer = state.playing && seen ? d3.timer((now) => {
        if (!node.isConnected) return timer.stop();
        state.angle += (2 * Math.PI * Math.min(now - last, 100)) / CYCLE;
        [last, state.phase] = [now, Math.cos(state.angle)];
        paint();
      }) : null;
    };
    new IntersectionObserver((entries) => {
      seen = entries.at(-1).isIntersecting;
      state.go();
    }).observe(node);
    return state;
  };

  /** Return what is drawn of a picked mode: shape, measured arrows scaled to it, MAC. */
  const picture = (stage, mode, modes) => {
    const shape = mode.predicted ? mode.predicted.shape : null;
    if (!mode.measured) return { shape, arrows: null, mac: null, scored: null };
    const { shape: measured, mode: number, modification } = mode.measured;
    const scored = (modes ?? []).find((item) => item.mode === number && same(item.modification, modification)) ?? null;
    if (!shape) return { shape, arrows: measured, mac: scored && scored.mac, scored };
    const { factor, mac } = match(measured, readings(stage, shape));
    const arrows = measured.map((value) => (value === null ? null : factor * value));
    return { shape, arrows, mac: scored && scored.mac !== null ? scored.mac : mac, scored };
  };

  const legend = () => {
    const item = (kind, text) => el("li", {}, el("span", { class: `case-key ${kind}`, "aria-hidden": "true" }), text);
    return el("ul", { class: "case-legend" }, item("shape", "predicted (thick line)"), item("measured", "measured at the sensors (arrow, ring)"),
      item("still", "undeformed (thin line)"), item("attached", "masses, springs, supports"), item("more", "found stiffer or more"), item("less", "found softer or less"), item("ring", "found: a spring"));
  };

  /**
   * Return two strategies' changes as drawings beside each other, on one scale where they are comparable.
   *
   * shown: [{name, exhibit}].
   */
  bench.findings = (stage, shown) => {
    const own = shown.map(({ exhibit }) => foundIn(stage, exhibit));
    const words = own.map((found) => new Set(found.flatMap(({ label, norm }) => (norm ? ["norm"] : label.split(", ").map((text) => text.split(" ")[0])))));
    const shared = own.length === 2 && own.every((found) => found.length) && !words[0].isDisjointFrom(words[1]);
    return shown.map(({ name }, k) => {
      const [found, end] = [own[k], scaleEnd(shared ? own.flat() : own[k])];
      const norm = found.some((item) => item.norm);
      const title = `${name}: ${norm ? "change of every element matrix as a share of what it was (Frobenius norm)" : "what it reports to have changed"}`;
      const width = Math.min(640, Math.max(document.documentElement.clientWidth - 60, 280));
      const [height, turn, frame] = [360, FLAT[stage.plane] ?? FLAT["3d"], extent(stage.nodes)];
      const eye = camera({ turn, zoom: 1, fit: fitted(turn, frame, stage, 0, width, height, 90) }, frame, width, height);
      const [marks, names] = [svg("g", {}), svg("g", { class: "names" })];
      const write = namer(names, width);
      const large = d3.sort(found, ({ value }) => -Math.abs(value ?? Infinity));
      const told = `Largest: ${large.slice(0, 3).map(({ label }) => label).join("; ")}.`;
      drawFound(marks, write, found, end, eye.project);
      for (const joint of stage.joints) write(joint.name, eye.project(joint.xyz), "soft");
      const picture = svg("svg", { viewBox: `0 0 ${width} ${height}`, width, height, class: "case-map structure", role: "img", "aria-label": `${title}. ${told}` },
        svg("path", { class: "still", d: outline(chainsOf(stage), stage.nodes.map(eye.project)) }), marks, names);
      const ends = found.some(({ symbol, value }) => symbol === "change" && value)
        ? `Green is stiffer or more, purple softer or less; colours end at ${percent(end, "")}${found.some(({ symbol, value }) => symbol === "change" && Math.abs(value ?? 0) > 1.001 * end) ? ", and what lies beyond has that colour and its number" : ""}${shared ? "; the scale is the same for both" : shown.length > 1 ? "; the scale is this strategy's own, as the two changed different things" : ""}.` : "";
      const rows = () => large.map(({ label, value }) => el("tr", {}, el("th", { scope: "row" }, label), el("td", { class: "num", "data-value": value }, value === null ? "\u2013" : (100 * value).toFixed(2))));
      const all = el("details", { ontoggle: () => {
        if (all.children.length < 2) all.append(bench.scroll(`Everything: ${title}`, el("table", { class: "case-table" },
          el("thead", {}, el("tr", {}, el("th", { scope: "col" }, "What was found"), el("th", { scope: "col" }, "Change in %"))), el("tbody", {}, rows()))));
      } }, el("summary", {}, "Everything as a table"));
      return el("figure", { class: "case-figure" }, el("figcaption", {}, title), picture, el("p", { class: "case-told" }, `${told} ${ends}`), all);
    });
  };

  /**
   * Show a structure, its mode shapes and what was found on it; returns {pick(name)} to choose the strategy.
   *
   * stage: of the case. exhibits: [{name, exhibit, modes}], one a strategy; exhibit may be null.
   */
  bench.structure = (root, stage, exhibits) => {
    const shown = (exhibits ?? []).filter((entry) => entry.exhibit);
    const start = START[stage.plane] ?? START["3d"];
    const [view, frame, chains] = [{ turn: start, zoom: 1, fit: 1 }, extent(stage.nodes), chainsOf(stage)];
    const layers = { still: svg("path", { class: "still" }), found: svg("g", {}), shape: svg("path", { class: "shape" }), fixed: svg("g", {}), arrows: svg("path", { class: "measured line" }), names: svg("g", { class: "names" }) };
    const drawing = svg("svg", { class: "case-view structure", tabindex: "0", role: "application", "aria-roledescription": "structure view" }, Object.values(layers));
    const told = el("p", { class: "case-told", role: "status" });
    const show = { joints: stage.plane !== "matrices", sensors: false, attached: true, measured: true, found: true };
    let [entry, modes, at, now, amplitude, found] = [shown[0] ?? null, [], 0, { shape: null, arrows: null }, 1, []];
    let size = [0, 0]; // read once: asked for at every frame it would lay out the page
    const eyeNow = () => camera(view, frame, ...size);
    const paint = (eye = eyeNow()) => {
      const reach = REACH * amplitude * frame.radius * play.phase;
      layers.shape.setAttribute("d", now.shape ? outline(chains, stage.nodes.map((node, i) => eye.project(add(node, now.shape[i], reach)))) : "");
      layers.arrows.setAttribute("d", now.arrows && show.measured ? stage.sensors.map((sensor, i) => {
        if (now.arrows[i] === null || sensor.rotation) return "";
        const tip = eye.project(add(sensor.xyz, sensor.axis, now.arrows[i] * reach));
        return `${arrow(eye.project(sensor.xyz), tip)}${move(add(tip, [-3.5, 0]))}a3.5,3.5 0 1 0 7,0a3.5,3.5 0 1 0 -7,0`;
      }).join("") : "");
    };
    const draw = () => {
      if (!size[0]) return;
      const eye = eyeNow();
      for (const layer of [layers.found, layers.fixed, layers.names]) layer.replaceChildren();
      const write = namer(layers.names, size[0]);
      layers.still.setAttribute("d", outline(chains, stage.nodes.map(eye.project)));
      layers.still.classList.toggle("alone", !now.shape);
      if (show.found) drawFound(layers.found, write, found, scaleEnd(found), eye.project);
      drawFixed(layers.fixed, write, stage, show, eye, frame.radius, size[1]);
      paint(eye);
    };
    const play = player(drawing, paint);
    const describe = (text) => {
      told.textContent = text;
      drawing.setAttribute("aria-label", `Structure in three dimensions. ${text}. ${play.playing ? "Playing" : "Paused"}. ${HELP}`);
    };
    const pickMode = (index) => {
      at = (index + modes.length) % modes.length;
      modeList.value = keyOf(modes[at]);
      now = picture(stage, modes[at], entry && entry.modes);
      describe(sentence(modes[at], entry ? entry.name : "", now.mac, now.scored));
      draw();
    };
    const pickStrategy = (name) => {
      const key = modes.length ? keyOf(modes[at]) : "";
      entry = shown.find((item) => item.name === name) ?? entry;
      if (entry) strategyList.value = entry.name;
      [modes, found] = [modesOf(stage, entry), foundIn(stage, entry?.exhibit)];
      fillModes(modeList, modes);
      if (modes.length) return pickMode(Math.max(modes.findIndex((mode) => keyOf(mode) === key), 0));
      now = { shape: null, arrows: null };
      describe("No modes are stored");
      draw();
    };
    const step = (by) => modes.length && pickMode(at + by);
    const turn = (azimuth, elevation) => {
      view.turn = [view.turn[0] + azimuth, Math.min(Math.max(view.turn[1] + elevation, -90), 90)];
      draw();
    };
    const picked = d3.select(drawing);
    // A page that scrolls past must not get stuck here: the wheel zooms once the view is in use.
    const zoomer = d3.zoom().scaleExtent([0.3, 12])
      .filter((event) => (event.type === "wheel" ? document.activeElement === drawing || event.ctrlKey : (event.touches?.length ?? 0) > 1))
      .on("zoom", ({ transform }) => {
        view.zoom = transform.k;
        draw();
      });
    const dragger = d3.drag().filter((event) => !event.button && (event.touches?.length ?? 1) < 2).on("drag", ({ dx, dy }) => turn(-0.4 * dx, 0.4 * dy));
    picked.call(zoomer).on("dblclick.zoom", null).call(dragger).style("touch-action", null);
    const zoom = (factor) => () => zoomer.scaleBy(picked, factor);
    const toggle = () => {
      play.playing = !play.playing;
      playButton.textContent = play.playing ? "Pause" : "Play";
      describe(told.textContent);
      play.go();
    };
    const reset = () => {
      [view.turn, play.angle, play.phase] = [start, 0, 1];
      zoomer.transform(picked, d3.zoomIdentity);
      draw();
    };
    const [modeField, modeList] = choice("Mode", [], (key) => pickMode(modes.findIndex((mode) => keyOf(mode) === key)));
    const [strategyField, strategyList] = choice("Strategy", shown.map((item) => option(item.name, item.name)), pickStrategy);
    strategyList.disabled = shown.length === 0;
    const playButton = el("button", { type: "button", class: "case-button case-play", onclick: toggle }, "Play");
    const slider = el("input", { type: "range", min: "0", max: "3", step: "0.1", value: "1", oninput: () => {
      amplitude = Number(slider.value);
      paint();
    } });
    const keys = {
      ArrowLeft: () => turn(6, 0), ArrowRight: () => turn(-6, 0), ArrowUp: () => turn(0, 6), ArrowDown: () => turn(0, -6),
      "+": zoom(1.15), "=": zoom(1.15), "-": zoom(1 / 1.15), r: reset, n: () => step(1), p: () => step(-1), " ": toggle,
    };
    drawing.addEventListener("keydown", (event) => {
      const act = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
      if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      act();
    });
    const flip = (name) => (on) => {
      show[name] = on;
      draw();
    };
    root.append(el("div", { class: "case-structure" },
      el("div", { class: "case-controls" }, strategyField, modeField,
        el("span", { class: "case-group" }, button("Previous mode (P)", "\u2039", () => step(-1)), playButton, button("Next mode (N)", "\u203a", () => step(1))),
        el("label", { class: "case-field" }, "Amplitude ", slider)),
      drawing, told,
      el("div", { class: "case-controls" },
        el("span", { class: "case-group", role: "group", "aria-label": "View" },
          button("Turn left", "\u2190", keys.ArrowLeft), button("Turn right", "\u2192", keys.ArrowRight), button("Tilt up", "\u2191", keys.ArrowUp),
          button("Tilt down", "\u2193", keys.ArrowDown), button("Zoom in (+)", "+", keys["+"]), button("Zoom out (-)", "\u2212", keys["-"]), button("Reset the view (R)", "Reset", reset)),
        check("Joints", show.joints, flip("joints")), check("Sensors", show.sensors, flip("sensors")), check("Attachments", show.attached, flip("attached")),
        check("Measured", show.measured, flip("measured")), check("Found", show.found, flip("found"))),
      legend(), el("p", { class: "case-hint" }, HELP)));
    pickStrategy(shown[0] ? shown[0].name : "");
    new ResizeObserver(() => {
      if (!drawing.clientWidth) return;
      size = [drawing.clientWidth, drawing.clientHeight];
      view.fit = fitted(start, frame, stage, REACH * frame.radius, ...size);
      draw();
    }).observe(drawing);
    if (shown.length && !matchMedia("(prefers-reduced-motion: reduce)").matches) toggle();
    return { pick: pickStrategy };
  };
}
