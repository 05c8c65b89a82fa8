// How every library of benchmarks/drawing_libraries.py draws the same three things into a box: a matrix, a
// chart of curves, and a structure that moves. `structure` returns what draws its next frame. No drawing
// moves by itself, and one title is given where the library has an option for it.
const WIDTH = 900, HEIGHT = 500, TITLE = "Frequency error";
const VALUES = rowsOf(40, (i) => rowsOf(60, (j) => Math.sin(i / 5) * Math.cos(j / 7)));
const CURVES = rowsOf(10, (k) => rowsOf(100, (i) => Math.sin(i / 12 + k) / (k + 1)));
const NODES = rowsOf(1000, (i) => [Math.cos(i / 40), Math.sin(i / 40), i / 500 - 1]);

function rowsOf(count, of) {
  return Array.from({ length: count }, (_, k) => of(k));
}

// Where the nodes are at a moment, and where a parallel projection shows them.
const moved = (t) => NODES.map(([x, y, z], i) => [x + 0.1 * Math.sin(t) * Math.sin(i / 90), y, z + 0.1 * Math.sin(t) * Math.cos(i / 70)]);
const shown = (t) => moved(t).map(([x, y, z]) => [0.9 * x - 0.4 * y, 0.2 * x + 0.4 * y + 0.9 * z]);

const inside = (box, tag = "div") => {
  const node = document.createElement(tag);
  Object.assign(node.style, { width: `${WIDTH}px`, height: `${HEIGHT}px` });
  box.append(node);
  return node;
};
const cells = (make) => VALUES.flatMap((row, i) => row.map((v, j) => make(i, j, v)));
const points = (make) => CURVES.flatMap((row, k) => row.map((v, i) => make(k, i, v)));
const indices = (list) => list.map((_, i) => i);

const plot = {
  matrix: (box) => box.append(Plot.plot({ width: WIDTH, height: HEIGHT, ariaLabel: TITLE, color: { scheme: "viridis" },
    marks: [Plot.cell(cells((i, j, v) => ({ i, j, v })), { x: "j", y: "i", fill: "v" })] })),
  chart: (box) => box.append(Plot.plot({ width: WIDTH, height: HEIGHT, ariaLabel: TITLE,
    marks: [Plot.lineY(points((k, i, v) => ({ k, i, v })), { x: "i", y: "v", z: "k", stroke: (p) => `series ${p.k}`, tip: true })] })),
  structure: (box) => {
    const line = d3.line((p) => WIDTH / 2 + 150 * p[0], (p) => HEIGHT / 2 - 150 * p[1]);
    const path = d3.select(box).append("svg").attr("width", WIDTH).attr("height", HEIGHT).append("path").attr("fill", "none").attr("stroke", "black");
    return (t) => path.attr("d", line(shown(t)));
  },
};

const flat = { title: { text: TITLE }, width: WIDTH, height: HEIGHT };
const plotly = (cube, heat) => ({
  matrix: heat ? (box) => Plotly.newPlot(inside(box), [{ z: VALUES, type: "heatmap", colorscale: "Viridis" }], flat) : null,
  chart: (box) => Plotly.newPlot(inside(box), CURVES.map((y) => ({ y, type: "scatter", mode: "lines" })), flat),
  structure: async (box) => {
    const axes = (rows) => Object.fromEntries(["x", "y", "z"].slice(0, cube ? 3 : 2).map((key, k) => [key, rows.map((row) => row[k])]));
    const at = (t) => axes(cube ? moved(t) : shown(t));
    const node = await Plotly.newPlot(inside(box), [{ ...at(0), type: cube ? "scatter3d" : "scatter", mode: "lines" }], flat);
    return (t) => Plotly.restyle(node, Object.fromEntries(Object.entries(at(t)).map(([key, list]) => [key, [list]])), 0);
  },
});

const vegaDrawer = (interpreted) => {
  const drawn = async (box, values, rest) => {
    const spec = { width: WIDTH - 100, height: HEIGHT - 50, description: TITLE, data: { name: "rows", values }, ...rest };
    const compiled = vegaLite.compile(spec).spec;
    const expr = interpreted ? vegaInterpreter.expressionInterpreter : undefined;
    const view = new vega.View(vega.parse(compiled, null, { ast: interpreted }), { ...(expr ? { expr } : {}), renderer: "svg", container: inside(box) });
    return view.runAsync();
  };
  const nominal = (field) => ({ field, type: "ordinal" }), metric = (field) => ({ field, type: "quantitative" });
  const wide = (field) => ({ ...metric(field), scale: { domain: [-2, 2] } });
  const rows = (t) => shown(t).map(([x, y], i) => ({ x, y, i }));
  return {
    matrix: (box) => drawn(box, cells((i, j, v) => ({ i, j, v })), { mark: "rect", encoding: { x: nominal("j"), y: nominal("i"), color: { ...metric("v"), scale: { scheme: "viridis" } } } }),
    chart: (box) => drawn(box, points((k, i, v) => ({ k, i, v })), { mark: "line", encoding: { x: metric("i"), y: metric("v"), color: nominal("k") } }),
    structure: async (box) => {
      const view = await drawn(box, rows(0), { mark: "line", encoding: { x: wide("x"), y: wide("y"), order: metric("i") } });
      return (t) => view.data("rows", rows(t)).runAsync();
    },
  };
};

