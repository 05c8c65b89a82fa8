/* The structure as a drawing whose elements show how much their stiffness was changed. */
{
  const WIDEST = 640; // px
  const MARGIN = 46;
  const LETTER = 6.6; // px a letter takes at 12 px

  // What the drawing shows: the plane itself, or a view from above one corner.
  const AXES = {
    "out-of-plane": { flat: ([x, y]) => [x, -y], x: "x", y: "y" },
    "in-plane": { flat: ([x, , z]) => [x, -z], x: "x", y: "z" },
    "3d": { flat: ([x, y, z]) => [0.866 * (x + y), 0.5 * (x - y) - z], x: "", y: "" },
  };

  /** Return node positions in px and the height that they need. */
  const layout = (stage, width) => {
    const flat = stage.nodes.map((AXES[stage.plane] ?? AXES["3d"]).flat);
    const low = [0, 1].map((k) => Math.min(...flat.map((p) => p[k])));
    const high = [0, 1].map((k) => Math.max(...flat.map((p) => p[k])));
    const scale = Math.min((width - 2 * MARGIN) / (high[0] - low[0] || 1), 400 / (high[1] - low[1] || 1));
    const height = Math.max((high[1] - low[1]) * scale, 60) + 2 * MARGIN;
    const shift = (width - (high[0] - low[0]) * scale) / 2;
    return { height, points: flat.map((p) => [shift + (p[0] - low[0]) * scale, MARGIN + (p[1] - low[1]) * scale]) };
  };

  const percent = (value) => {
    const share = 100 * value;
    if (share > 0 && share < 0.05) return "<0.1";
    return share >= 9.95 ? share.toFixed(0) : share.toFixed(1).replace(/\.0$/, "");
  };

  // Beside the middle of the element, on either side, or a little further along.
  const SIDES = [0, 9, -9, 16, -16].flatMap((slide) => [[1, slide], [-1, slide]]);

  /** Return where numbers fit beside their elements, in the order given. */
  const placed = (items, taken) => items.flatMap((item) => {
    const half = (item.text.length * LETTER) / 2 + 1;
    const [nx, ny] = item.normal;
    const away = item.width / 2 + 6 + half * Math.abs(nx) + 6 * Math.abs(ny);
    for (const [side, slide] of SIDES) {
      const [x, y] = [item.middle[0] + side * away * nx + slide * ny, item.middle[1] + side * away * ny - slide * nx];
      const box = { l: x - half, r: x + half, t: y - 7, b: y + 7 };
      if (taken.some((o) => box.l < o.r && box.r > o.l && box.t < o.b && box.b > o.t)) continue;
      taken.push(box);
      return [{ ...item, x, y }];
    }
    return [];
  });

  /** Return where the middle of a joint's name stands free of elements and other names. */
  const beside = (name, x, y, taken, width) => {
    const half = (name.length * LETTER) / 2 + 3;
    const spots = [[0, -16], [0, 24], [half + 9, -12], [-half - 9, -12], [half + 9, 20], [-half - 9, 20]].map(([dx, dy]) => {
      const middle = Math.min(Math.max(x + dx, half), width - half);
      return { x: middle, y: y + dy, box: { l: middle - half, r: middle + half, t: y + dy - 11, b: y + dy + 3 } };
    });
    const free = ({ box }) => !taken.some((o) => box.l < o.r && box.r > o.l && box.t < o.b && box.b > o.t);
    const spot = spots.find(free) ?? spots[0];
    taken.push(spot.box);
    return { x: spot.x, y: spot.y };
  };

  const bar = (top) => {
    const { svg } = bench;
    const marks = [0, 0.25, 0.5, 0.75, 1];
    const nodes = marks.map((share, k) => {
      const x = 20 + k * 78;
      return [
        svg("line", { x1: x, x2: x + 40, y1: 14, y2: 14, class: "case-edge", "stroke-width": 4.5 + 9 * share }),
        svg("line", { x1: x, x2: x + 40, y1: 14, y2: 14, class: "case-stroke", style: bench.heat.shade(share), "stroke-width": 3 + 9 * share }),
        svg("text", { x: x + 20, y: 37, class: "case-mid" }, `${percent(share * top)} %`),
      ];
    });
    return svg("svg", { viewBox: "0 0 400 42", class: "case-scale", role: "img", "aria-label": `Scale from 0 to ${percent(top)} percent` }, nodes);
  };

  /** Return the largest changes as a sentence. */
  const told = (stage, changes) => {
    const order = changes.map((value, i) => [value, i]).filter(([value]) => value !== null).sort((a, b) => b[0] - a[0]);
    if (!order.length) return "The change cannot be told element by element.";
    const best = order.slice(0, 5).map(([value, i]) => `${stage.element_labels[i] || "joint arm"} ${percent(value)} %`);
    return order[0][0] === 0 ? "No element was changed." : `Largest changes: ${best.join(", ")}.`;
  };

  /**
   * Return the drawing as a figure.
   *
   * stage: of the case. changes: one an element, null where it cannot be told. top: end of the scale.
   */
  bench.elementMap = (stage, changes, top, title) => {
    const { svg, el } = bench;
    const width = Math.min(WIDEST, Math.max(document.documentElement.clientWidth - 40, 280));
    const { points, height } = layout(stage, width);
    const drawn = stage.elements.map(([i, j], k) => {
      const [a, b] = [points[i], points[j]];
      const length = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1;
      const value = changes[k] ?? null;
      const share = value === null ? 0 : Math.min(value / (top || 1), 1);
      return { a, b, k, value, share, width: 3 + 9 * share, text: value === null ? "?" : percent(value),
        middle: [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2], normal: [-(b[1] - a[1]) / length, (b[0] - a[0]) / length] };
    });
    const line = (item, attrs) => svg("line", { x1: item.a[0], y1: item.a[1], x2: item.b[0], y2: item.b[1], ...attrs });
    const edges = drawn.map((item) => line(item, { class: "case-edge", "stroke-width": item.width + 1.6 }));
    const fills = drawn.map((item) => item.value === null
      ? line(item, { class: "case-unknown", "stroke-width": 3, "stroke-dasharray": "4 3" })
      : line(item, { class: "case-stroke", style: bench.heat.shade(item.share), "stroke-width": item.width }));
    const nodes = points.map(([x, y]) => svg("circle", { cx: x, cy: y, r: 1.8, class: "case-node" }));
    const taken = drawn.flatMap(({ a, b }) => [0.1, 0.3, 0.5, 0.7, 0.9].map((s) => {
      const [x, y] = [a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1])];
      return { l: x - 5, r: x + 5, t: y - 5, b: y + 5 };
    }));
    const order = drawn.filter((item) => item.value !== null).sort((p, q) => q.value - p.value);
    const large = order.filter((item) => item.share > 0.4);
    const first = placed(large, taken);
    const joints = stage.joints.map((joint) => {
      const [x, y] = points[joint.node];
      return [svg("circle", { cx: x, cy: y, r: 4, class: "case-joint" }), svg("text", { ...beside(joint.name, x, y, taken, width), class: "case-mid case-strong" }, joint.name)];
    });
    const numbers = [...first, ...placed(order.slice(large.length), taken)].map((item) => svg("text", { x: item.x, y: item.y + 4, class: "case-mid" }, item.text));
    const summary = told(stage, changes);
    const picture = svg("svg", { viewBox: `0 0 ${width} ${height}`, width, height, class: "case-map", role: "img", "aria-label": `${title}. ${summary}` },
      edges, fills, nodes, joints, numbers);
    const rows = () => order.map((item) => el("tr", {}, el("th", { scope: "row" }, stage.element_labels[item.k] || "joint arm"), el("td", { class: "num" }, (100 * item.value).toFixed(2))));
    const all = el("details", { ontoggle: () => {
      if (all.children.length < 2) all.append(bench.scroll(`Every element: ${title}`, el("table", { class: "case-table" },
        el("thead", {}, el("tr", {}, el("th", { scope: "col" }, "Element"), el("th", { scope: "col" }, "Change of stiffness in %"))), el("tbody", {}, rows()))));
    } }, el("summary", {}, "Every element as a table"));
    return el("figure", { class: "case-figure" }, el("figcaption", {}, title), picture, bar(top), el("p", { class: "case-told" }, numbers.length < order.length ? `${summary} Numbers stand where there is room.` : summary), all);
  };
}
