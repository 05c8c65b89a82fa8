/* The case page: everything that a run knows of one case, two strategies side by side. */
{
  const NO_PICTURES = "Pictures are not stored with this run.";
  const PLANES = {
    "out-of-plane": "frame in the x-y plane, moving out of plane (z, rx, ry)",
    "in-plane": "frame in the x-z plane, moving in plane (x, z, ry)",
    "3d": "frame in three dimensions",
    matrices: "mass and stiffness matrices",
  };
  const HISTORY_CHARTS = 4;

  /** Return the lowest seed that there is a result of, the one that the details are of. */
  const firstSeed = () => bench.data.results.reduce((least, { seed }) => Math.min(least, seed), Infinity);

  /** Return what the run holds of every strategy on a case (first seed), the best first. */
  const entriesOf = (c) => {
    const { data } = bench;
    const seed = firstSeed();
    return data.results.filter((result) => result.c === c && result.seed === seed).map((result) => {
      const detail = data.details[`${c}:${result.s}`] ?? null;
      return { name: data.strategies[result.s].name, s: result.s, result, detail, ok: result.status === "ok" && detail !== null,
        exhibit: detail ? (detail.exhibit ?? null) : null };
    }).sort((a, b) => (a.ok ? 0 : 1) - (b.ok ? 0 : 1) || (a.result.score ?? Infinity) - (b.result.score ?? Infinity));
  };

  const factsOf = (item) => {
    const { stage } = item;
    const facts = [["Case", item.name]];
    if (item.scenario !== item.name) facts.push(["Scenario", item.scenario]);
    const source = item.source ?? (item.tables ?? {}).source;
    if (source) facts.push(["Source", source]);
    if (stage) {
      facts.push(["Model", PLANES[stage.plane] ?? stage.plane]);
      facts.push(["Mesh", stage.thinned ? `${stage.thinned[0]} nodes, ${stage.thinned[1]} elements; drawings are thinned out to ${stage.nodes.length} nodes`
        : `${stage.nodes.length} nodes, ${stage.elements.length} elements, ${stage.members.length} members`]);
      const count = (block) => stage.measured.filter((mode) => mode.block === block).length;
      const changed = count("modified") ? `, ${count("modified")} after a design change` : "";
      facts.push(["Measured", `${count("used")} modes used, ${count("higher")} higher ones held out${changed}; ${stage.sensors.length} sensors`]);
    }
    const { seeds } = bench.data;
    if (seeds.length > 1 || seeds[0] > 0) facts.push(["Noise", `seed ${firstSeed()} is shown, one of ${bench.plural(seeds.length, "draw")}; the strategies were given the measured modes with noise`]);
    const reference = Object.entries(item.reference ?? {}).map(([block, rms]) => `${block} ${bench.number(rms, 3)} %`);
    if (reference.length) facts.push(["Nominal model", `rms frequency error ${reference.join(", ")}`]);
    return bench.el("dl", { class: "case-facts" }, facts.map(([name, text]) => [bench.el("dt", {}, name), bench.el("dd", {}, String(text))]));
  };

  const picker = (label, entries, chosen, change) => {
    const options = entries.map((entry) => {
      const end = entry.ok ? `error left ${bench.number(entry.result.score, 3)}${entry.result.unphysical ? ", unphysical" : ""}` : bench.statusWord(entry.result.status);
      const option = bench.el("option", { value: entry.name }, `${entry.name} (${end})`);
      option.selected = entry.name === chosen;
      return option;
    });
    const select = bench.el("select", { "aria-label": `Strategy ${label}`, onchange: () => change(select.value) }, options);
    return bench.el("label", { class: "case-field" }, `${label} `, select);
  };

  const tick = (label, on, change) => {
    const box = bench.el("input", { type: "checkbox", onchange: () => change(box.checked) });
    box.checked = on;
    return bench.el("label", { class: "case-check" }, box, ` ${label}`);
  };

  const section = (title, ...content) => bench.el("section", { class: "case-section" }, bench.el("h2", {}, title), content);
  const note = (text) => bench.el("p", { class: "case-note" }, text);
  const beside = (...nodes) => bench.el("div", { class: "case-beside" }, nodes);

  const reasonOf = ({ name, result }) => result.status === "ok" ? `${name}: details were left out to keep the page small`
    : `${name} ${bench.statusWord(result.status)}: ${result.reason || "no reason given"}`;

  /** Return why there is nothing to show of a strategy, or null where there is. */
  const lack = (entry, what) => {
    if (!entry.ok) return note(reasonOf(entry));
    return what ? null : note(`${entry.name}: pictures of this strategy are not stored with this run.`);
  };

  const twoOf = (state) => (state.a === state.b ? [state.a] : [state.a, state.b]);

  const markOf = (entry, state) => [entry === state.a && "A", entry === state.b && "B", entry.result.unphysical && "unphysical"].filter(Boolean).join(", ");

  // The nominal model: the strategy that leaves it as it is or, where that did not run, the case's own.
  const nominalOf = (stage, entries) => entries.find((entry) => entry.name === bench.data.baseline && entry.exhibit)
    ?? (stage && stage.nominal ? { name: "nominal model", exhibit: stage.nominal, nominal: true } : null);

  // A strategy looks alike in every chart.
  const lookOf = (entry, state) => (entry.nominal || entry.name === bench.data.baseline ? { role: "nominal" } : { role: "predicted", style: entry === state.a ? 0 : 1 });

  const failures = (entries) => {
    const failed = entries.filter((entry) => !entry.ok);
    if (!failed.length) return null;
    const { el } = bench;
    const items = failed.map((entry) => el("li", {}, reasonOf(entry)));
    return el("details", { class: "case-failures", open: failed.length <= 3 }, el("summary", {}, `${bench.plural(failed.length, "strategy", "strategies")} not in the table`), el("ul", {}, items));
  };

  const frequencySection = (item, entries, state) => {
    const { el, data } = bench;
    const papers = (data.papers ?? {})[item.name] ?? {};
    const drawn = (data.as_drawn ?? {})[item.name] ?? {};
    const box = el("div", {});
    const options = { errors: false, mac: false, all: true };
    const fill = () => {
      const wanted = options.all ? entries : twoOf(state);
      const columns = wanted.filter((entry) => entry.ok).map((entry) => ({ ...entry, mark: markOf(entry, state) }));
      box.replaceChildren(columns.length ? bench.caseTables.frequencies(columns, [[drawn, "from drawn"], [papers, "as printed"]], options) : note("No strategy gave a model."));
    };
    const flip = (name, turn = (on) => on) => (on) => {
      options[name] = turn(on);
      fill();
    };
    const controls = el("div", { class: "case-controls" }, tick("Errors in %", false, flip("errors")), tick("MAC", false, flip("mac")),
      tick("A and B alone", false, flip("all", (on) => !on)));
    fill();
    return [section("Natural frequencies", controls, box, failures(entries)), fill];
  };

  const macTable = (entry) => {
    const missing = lack(entry, entry.exhibit && entry.exhibit.mac);
    if (missing) return missing;
    const { mac, modes } = entry.exhibit;
    const tested = modes.filter((mode) => !mode.modification);
    const pairs = mac.rows.map((row) => {
      const partner = tested.find((mode) => mode.paired === row);
      const near = partner ? mac.columns.map((hz) => Math.abs(hz - partner.hz)) : [];
      return partner ? near.indexOf(Math.min(...near)) : null;
    });
    return bench.heat.table({ caption: `${entry.name}: MAC of measured and predicted mode shapes; framed: the pairs`, rowTitle: "Mode", columnTitle: "Hz",
      rows: mac.rows.map(String), columns: mac.columns.map(bench.hertz), values: mac.values, pairs });
  };

  const receptanceCharts = (stage, entries, state) => {
    const data = stage && stage.receptance;
    if (!data) return note(NO_PICTURES);
    const nominal = nominalOf(stage, entries);
    const shown = twoOf(state);
    if (nominal && !shown.includes(nominal)) shown.push(nominal);
    const keys = Object.keys(data.measured);
    const all = keys.flatMap((key) => [data.measured[key], ...shown.map((entry) => entry.exhibit && (entry.exhibit.receptance ?? {})[key])]).flat().filter((value) => Number.isFinite(value));
    const yRange = [Math.floor(Math.min(...all) / 10) * 10, Math.ceil(Math.max(...all) / 10) * 10];
    const charts = keys.map((key) => {
      const series = [{ label: "measured", x: data.hz, y: data.measured[key], role: "measured" }];
      for (const entry of shown) {
        const y = entry.exhibit && (entry.exhibit.receptance ?? {})[key];
        if (y) series.push({ label: entry.name, x: data.hz, y, ...lookOf(entry, state) });
      }
      return bench.charts.line({ title: key ? `After the design change \u201c${key}\u201d` : keys.length > 1 ? "Before the design change" : "Structure as tested",
        xLabel: "Frequency, Hz", yLabel: "Receptance, dB re 1 m/N", series, height: 320, yRange });
    });
    const where = `At the drive sensor ${stage.drive}, with a damping ratio of ${bench.number(data.damping, 2)} in every mode. `;
    const text = data.note || "The measured curve is synthesised from the measured modes, scaled to mass by the paired modes of the nominal model.";
    return [note(where + text), charts, twoOf(state).map((entry) => lack(entry, entry.exhibit))];
  };

  const changes = (stage, state) => {
    if (!stage) return note(NO_PICTURES);
    const two = twoOf(state);
    const values = two.flatMap((entry) => (entry.exhibit && entry.exhibit.elements) || []).filter((value) => value !== null);
    const top = Math.max(...values, 0);
    return beside(two.map((entry) => {
      const missing = lack(entry, entry.exhibit);
      if (missing) return missing;
      const { elements, difference } = entry.exhibit;
      if (difference) return bench.heat.image({ ...difference, axis: "node", title: `${entry.name}: |K \u2212 K\u2080| between nodes, logarithmic` });
      if (stage.thinned) return note(`${entry.name}: the model has too many elements to show the change of each.`);
      if (!elements || elements.every((value) => value === null)) return note(`${entry.name}: the change of stiffness cannot be told element by element.`);
      if (elements.every((value) => !value)) return note(`${entry.name}: no element was changed.`);
      return bench.elementMap(stage, elements, top, `${entry.name}: relative change of every element's stiffness, in %`);
    }));
  };

  const historyCharts = (state) => {
    const told = twoOf(state).filter((entry) => entry.ok && entry.detail.history.length > 1);
    if (!told.length) return note("No iterations were recorded.");
    const names = (entry) => new Set(entry.detail.parameters.map((item) => item.name));
    const steps = (entry) => entry.detail.history.map((row, i) => row.iteration ?? i);
    const keys = [...new Set(told.flatMap((entry) => Object.keys(entry.detail.history[0]).filter((key) => key !== "iteration" && !names(entry).has(key))))];
    const plain = keys.slice(0, HISTORY_CHARTS).map((key) => {
      const series = told.filter((entry) => key in entry.detail.history[0]).map((entry) => ({ label: entry.name, x: steps(entry), y: entry.detail.history.map((row) => row[key] ?? null), ...lookOf(entry, state) }));
      const values = series.flatMap((one) => one.y).filter((value) => value > 0);
      const logY = Math.max(...values) / Math.min(...values) > 50;
      const title = key.replace(/_/g, " ");
      return bench.charts.line({ title: `${title}: ${series.map((one) => one.label).join(", ")}`, xLabel: "Iteration", yLabel: title, series, logY, height: 240 });
    });
    const moving = told.map((entry) => {
      const own = Object.keys(entry.detail.history[0]).filter((key) => names(entry).has(key) && entry.detail.history[0][key]);
      const series = own.slice(0, 8).map((key) => ({ label: key, x: steps(entry), y: entry.detail.history.map((row) => row[key] / entry.detail.history[0][key]), role: "other" }));
      return series.length ? bench.charts.line({ title: `Parameters of ${entry.name}`, xLabel: "Iteration", yLabel: "Value over start", series, height: 240 }) : null;
    });
    return beside(plain, moving);
  };

  const parameterTables = (state) => beside(twoOf(state).map((entry) => lack(entry, true) ?? bench.caseTables.parameters(entry.name, entry.detail.parameters)));

  /** Show a case in root, or in a new element where only the index is given; returns the element. */
  bench.casePage = (given, index) => {
    const { el } = bench;
    const [root, caseIndex] = index === undefined ? [el("section", { class: "case-page" }), given] : [given, index];
    const item = bench.data.cases[caseIndex];
    const entries = entriesOf(caseIndex);
    const { stage } = item;
    root.replaceChildren(el("h1", { class: "case-title", tabindex: "-1" }, item.title || item.name), factsOf(item));
    if (!entries.length) {
      root.append(note("This run has no results of the case."));
      return root;
    }
    const find = (name) => entries.find((entry) => entry.name === name);
    // The best whose model is a possible structure.
    const best = entries.find((entry) => entry.ok && !entry.result.unphysical) ?? entries[0];
    const state = { a: best, b: find(bench.data.baseline) ?? entries[1] ?? entries[0] };
    if (state.b === state.a) state.b = entries.find((entry) => entry !== best) ?? best;
    const [table, refill] = frequencySection(item, entries, state);
    const parts = [
      ["Mode shapes compared (MAC)", () => beside(twoOf(state).map(macTable))],
      ["Receptances", () => receptanceCharts(stage, entries, state)],
      ["Change of the stiffness", () => changes(stage, state)],
      ["Iterations", () => historyCharts(state)],
      ["Parameters", () => parameterTables(state)],
    ].map(([title, build]) => {
      const box = el("div", {});
      return { node: section(title, box), build, box };
    });
    const fill = () => parts.forEach(({ build, box }) => box.replaceChildren(...[build()].flat(Infinity).filter(Boolean)));
    let view = null;
    const choose = (side) => (name) => {
      state[side] = find(name);
      refill();
      fill();
      if (view && side === "a") view.pick(name);
    };
    root.append(el("div", { class: "case-pickers", role: "group", "aria-label": "Strategies to compare" },
      picker("A", entries, state.a.name, choose("a")), picker("B", entries, state.b.name, choose("b"))), table);
    const place = el("div", {});
    root.append(section("Structure and mode shapes", place));
    if (stage && stage.nodes && stage.nodes.length) {
      const models = entries.filter((entry) => entry.ok).map((entry) => ({ name: entry.name, exhibit: entry.exhibit, modes: entry.detail.modes }));
      const nominal = nominalOf(stage, entries);
      if (nominal && nominal.nominal) models.push({ ...nominal, modes: [] });
      view = bench.structure(place, stage, models);
      view.pick(state.a.name);
    } else place.append(note(stage ? "The case came as matrices without a geometry." : NO_PICTURES));
    root.append(...parts.map(({ node }) => node));
    fill();
    return root;
  };
}