const charted = (box, option) => {
  const chart = echarts.init(inside(box));
  chart.setOption({ animation: false, title: { text: TITLE }, aria: { enabled: true }, tooltip: {}, ...option });
  return chart;
};
const ECHARTS = {
  matrix: (box) => charted(box, { xAxis: { type: "category", data: indices(VALUES[0]) }, yAxis: { type: "category", data: indices(VALUES) },
    visualMap: { min: -1, max: 1 }, series: [{ type: "heatmap", data: cells((i, j, v) => [j, i, v]) }] }),
  chart: (box) => charted(box, { xAxis: { type: "value" }, yAxis: { type: "value" },
    series: CURVES.map((row) => ({ type: "line", showSymbol: false, data: row.map((v, i) => [i, v]) })) }),
  structure: (box) => {
    const axis = { type: "value", min: -2, max: 2 };
    const chart = charted(box, { xAxis: axis, yAxis: axis, series: [{ type: "line", showSymbol: false, data: shown(0) }] });
    return (t) => chart.setOption({ series: [{ data: shown(t) }] });
  },
};

const uplot = {
  matrix: null,
  chart: (box) => new uPlot({ title: TITLE, width: WIDTH, height: HEIGHT - 60, scales: { x: { time: false } },
    series: [{}, ...CURVES.map((_, k) => ({ label: `series ${k}`, stroke: `hsl(${36 * k} 80% 40%)` }))] }, [indices(CURVES[0]), ...CURVES], box),
  structure: null,
};

const three = {
  matrix: null,
  chart: null,
  structure: (box) => {
    const renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
    renderer.setSize(WIDTH, HEIGHT);
    renderer.setClearColor(0xffffff);
    box.append(renderer.domElement);
    const [scene, camera] = [new THREE.Scene(), new THREE.OrthographicCamera(-3, 3, 1.7, -1.7, -10, 10)];
    camera.position.set(1, 1, 1);
    camera.lookAt(0, 0, 0);
    const shape = new THREE.BufferGeometry().setAttribute("position", new THREE.Float32BufferAttribute(NODES.flat(), 3));
    const line = new THREE.Line(shape, new THREE.LineBasicMaterial({ color: 0 }));
    line.frustumCulled = false;
    scene.add(line);
    return (t) => {
      shape.attributes.position.array.set(moved(t).flat());
      shape.attributes.position.needsUpdate = true;
      renderer.render(scene, camera);
      renderer.getContext().finish();
    };
  },
};

window.DRAWERS = { plot, plotlyBasic: plotly(false, false), plotlyGl: plotly(true, false), plotlyStrict: plotly(true, true),
  vegaLite: vegaDrawer(false), vegaLiteInterpreted: vegaDrawer(true), echarts: ECHARTS, uplot, three };

// Two frames later everything that was asked for has been laid out and painted.
const painted = () => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done))));

// What is called from outside may evaluate text whatever the policy says; what a timer calls may not.
const alone = (work) => new Promise((done, failed) => setTimeout(() => work().then(done, failed)));

// Draw one thing; the milliseconds until it is painted.
window.draw = (library, what) => alone(async () => {
  const start = performance.now();
  window.drawn = await DRAWERS[library][what](document.getElementById("box"));
  if (what === "structure") await drawn(0.5);
  await painted();
  return performance.now() - start;
});

// Draw so many frames, one for each of the browser's; the milliseconds of all.
window.animate = (frames) => alone(async () => {
  const start = performance.now();
  for (let k = 1; k <= frames; k += 1) {
    await drawn(k / 5);
    await new Promise((done) => requestAnimationFrame(done));
  }
  return performance.now() - start;
});

window.counted = () => {
  const own = [...document.getElementById("box").querySelectorAll("*")];
  const named = (node) => node.getAttribute("aria-label") || node.getAttribute("aria-labelledby") || [...node.children].some((child) => child.tagName === "title");
  return { names: own.filter(named).length, roles: own.filter((node) => node.hasAttribute("role")).length };
};
window.focused = () => {
  const own = [...document.getElementById("box").querySelectorAll("*")];
  return own.indexOf(document.activeElement);
};
window.focusStop = (number) => {
  const own = [...document.getElementById("box").querySelectorAll("*")];
  own.filter((node) => node.tabIndex >= 0)[number]?.focus();
};
