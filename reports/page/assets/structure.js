/* The structure view: one projection and one set of marks for mode shapes and for what was found. */
{
  const { el, svg } = bench;
  // How a mode shape is first seen, and where nothing moves: azimuth and elevation in degrees.
  const START = { "out-of-plane": [32, 34], "in-plane": [14, 12], "3d": [34, 24] };
  const FLAT = { ...START, "out-of-plane": [0, 90], "in-plane": [0, 0] };
  const CYCLE = 2400; // ms of one period on the screen
  const FRAMES = 24; // of a cycle that is saved
  const REACH = 0.22; // of the radius of the structure, a reading of 1 at an amplitude of 1
  const MOST_LABELS = 12; // of findings that are stated in words on the drawing
  const MANY = 100; // findings; more are drawn by colours while the view moves
  const MOST_BENT = 300; // nodes with smooth lines between them; those of more lie close enough
  const LONGEST = 40; // letters next to a place
  const ROBUST = 3; // medians at which colours of changes end
  const BLOCKS = { used: "used", higher: "held out", modified: "modified, held out" };
  const HELP =
    "Arrow keys or dragging turn the structure, + and - or two fingers or the wheel (once it has the focus) zoom, " +
    "R resets, space plays and pauses, N and P go to the next and previous mode.";

  const add = (a, b, factor = 1) => a.map((value, k) => value + factor * b[k]);
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const mix = (a, b, share) => a.map((value, k) => (1 - share) * value + share * b[k]);
  const percent = (value, plus = "+") => `${value < 0 ? "−" : plus}${d3.format(Math.abs(value) >= 0.0995 ? ".0f" : ".2~r")(100 * Math.abs(value))} %`;
  const hz = (value) => `${Number(Math.abs(value).toPrecision(5))}${value < 0 ? "i" : ""} Hz`;

  const straight = d3.line().digits(1);
  const smooth = d3.line().curve(d3.curveCardinal).digits(1);
  const ring = ([x, y], r) => `M${(x - r).toFixed(1)},${y.toFixed(1)}a${r},${r} 0 1 0 ${2 * r},0a${r},${r} 0 1 0 ${-2 * r},0`;
  const box = ([x, y], r) => `M${(x - r).toFixed(1)},${(y - r).toFixed(1)}h${2 * r}v${2 * r}h${-2 * r}Z`;
  const cross = ([x, y], r) => straight([[x - r, y - r], [x + r, y + r]]) + straight([[x - r, y + r], [x + r, y - r]]);
  const SIGNS = { spring: ["ring", ring], mass: ["solid", box], fault: ["cross", cross], change: ["solid", ring] };

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
  /** Return the lines of a structure as one path; nodes without elements are dots. */
  const outline = (chains, points, pen = points.length > MOST_BENT ? straight : smooth) => (chains.length ? chains.map((nodes) => pen(nodes.map((node) => points[node]))) : points.map((p) => straight([p, p]))).join("");

  /** Return the nodes of every member in order, as chains to draw smooth lines through. */
  const chainsOf = (stage) => stage.elements.reduce((found, [start, stop], i) => {
    const last = found.at(-1);
    if (last && last.member === stage.member_of[i] && last.nodes.at(-1) === start) last.nodes.push(stop);
    else found.push({ member: stage.member_of[i], nodes: [start, stop] });
    return found;
  }, []).map(({ nodes }) => nodes);

  /** Return the edges of a mesh, which stand still, as lines in m. */
  const edgesOf = (stage) => (stage.outlines ?? []).flatMap(({ lines }) => lines);

  const drawnEdges = (stage, project) => edgesOf(stage).map((line) => straight(line.map(project))).join("");
  const allOf = (stage) => [...stage.nodes, ...edgesOf(stage).flat()];

  /** Return centre and size (radius in m) of the nodes. */
  const extent = (nodes) => {
    const sides = [0, 1, 2].map((k) => d3.extent(nodes, (node) => node[k]));
    return { centre: sides.map((side) => d3.mean(side)), radius: Math.max(Math.hypot(...sides.map(([low, high]) => high - low)) / 2, 1e-9) };
  };

  /** Return the projection of points and of directions in m to px, with the directions of the page. */
  const camera = ({ turn: [azimuth, elevation], zoom = 1, fit = 1 }, frame, width, height) => {
    const [a, e] = [(azimuth * Math.PI) / 180, (elevation * Math.PI) / 180];
    const right = [Math.cos(a), Math.sin(a), 0];
    const up = [-Math.sin(e) * Math.sin(a), Math.sin(e) * Math.cos(a), Math.cos(e)];
    const scale = (zoom * fit * Math.min(width, height * 1.6)) / (2 * frame.radius);
    const direct = (way) => [scale * dot(way, right), -scale * dot(way, up)];
    return { right, up, direct, project: (xyz) => add([width / 2, height / 2], direct(add(xyz, frame.centre, -1))) };
  };

  /** Return the scale at which the structure fills the drawing with its shapes. */
  const fitted = (turn, frame, stage, reach, width, height, margin = 40) => {
    const { project } = camera({ turn }, frame, width, height);
    const axes = new Map(stage.sensors.filter(({ rotation }) => reach && !rotation).map(({ axis }) => [axis.map(Math.abs).join(), axis]));
    const points = allOf(stage).flatMap((node) => [node, ...[...axes.values()].flatMap((axis) => [add(node, axis, reach), add(node, axis, -reach)])]).map(project);
    const half = (k, size) => Math.max(d3.max(points, (p) => Math.abs(p[k] - size / 2)), 1);
    return Math.min((width / 2 - margin) / half(0, width), (height / 2 - 30) / half(1, height));
  };

  /** Return the motion of a sensor in a shape: of its node, or of the nearest point of an element. */
  const motionAt = (stage, shape, { node, xyz }) => {
    if ((node ?? null) !== null) return shape[node];
    const spots = stage.elements.map(([i, j]) => {
      const along = add(stage.nodes[j], stage.nodes[i], -1);
      const share = Math.min(Math.max(dot(add(xyz, stage.nodes[i], -1), along) / (dot(along, along) || 1), 0), 1);
      return { i, j, share, gap: Math.hypot(...add(xyz, mix(stage.nodes[i], stage.nodes[j], share), -1)) };
    });
    const best = d3.least(spots, ({ gap }) => gap) ?? { i: 0, j: 0, share: 0 };
    return mix(shape[best.i], shape[best.j], best.share);
  };

  /** Return what is drawn of a picked mode: shape, measured arrows scaled to it, MAC. */
  const picture = (stage, { measured, predicted }, modes) => {
    const shape = predicted?.shape ?? null;
    if (!measured) return { shape, arrows: null, mac: null, scored: null };
    const scored = (modes ?? []).find((item) => item.mode === measured.mode && (item.modification ?? null) === (measured.modification ?? null)) ?? null;
    if (!shape) return { shape, arrows: measured.shape, mac: scored && scored.mac, scored };
    // Rotations are not in the shapes.
    const read = stage.sensors.map((sensor) => (sensor.rotation ? null : dot(motionAt(stage, shape, sensor), sensor.axis)));
    const known = d3.zip(measured.shape, read).filter(([m, p]) => m !== null && p !== null);
    const [mm, mp, pp] = [d3.sum(known, ([m]) => m * m), d3.sum(known, ([m, p]) => m * p), d3.sum(known, ([, p]) => p * p)];
    const arrows = measured.shape.map((value) => (value === null || !mm ? null : (mp / mm) * value));
    return { shape, arrows, mac: scored?.mac ?? (mm * pp ? (mp * mp) / (mm * pp) : 0), scored };
  };

  /** Return the modes that can be picked, every measured one and then what the model has as well, by their keys. */
  const modesOf = (stage, entry) => {
    const own = entry?.exhibit?.modes ?? [];
    const partner = ({ mode, modification }) => own.find((item) => item.paired === mode && (item.modification ?? null) === (modification ?? null)) ?? null;
    const modes = [...stage.measured.map((measured) => ({ measured, predicted: partner(measured) })),
      ...own.filter((item) => item.paired === null).map((predicted) => ({ measured: null, predicted }))];
    return new Map(modes.map(({ measured, predicted }) => {
      const { modification } = measured ?? predicted;
      const group = `${modification ? `With “${modification}”` : "As tested"}${measured ? "" : ", model only"}`;
      const text = measured ? `${measured.mode} (${BLOCKS[measured.block]}), ${hz(measured.hz)}` : `not measured, ${hz(predicted.hz)}`;
      return [`${measured ? `m${measured.mode}` : `p${predicted.hz}`}/${modification ?? ""}`, { measured, predicted, group, text }];
    }));
  };

  /** Return the sentence under the picture. */
  const sentence = ({ measured, predicted }, name, { mac, scored }) => {
    const { modification } = measured ?? predicted;
    const after = modification ? `, with “${modification}”` : "";
    if (!measured) return `${name}: a mode at ${hz(predicted.hz)} that no measured mode belongs to${after}`;
    const head = `Mode ${measured.mode} (${BLOCKS[measured.block]})${after}: measured ${hz(measured.hz)}`;
    if (!name) return `${head}; no predicted shapes are stored`;
    const own = predicted ? predicted.hz : (scored?.predicted_hz ?? null);
    if (own === null) return `${head}; ${name} has no ${modification && !scored ? "stored shape" : "mode"} that belongs to it`;
    const error = 100 * (own / measured.hz - 1);
    return `${head}, ${name} ${hz(own)} (${bench.percent(error, 2).replace(/^.(?=0\.00$)/, "")} %)${mac === null ? "" : `, MAC ${mac.toFixed(3)}`}${predicted ? "" : "; its shape is not stored"}`;
  };

  /** Return what was found with its lines and points in m; changes of elements where nothing better is known. */
  const foundIn = (stage, exhibit) => {
    const edges = edgesOf(stage);
    const whole = edges.length ? edges : stage.members.length ? stage.members.map(({ ends }) => ends.map((end) => stage.joints[end].xyz)) : stage.elements.map((pair) => pair.map((k) => stage.nodes[k]));
    const linesOf = ({ kind, points, spans }) => {
      if (kind === "all") return whole;
      if (kind === "pair" && points.length === 2) return [points];
      if (kind === "outline") return d3.range(0, points.length, 2).map((k) => points.slice(k, k + 2));
      return spans.filter(({ member }) => whole[member]).map(({ member, start, end }) => [mix(...whole[member], start), mix(...whole[member], end)]);
    };
    if (exhibit?.findings?.length) return exhibit.findings.map((finding) => ({ ...finding, lines: linesOf(finding) }));
    return (exhibit?.elements ?? []).map((value, k) => ({ kind: "element", symbol: "change", norm: true, points: [], value,
      label: `${stage.element_labels[k] || "joint arm"} ${value === null ? "?" : percent(value, "")}`, lines: [stage.elements[k].map((node) => stage.nodes[node])] })).filter(({ value }) => value);
  };

  /** Return the change at which colours end: the largest, or three medians where that is less. */
  const isSized = ({ symbol, value }) => symbol === "change" && value;
  const scaleEnd = (found) => {
    const sizes = found.filter(isSized).map(({ value }) => Math.abs(value));
    return Math.min(d3.max(sizes) ?? 1, ROBUST * (d3.median(sizes) ?? 1));
  };

  /** Draw what was found: coloured members, a ring at a spring's end, a square at a mass. */
  const drawFound = (layer, write, found, end, project, moving) => {
    const looks = found.map((item, k) => {
      const { label, lines, points, symbol, value, kind, norm } = item;
      const share = value ? Math.round(20 * Math.min(Math.abs(value) / (end || 1), 1)) / 20 : 1;
      const sort = value === null || symbol !== "change" ? "other" : norm ? "norm" : value > 0 ? "more" : "less";
      const pair = kind === "pair";
      const middles = kind === "all" || pair ? [] : lines.map((line) => project(mix(...line, 0.5)));
      const at = [...(pair || kind === "outline" ? [] : points.map(project)), ...(symbol === "change" ? [] : middles)];
      const paths = symbol === "change" || pair ? lines.map((line) => straight(line.map(project))).join("") : "";
      return { label, kind, value, norm, share, sort, pair, paths, signs: at.map((p) => SIGNS[symbol][1](p, 6)).join(""), sign: SIGNS[symbol][0], anchor: [...at, ...middles][0], size: Math.abs(value ?? 0), k };
    });
    const order = d3.sort(looks, ({ kind }) => kind !== "all", ({ size }) => size);
    const grouped = d3.groups(order, (look) => (moving && found.length > MANY ? [look.sort, look.share, look.pair, look.sign].join() : look.k));
    for (const [, own] of grouped) {
      const [{ sort, share, pair, sign, label }] = own;
      const joined = (key) => own.map((look) => look[key]).join("");
      layer.append(svg("g", { class: `found ${sort}`, style: { "--share": `${35 + 65 * share}%` } }, own.length === 1 && svg("title", {}, label),
        svg("path", { d: joined("paths"), "stroke-width": 3 + 5 * share, "stroke-dasharray": pair ? "5 4" : null }), svg("path", { d: joined("signs"), class: sign })));
    }
    // The largest come first where there is not room for all.
    for (const { label, kind, value, norm, anchor } of order.filter(({ kind, anchor }) => kind === "all" || anchor).reverse().slice(0, 2 * MOST_LABELS)) {
      const short = bench.shortened(label, LONGEST);
      if (kind === "all") write(`everywhere: ${short}`, [-6, 22], { name: "strong", must: true });
      else if (found.length > MOST_LABELS) write(percent(value ?? 0, norm ? "" : "+"), anchor);
      else write(short, anchor, { name: "strong", must: true });
    }
  };

  /** Draw joints, sensors, attachments and the directions of the page. */
  const drawFixed = (layer, write, stage, show, { project, right, up }, radius, height) => {
    const mark = (name, d) => layer.append(svg("path", { class: name, d }));
    const attached = (items, draw) => (show.attachments ? items : []).forEach((item) => {
      const [kind, d, text, at] = draw(item, project(item.xyz));
      mark(kind, d);
      write(text, at, { must: true });
    });
    for (const { node, xyz, name, type } of stage.joints) {
      const at = project(stage.nodes[node] ?? xyz);
      mark("joint", ring(at, 3));
      if (show.joints) write(type && type !== name ? `${name} (${type})` : name, at, { must: true });
    }
    attached(stage.springs, ({ xyz, axis, stiffness }, from) => {
      const tip = project(add(xyz, axis, -0.12 * radius));
      const to = Math.hypot(...add(tip, from, -1)) < 12 ? add(from, [0, 26]) : tip;
      return ["attached line", zigzag(from, to), `${bench.number(stiffness)} N/m`, to];
    });
    attached(stage.supports, ({ fixed }, [x, y]) => ["attached", `${straight([[x, y], [x - 8, y + 13], [x + 8, y + 13]])}Z`, `held ${fixed.join(" ")}`, [x, y + 8]]);
    attached(stage.masses, ({ kg }, at) => ["attached", box(at, 5), kg < 1 ? `${Number((1000 * kg).toPrecision(3))} g` : `${Number(kg.toPrecision(3))} kg`, at]);
    for (const { xyz, axis, rotation, label } of stage.sensors) {
      const at = project(xyz);
      mark("measured", box(at, 2.5) + (show.sensors && !rotation ? arrow(at, project(add(xyz, axis, 0.09 * radius))) : ""));
      if (show.sensors) write(label, at, { name: "measured-name" });
    }
    ["x", "y", "z"].forEach((name, k) => {
      const [dx, dy] = [right[k], -up[k]];
      mark("axis", arrow([34, height - 34], [34 + 24 * dx, height - 34 + 24 * dy]));
      if (24 * Math.hypot(dx, dy) > 6) layer.append(svg("text", { x: 31 + 32 * dx, y: height - 30 + 32 * dy, class: "soft" }, name));
    });
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

  /** Return changes of strategies [{name, exhibit}] as drawings, on one scale where they are comparable. */
  bench.findings = (stage, shown) => {
    const all = shown.map(({ exhibit }) => foundIn(stage, exhibit));
    const words = all.map((found) => new Set(found.flatMap(({ label, norm }) => (norm ? ["norm"] : label.split(", ").map((text) => text.split(" ")[0])))));
    const shared = all.length === 2 && all.every((found) => found.length) && !words[0].isDisjointFrom(words[1]);
    const [width, height, turn, frame] = [Math.min(640, Math.max(document.documentElement.clientWidth - 60, 280)), 360, FLAT[stage.plane] ?? FLAT["3d"], extent(allOf(stage))];
    const { project } = camera({ turn, fit: fitted(turn, frame, stage, 0, width, height, 90) }, frame, width, height);
    return shown.map(({ name }, k) => {
      const [found, end] = [all[k], scaleEnd(shared ? all.flat() : all[k])];
      const title = `${name}: ${found.some(({ norm }) => norm) ? "change of every element matrix as a share of what it was (Frobenius norm)" : "what it reports to have changed"}`;
      const [marks, names] = [svg("g"), svg("g")];
      const write = bench.writer(names, [0, 0, width, height]);
      const large = d3.sort(found, ({ value }) => -Math.abs(value ?? Infinity));
      const stated = `Largest: ${large.slice(0, 3).map(({ label }) => label).join("; ")}.`;
      drawFound(marks, write, found, end, project, false);
      for (const joint of stage.joints) write(joint.name, project(joint.xyz), { name: "soft" });
      const beyond = found.some((item) => isSized(item) && Math.abs(item.value) > 1.001 * end) ? ", and what lies beyond has that colour and its number" : "";
      const whose = shared ? "; the scale is the same for both" : shown.length > 1 ? "; the scale is this strategy's own, as the two changed different things" : "";
      const colours = found.some(isSized) ? ` Green is stiffer or more, purple softer or less; colours end at ${percent(end, "")}${beyond}${whose}.` : "";
      const rows = large.map(({ label, value }) => [label, bench.cell(value, (v) => (v === null ? "–" : (100 * v).toFixed(2)))]);
      return el("figure", { class: "case-figure" }, el("figcaption", {}, title),
        svg("svg", { viewBox: `0 0 ${width} ${height}`, width, height, class: "case-map structure", role: "img", "aria-label": `${title}. ${stated}` },
          svg("path", { class: "still", d: outline(chainsOf(stage), stage.nodes.map(project)) + drawnEdges(stage, project) }), marks, names),
        el("p", { class: "case-stated" }, stated, colours),
        bench.fold("Everything as a table", () => bench.scroll(bench.table(`Everything: ${title}`, ["What was found", "Change in %"], rows))));
    });
  };

  const legend = () => el("ul", { class: "legend" }, [["shape", "predicted (thick line)"], ["measured", "measured at the sensors (arrow, ring)"], ["still", "undeformed (thin line)"],
    ["attached", "masses, springs, supports"], ["more", "found stiffer or more"], ["less", "found softer or less"], ["ring", "found: a spring"]]
    .map(([kind, text]) => el("li", {}, el("span", { class: `case-key ${kind}`, "aria-hidden": "true" }), text)));

  /** Show a structure, its mode shapes and what strategies [{name, exhibit or null, modes}] found on it; returns {pick(name)}. */
  bench.structure = (root, stage, exhibits) => {
    const shown = exhibits.filter((entry) => entry.exhibit);
    const start = START[stage.plane] ?? START["3d"];
    const [view, frame, chains] = [{ turn: start, zoom: 1, fit: 1 }, extent(allOf(stage)), chainsOf(stage)];
    const layers = { still: svg("path", { class: "still" }), found: svg("g"), fixed: svg("g"), names: svg("g"), shape: svg("path", { class: "shape" }), arrows: svg("path", { class: "measured line" }) };
    const drawing = svg("svg", { class: "case-view structure", tabindex: "0", role: "application", "aria-roledescription": "structure view" }, Object.values(layers));
    const stated = el("p", { class: "case-stated", role: "status" });
    const show = { joints: stage.plane !== "matrices", sensors: false, attachments: true, measured: true, found: true };
    let [entry, modes, at, now, amplitude, found] = [shown[0] ?? null, new Map(), null, { shape: null, arrows: null }, 1, []];
    let [size, flat, moving, settling] = [[0, 0], { nodes: [], ways: [], arrows: [] }, false, null];

    // At every frame: what moves. The rest is drawn once more when the view changes.
    const paint = () => {
      if (!size[0]) return;
      const reach = REACH * amplitude * frame.radius * play.phase;
      layers.shape.setAttribute("d", now.shape ? outline(chains, flat.nodes.map((p, i) => add(p, flat.ways[i], reach))) : "");
      layers.arrows.setAttribute("d", flat.arrows.map(([from, way]) => arrow(from, add(from, way, reach)) + ring(add(from, way, reach), 3.5)).join(""));
    };
    const draw = () => {
      if (!size[0]) return;
      const eye = camera(view, frame, ...size);
      for (const layer of [layers.found, layers.fixed, layers.names]) layer.replaceChildren();
      const write = bench.writer(layers.names, [0, 0, ...size]);
      const arrows = stage.sensors.map(({ xyz, axis, rotation }, i) => !rotation && (now.arrows?.[i] ?? null) !== null && [eye.project(xyz), eye.direct(axis.map((v) => now.arrows[i] * v))]);
      flat = { nodes: stage.nodes.map(eye.project), ways: (now.shape ?? []).map(eye.direct), arrows: show.measured ? arrows.filter(Boolean) : [] };
      layers.still.setAttribute("d", outline(chains, flat.nodes) + drawnEdges(stage, eye.project));
      layers.still.classList.toggle("alone", !now.shape);
      if (show.found) drawFound(layers.found, write, found, scaleEnd(found), eye.project, moving || play.playing);
      drawFixed(layers.fixed, write, stage, show, eye, frame.radius, size[1]);
      paint();
    };
    const play = player(drawing, paint);
    drawing.film = () => {
      const [parts, phase] = [[layers.shape, layers.arrows], play.phase];
      const outlines = d3.range(FRAMES + 1).map((k) => {
        play.phase = Math.cos((2 * Math.PI * k) / FRAMES);
        paint();
        return parts.map((part) => part.getAttribute("d"));
      });
      play.phase = phase;
      paint();
      return parts.map((part, i) => [part, outlines.map((one) => one[i])]).filter(([, [first]]) => first);
    };
    // Draw a view that has been moved, in full once it rests.
    const move = () => {
      moving = true;
      draw();
      clearTimeout(settling);
      settling = setTimeout(() => {
        moving = false;
        if (found.length > MANY) draw();
      }, 250);
    };
    const describe = (text) => {
      stated.textContent = text;
      drawing.setAttribute("aria-label", `Structure in three dimensions. ${text}. ${play.playing ? "Playing" : "Paused"}. ${HELP}`);
    };
    const pickMode = (key) => {
      at = key;
      modeList.value = key;
      now = picture(stage, modes.get(key), entry?.modes);
      describe(sentence(modes.get(key), entry?.name, now));
      draw();
    };
    const pick = (name) => {
      entry = shown.find((item) => item.name === name) ?? entry;
      if (entry) strategyList.value = entry.name;
      [modes, found] = [modesOf(stage, entry), foundIn(stage, entry?.exhibit)];
      modeList.replaceChildren(...d3.groups(modes, ([, mode]) => mode.group).map(([label, own]) => el("optgroup", { label }, own.map(([value, { text }]) => el("option", { value }, text)))));
      if (modes.size) return pickMode(modes.has(at) ? at : modes.keys().next().value);
      now = { shape: null, arrows: null };
      describe("No modes are stored");
      draw();
    };
    const step = (by) => () => {
      const keys = [...modes.keys()];
      if (keys.length) pickMode(keys[(keys.indexOf(at) + by + keys.length) % keys.length]);
    };
    const turn = (azimuth, elevation) => () => {
      view.turn = [view.turn[0] + azimuth, Math.min(Math.max(view.turn[1] + elevation, -90), 90)];
      move();
    };
    // A page that scrolls past must not get stuck here: the wheel zooms once the view is in use.
    const zoomer = d3.zoom().scaleExtent([0.3, 12])
      .filter((event) => (event.type === "wheel" ? document.activeElement === drawing || event.ctrlKey : (event.touches?.length ?? 0) > 1))
      .on("zoom", ({ transform }) => {
        view.zoom = transform.k;
        move();
      });
    const dragger = d3.drag().filter((event) => !event.button && (event.touches?.length ?? 1) < 2).on("drag", ({ dx, dy }) => turn(-0.4 * dx, 0.4 * dy)());
    const picked = d3.select(drawing).call(zoomer).on("dblclick.zoom", null).call(dragger).style("touch-action", null);
    const zoom = (factor) => () => zoomer.scaleBy(picked, factor);
    const toggle = () => {
      play.playing = !play.playing;
      playButton.textContent = play.playing ? "Pause" : "Play";
      describe(stated.textContent);
      play.go();
      draw();
    };
    const reset = () => {
      [view.turn, play.angle, play.phase] = [start, 0, 1];
      zoomer.transform(picked, d3.zoomIdentity);
    };
    const modeList = bench.select("Mode", [], null, pickMode);
    const strategyList = bench.select("Strategy", shown.map(({ name }) => [name, name]), null, pick);
    strategyList.disabled = shown.length === 0;
    const playButton = bench.button("Play", toggle, { class: "button case-play" });
    const slider = el("input", { type: "range", min: "0", max: "3", step: "0.1", value: "1", oninput: () => {
      amplitude = Number(slider.value);
      paint();
    } });
    const acts = [["Previous mode (P)", "‹", "p", step(-1)], ["Next mode (N)", "›", "n", step(1)],
      ["Turn left", "←", "ArrowLeft", turn(6, 0)], ["Turn right", "→", "ArrowRight", turn(-6, 0)], ["Tilt up", "↑", "ArrowUp", turn(0, 6)], ["Tilt down", "↓", "ArrowDown", turn(0, -6)],
      ["Zoom in (+)", "+", "+", zoom(1.15)], ["Zoom out (-)", "−", "-", zoom(1 / 1.15)], ["Reset the view (R)", "Reset", "r", reset]];
    const keys = { " ": toggle, "=": zoom(1.15), ...Object.fromEntries(acts.map(([, , key, act]) => [key, act])) };
    const [before, after, ...views] = acts.map(([label, sign, , act]) => bench.button(sign, act, { "aria-label": label, title: label }));
    drawing.addEventListener("keydown", (event) => {
      const act = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
      if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      act();
    });
    const flip = (name) => bench.tick(`${name[0].toUpperCase()}${name.slice(1)}`, show[name], (on) => {
      show[name] = on;
      draw();
    });
    root.append(el("div", { class: "case-structure" },
      el("div", { class: "controls" }, el("label", {}, "Strategy ", strategyList), el("label", {}, "Mode ", modeList),
        el("span", { class: "controls" }, before, playButton, after), el("label", {}, "Amplitude ", slider)),
      drawing, stated,
      el("div", { class: "controls" }, el("span", { class: "controls", role: "group", "aria-label": "View" }, views), Object.keys(show).map(flip)),
      legend(), el("p", { class: "soft" }, HELP)));
    pick(shown[0]?.name);
    new ResizeObserver(() => {
      if (!drawing.clientWidth) return;
      size = [drawing.clientWidth, drawing.clientHeight];
      view.fit = fitted(start, frame, stage, REACH * frame.radius, ...size);
      draw();
    }).observe(drawing);
    if (shown.length && !matchMedia("(prefers-reduced-motion: reduce)").matches) toggle();
    return { pick };
  };
}
