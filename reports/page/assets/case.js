/* The case page: everything that a run knows of one case, two strategies side by side. */
{
  const { el, data } = bench;
  const NO_PICTURES = "Pictures are not stored with this run.";
  const PLANES = {
    "out-of-plane": "frame in the x-y plane, moving out of plane (z, rx, ry)",
    "in-plane": "frame in the x-z plane, moving in plane (x, z, ry)",
    "3d": "frame in three dimensions",
    matrices: "mass and stiffness matrices",
  };
  const HISTORY_CHARTS = 4;
  // The details are of the lowest seed that there is a result of.
  const seed = d3.min(data.results, (result) => result.seed);

  /** Return what the run holds of every strategy on a case (first seed), the best first. */
  const entriesOf = (c) => {
    const entries = data.results.filter((result) => result.c === c && result.seed === seed).map((result) => {
      const detail = data.details[`${c}:${result.s}`] ?? null;
      return { name: data.strategies[result.s].name, result, detail, ok: result.status === "ok" && detail !== null, exhibit: detail?.exhibit ?? null };
    });
    return d3.sort(entries, (entry) => !entry.ok, (entry) => entry.result.score ?? Infinity);
  };

  const factsOf = ({ name, scenario, stage, reference }) => {
    const count = (block) => stage.measured.filter((mode) => mode.block === block).length;
    const errors = Object.entries(reference).map(([block, rms]) => `${block} ${bench.number(rms)} %`);
    const facts = [
      ["Case", name], scenario !== name && ["Scenario", scenario],
      stage && ["Model", PLANES[stage.plane] ?? stage.plane],
      stage && ["Mesh", stage.thinned ? `${stage.thinned[0]} nodes, ${stage.thinned[1]} elements; drawings are thinned out to ${stage.nodes.length} nodes`
        : `${stage.nodes.length} nodes, ${stage.elements.length} elements, ${stage.members.length} members`],
      stage && ["Measured", `${count("used")} modes used, ${count("higher")} higher ones held out${count("modified") ? `, ${count("modified")} after a design change` : ""}; ${stage.sensors.length} sensors`],
      (data.seeds.length > 1 || data.seeds[0] > 0) && ["Noise", `seed ${seed} is shown, one of ${bench.plural(data.seeds.length, "draw")}; the strategies were given the measured modes with noise`],
      errors.length && ["Nominal model", `rms frequency error ${errors.join(", ")}`],
    ].filter(Boolean);
    return el("dl", { class: "facts case-facts" }, facts.map(([title, text]) => [el("dt", {}, title), el("dd", {}, text)]));
  };

  const picker = (label, entries, chosen, change) => {
    const select = el("select", { "aria-label": `Strategy ${label}`, onchange: () => change(select.value) }, entries.map(({ name, ok, result }) =>
      el("option", { value: name, selected: name === chosen }, `${name} (${ok ? `error left ${bench.number(result.score)}${result.unphysical ? ", unphysical" : ""}` : bench.statusWord(result.status)})`)));
    return el("label", {}, `${label} `, select);
  };
  const tick = (label, change) => {
    const box = el("input", { type: "checkbox", onchange: () => change(box.checked) });
    return el("label", {}, box, ` ${label}`);
  };
  const section = (title, ...content) => el("section", { class: "case-section" }, el("h2", {}, title), content);
  const note = (text) => el("p", {}, text);
  const columns = (...nodes) => el("div", { class: "columns" }, nodes);
  const reasonOf = ({ name, result }) => result.status === "ok" ? `${name}: details were left out to keep the page small`
    : `${name} ${bench.statusWord(result.status)}: ${result.reason || "no reason given"}`;

  /** Return why there is nothing to show of a strategy, or null where there is. */
  const lack = (entry, what) => (!entry.ok ? note(reasonOf(entry)) : what ? null : note(`${entry.name}: pictures of this strategy are not stored with this run.`));
  const twoOf = (state) => [...new Set([state.a, state.b])];
  // The nominal model: the strategy that leaves it as it is or, where that did not run, the case's own.
  const nominalOf = (stage, entries) => entries.find((entry) => entry.name === data.baseline && entry.exhibit)
    ?? (stage?.nominal ? { name: "nominal model", exhibit: stage.nominal, nominal: true } : null);
  // A strategy looks alike in every chart.
  const lookOf = (entry, state) => (entry.nominal || entry.name === data.baseline ? { role: "nominal" } : { role: "predicted", style: entry === state.a ? 0 : 1 });

  const frequencies = (item, entries, state) => {
    const [box, options] = [el("div", {}), { errors: false, mac: false, few: false }];
    const fill = () => {
      const shown = entries.filter((entry) => entry.ok && (!options.few || entry === state.a || entry === state.b || entry.name === data.baseline))
        .map((entry) => ({ ...entry, mark: [entry === state.a && "A", entry === state.b && "B", entry.result.unphysical && "unphysical"].filter(Boolean).join(", ") }));
      box.replaceChildren(...(shown.length ? bench.frequencies(shown, [[data.as_drawn[item.name] ?? {}, "from drawn"], [data.papers[item.name] ?? {}, "as printed"]], options) : [note("No strategy gave a model.")]));
    };
    const flip = (name) => (on) => {
      options[name] = on;
      fill();
    };
    const failed = entries.filter((entry) => !entry.ok);
    const failures = failed.length ? el("details", { open: failed.length <= 3 }, el("summary", {}, `${bench.plural(failed.length, "strategy", "strategies")} not in the table`), el("ul", {}, failed.map((entry) => el("li", {}, reasonOf(entry))))) : null;
    fill();
    return [section("Natural frequencies", el("div", { class: "controls" }, tick("Errors in %", flip("errors")), tick("MAC", flip("mac")), tick("A and B alone", flip("few"))), box, failures), fill];
  };

  const macTable = (entry) => {
    const missing = lack(entry, entry.exhibit?.mac);
    if (missing) return missing;
    const { mac, modes } = entry.exhibit;
    const pairs = mac.rows.map((row) => {
      const partner = modes.find((mode) => !mode.modification && mode.paired === row);
      return partner ? d3.leastIndex(mac.columns, (hz) => Math.abs(hz - partner.hz)) : null;
    });
    return bench.heat.table({ caption: `${entry.name}: MAC of measured and predicted mode shapes; framed: the pairs`, rowTitle: "Mode", columnTitle: "Hz",
      rows: mac.rows.map(String), columns: mac.columns.map(bench.hertz), values: mac.values, pairs });
  };

  const receptances = (stage, entries, state) => {
    const given = stage?.receptance;
    if (!given) return note(NO_PICTURES);
    const shown = [...new Set([...twoOf(state), nominalOf(stage, entries)])].filter(Boolean);
    const keys = Object.keys(given.measured);
    const all = keys.flatMap((key) => [given.measured[key], ...shown.map((entry) => entry.exhibit?.receptance?.[key] ?? [])]).flat().filter(Number.isFinite);
    const [low, high] = [Math.floor(d3.min(all) / 10) * 10, Math.ceil(d3.max(all) / 10) * 10];
    const charts = keys.map((key) => {
      const curves = shown.filter((entry) => entry.exhibit?.receptance?.[key]).map((entry) => ({ name: entry.name, x: given.hz, y: entry.exhibit.receptance[key], ...lookOf(entry, state) }));
      return bench.draw({ kind: "line", title: key ? `After the design change \u201c${key}\u201d` : keys.length > 1 ? "Before the design change" : "Structure as tested",
        x: { label: "Frequency", unit: "Hz" }, y: { label: "Receptance", unit: "dB re 1 m/N", low, high }, series: [{ name: "measured", x: given.hz, y: given.measured[key], role: "measured" }, ...curves], height: 320 });
    });
    const text = given.note || "The measured curve is synthesised from the measured modes, scaled to mass by the paired modes of the nominal model.";
    return [note(`At the drive sensor ${stage.drive}, with a damping ratio of ${bench.number(given.damping, 2)} in every mode. ${text}`), charts, twoOf(state).map((entry) => lack(entry, entry.exhibit))];
  };

  const changes = (stage, state) => {
    if (!stage) return note(NO_PICTURES);
    const drawn = ({ exhibit }) => (exhibit?.findings ?? []).some(({ kind }) => kind !== "elsewhere") || exhibit?.elements?.some((value) => value);
    const figures = new Map(bench.findings(stage, twoOf(state).filter(drawn)).map((figure, k) => [twoOf(state).filter(drawn)[k], figure]));
    return columns(twoOf(state).map((entry) => {
      const missing = lack(entry, entry.exhibit);
      if (missing) return missing;
      const { elements, difference, findings } = entry.exhibit;
      if (figures.has(entry)) return figures.get(entry);
      if (difference) return bench.heat.image({ ...difference, axis: "node", title: `${entry.name}: |K \u2212 K\u2080| between nodes, logarithmic` });
      if (findings?.length) return note(`${entry.name}: ${findings.map(({ label }) => label).join("; ")}; these have no place on the drawing.`);
      if (elements?.every((value) => value === 0)) return note(`${entry.name}: no element was changed.`);
      return note(stage.thinned ? `${entry.name}: the model has too many elements to show the change of each.` : `${entry.name}: the change cannot be told element by element.`);
    }));
  };

  const histories = (state) => {
    const told = twoOf(state).filter((entry) => entry.ok && entry.detail.history.length > 1);
    if (!told.length) return note("No iterations were recorded.");
    const chart = (title, y, series) => bench.draw({ kind: "line", title, x: { label: "Iteration", unit: "1" }, y: { unit: "", ...y }, series, height: 240 });
    const first = (entry) => entry.detail.history[0];
    const named = (entry) => new Set(entry.detail.parameters.map((item) => item.name));
    const steps = (entry) => entry.detail.history.map((row, i) => row.iteration ?? i);
    const keys = d3.union(...told.map((entry) => Object.keys(first(entry)).filter((key) => key !== "iteration" && !named(entry).has(key))));
    const plain = [...keys].slice(0, HISTORY_CHARTS).map((key) => {
      const series = told.filter((entry) => key in first(entry)).map((entry) => ({ name: entry.name, x: steps(entry), y: entry.detail.history.map((row) => row[key] ?? null), ...lookOf(entry, state) }));
      const [low, high] = d3.extent(series.flatMap((one) => one.y).filter((value) => value > 0));
      const title = key.replace(/_/g, " ");
      return chart(`${title}: ${series.map((one) => one.name).join(", ")}`, { label: title, log: high / low > 50 }, series);
    });
    const moving = told.map((entry) => {
      const own = Object.keys(first(entry)).filter((key) => named(entry).has(key) && first(entry)[key]).slice(0, 8);
      return own.length ? chart(`Parameters of ${entry.name}`, { label: "Value over start", unit: "1" }, own.map((key) => ({ name: key, x: steps(entry), y: entry.detail.history.map((row) => row[key] / first(entry)[key]) }))) : null;
    });
    return columns(plain, moving);
  };

  /** Return the page of a case. */
  bench.casePage = (index) => {
    const item = data.cases[index];
    const [entries, { stage }] = [entriesOf(index), item];
    const root = el("section", { class: "case" }, el("h1", { class: "case-title", tabindex: "-1" }, item.title || item.name), factsOf(item));
    if (!entries.length) {
      root.append(note("This run has no results of the case."));
      return root;
    }
    const find = (name) => entries.find((entry) => entry.name === name);
    // The best whose model is a possible structure, beside the baseline.
    const best = entries.find((entry) => entry.ok && !entry.result.unphysical) ?? entries[0];
    const state = { a: best, b: [find(data.baseline), ...entries].find((entry) => entry && entry !== best) ?? best };
    const [table, refill] = frequencies(item, entries, state);
    const parts = [
      ["Mode shapes compared (MAC)", () => columns(twoOf(state).map(macTable))],
      ["Receptances", () => receptances(stage, entries, state)],
      ["Change of the stiffness", () => changes(stage, state)],
      ["Iterations", () => histories(state)],
      ["Parameters", () => columns(twoOf(state).map((entry) => lack(entry, true) ?? bench.parameters(entry.name, entry.detail.parameters)))],
    ].map(([title, build]) => {
      const box = el("div", {});
      return { node: section(title, box), fill: () => box.replaceChildren(...[build()].flat(Infinity).filter(Boolean)) };
    });
    let view = null;
    const choose = (side) => (name) => {
      state[side] = find(name);
      refill();
      for (const { fill } of parts) fill();
      if (view && side === "a") view.pick(name);
    };
    const place = el("div", {});
    root.append(el("div", { class: "case-pickers controls", role: "group", "aria-label": "Strategies to compare" }, picker("A", entries, state.a.name, choose("a")), picker("B", entries, state.b.name, choose("b"))),
      table, section("Structure and mode shapes", place), ...parts.map(({ node }) => node));
    if (stage?.nodes.length) {
      const models = entries.filter((entry) => entry.ok).map((entry) => ({ name: entry.name, exhibit: entry.exhibit, modes: entry.detail.modes }));
      const nominal = nominalOf(stage, entries);
      if (nominal?.nominal) models.push({ ...nominal, modes: [] });
      view = bench.structure(place, stage, models);
      view.pick(state.a.name);
    } else place.append(note(stage ? "The case came as matrices without a geometry." : NO_PICTURES));
    for (const { fill } of parts) fill();
    return root;
  };
}
