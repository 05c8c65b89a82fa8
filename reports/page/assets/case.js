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

  const note = (...text) => el("p", {}, text);
  const section = (title, ...content) => el("section", { class: "case-section" }, el("h2", {}, title), content);
  const columns = (...nodes) => el("div", { class: "columns" }, nodes);

  /** Return what the run holds of every strategy on a case (first seed), the best first. */
  const entriesOf = (c) => {
    const entries = data.results.filter((result) => result.c === c && result.seed === seed).map((result) => {
      const detail = data.details[`${c}:${result.s}`] ?? null;
      return { name: data.strategies[result.s].name, result, detail, ok: result.status === "ok" && detail !== null, exhibit: detail?.exhibit ?? null };
    });
    return d3.sort(entries, ({ ok }) => !ok, ({ result }) => -(result.gain ?? -Infinity));
  };

  const factsOf = ({ name, scenario, stage, reference }) => {
    const count = (block) => stage.measured.filter((mode) => mode.block === block).length;
    const errors = Object.entries(reference).map(([block, rms]) => `${block} ${bench.number(rms)} %`).join(", ");
    const draws = `seed ${seed} is shown, one of ${bench.plural(data.seeds.length, "draw")}; the strategies were given the measured modes with noise`;
    const facts = [["Case", name], ["Scenario", scenario !== name && scenario]];
    if (stage) {
      const mesh = stage.thinned ? `${stage.thinned[0]} nodes, ${stage.thinned[1]} elements; drawings are thinned out to ${stage.nodes.length} nodes`
        : `${stage.nodes.length} nodes, ${stage.elements.length} elements, ${stage.members.length} members`;
      const after = count("modified") ? `, ${count("modified")} after a design change` : "";
      facts.push(["Model", PLANES[stage.plane] ?? stage.plane], ["Mesh", mesh],
        ["Measured", `${count("used")} modes used, ${count("higher")} higher ones held out${after}; ${stage.sensors.length} sensors`]);
    }
    facts.push(["Noise", (data.seeds.length > 1 || data.seeds[0] > 0) && draws], ["Nominal model", errors && `rms frequency error ${errors}`]);
    return el("dl", { class: "facts case-facts" }, facts.filter(([, text]) => text).map(([title, text]) => [el("dt", {}, title), el("dd", {}, text)]));
  };

  const reasonOf = ({ name, result: { status, reason } }) => status === "ok" ? `${name}: details were left out to keep the page small`
    : `${name} ${bench.statusWord(status)}: ${reason || "no reason given"}`;
  /** Return why there is nothing to show of a strategy, or null where there is. */
  const lack = (entry, what) => (!entry.ok ? note(reasonOf(entry)) : what ? null : note(`${entry.name}: pictures of this strategy are not stored with this run.`));
  const twoOf = ({ a, b }) => [...new Set([a, b])];
  // The nominal model: the strategy that leaves it as it is or, where that did not run, the case's own.
  const nominalOf = (stage, entries) => entries.find((entry) => entry.name === data.baseline && entry.exhibit)
    ?? (stage?.nominal ? { name: "nominal model", exhibit: stage.nominal, nominal: true } : null);
  // A strategy looks alike in every chart.
  const lookOf = (entry, state) => (entry.nominal || entry.name === data.baseline ? { role: "nominal" } : { style: entry === state.a ? 0 : 1 });

  const frequencies = (item, entries, state) => {
    const [box, options] = [el("div"), { errors: false, mac: false, few: false }];
    const [fine, failed] = [entries.filter(({ ok }) => ok), entries.filter(({ ok }) => !ok)];
    const others = [[data.as_drawn[item.name] ?? {}, "from drawn"], [data.papers[item.name] ?? {}, "as printed"]];
    const fill = () => {
      const shown = fine.filter((entry) => !options.few || twoOf(state).includes(entry) || entry.name === data.baseline)
        .map((entry) => ({ ...entry, mark: [entry === state.a && "A", entry === state.b && "B", entry.result.unphysical && "unphysical"].filter(Boolean).join(", ") }));
      box.replaceChildren(...(shown.length ? bench.frequencies(shown, others, options) : [note("No strategy gave a model.")]));
    };
    const flip = (label, name) => bench.tick(label, false, (on) => {
      options[name] = on;
      fill();
    });
    fill();
    return [section("Natural frequencies", el("div", { class: "controls" }, flip("Errors in %", "errors"), flip("MAC", "mac"), flip("A and B alone", "few")), box,
      failed.length > 0 && el("details", { open: failed.length <= 3 }, el("summary", {}, `${bench.plural(failed.length, "strategy", "strategies")} not in the table`), el("ul", {}, failed.map((entry) => el("li", {}, reasonOf(entry)))))), fill];
  };

  const receptances = (stage, entries, state) => {
    const given = stage?.receptance;
    if (!given) return note(NO_PICTURES);
    const of = (entry, key) => entry.exhibit?.receptance?.[key];
    const shown = [...new Set([...twoOf(state), nominalOf(stage, entries)])].filter(Boolean);
    const keys = Object.keys(given.measured);
    const [low, high] = d3.extent(keys.flatMap((key) => [given.measured[key], ...shown.map((entry) => of(entry, key) ?? [])]).flat());
    const y = { label: "Receptance", unit: "dB re 1 m/N", low: Math.floor(low / 10) * 10, high: Math.ceil(high / 10) * 10 };
    const charts = keys.map((key) => {
      const curves = shown.filter((entry) => of(entry, key)).map((entry) => ({ name: entry.name, x: given.hz, y: of(entry, key), ...lookOf(entry, state) }));
      return bench.draw({ kind: "line", title: key ? `After the design change “${key}”` : keys.length > 1 ? "Before the design change" : "Structure as tested",
        x: { label: "Frequency", unit: "Hz" }, y, series: [{ name: "measured", x: given.hz, y: given.measured[key], role: "measured" }, ...curves] });
    });
    const text = given.note || "The measured curve is synthesised from the measured modes, scaled to mass by the paired modes of the nominal model.";
    return [note(`At the drive sensor ${stage.drive}, with a damping ratio of ${bench.number(given.damping, 2)} in every mode. ${text}`), charts, twoOf(state).map((entry) => lack(entry, entry.exhibit))];
  };

  /** Return a picture of a matrix on a logarithmic scale (bytes in base64, 0 for none), its largest entries as text. */
  const matrix = ({ size, lowest, highest, unit, labels, values: packed }, title) => {
    const bytes = Uint8Array.from(atob(packed), (sign) => sign.charCodeAt(0));
    const value = (byte) => (byte ? 10 ** (lowest + (byte / 255) * (highest - lowest)) : null);
    const values = d3.range(size).map((i) => Array.from(bytes.subarray(i * size, (i + 1) * size), value));
    const axis = { label: "node", names: labels.map(String) };
    const upper = d3.cross(d3.range(size), d3.range(size)).filter(([i, j]) => j >= i && values[i][j]);
    const figure = bench.draw({ kind: "cells", title, x: axis, y: axis, values, value: { label: "size", unit, log: true, low: 10 ** lowest, high: 10 ** Math.max(highest, lowest + 0.1) } });
    figure.append(el("p", { class: "soft" }, "Largest entries"), el("ol", { class: "case-list" },
      d3.sort(upper, ([i, j]) => -values[i][j]).slice(0, 5).map(([i, j]) => el("li", {}, `${labels[i]} – ${labels[j]}: ${bench.number(values[i][j], 2)} ${unit}`))));
    return figure;
  };

  const changes = (stage, state) => {
    if (!stage) return note(NO_PICTURES);
    const drawn = twoOf(state).filter(({ exhibit }) => (exhibit?.findings ?? []).some(({ kind }) => kind !== "elsewhere") || exhibit?.elements?.some((value) => value));
    const figures = bench.findings(stage, drawn);
    return columns(twoOf(state).map((entry) => {
      const { name, exhibit } = entry;
      if (!exhibit) return lack(entry, null);
      if (drawn.includes(entry)) return figures[drawn.indexOf(entry)];
      if (exhibit.difference) return matrix(exhibit.difference, `${name}: |K − K₀| between nodes, logarithmic`);
      if (exhibit.findings?.length) return note(`${name}: ${exhibit.findings.map(({ label }) => label).join("; ")}; these have no place on the drawing.`);
      if (exhibit.elements?.every((value) => value === 0)) return note(`${name}: no element was changed.`);
      return note(stage.thinned ? `${name}: the model has too many elements to show the change of each.` : `${name}: the change cannot be stated element by element.`);
    }));
  };

  const histories = (state) => {
    const stated = twoOf(state).filter(({ ok, detail }) => ok && detail.history.length > 1)
      .map((entry) => ({ ...entry, look: lookOf(entry, state), steps: entry.detail.history, first: entry.detail.history[0], named: new Set(entry.detail.parameters.map(({ name }) => name)) }));
    if (!stated.length) return note("No iterations were recorded.");
    const chart = (title, y, series) => bench.draw({ kind: "line", title, x: { label: "Iteration", unit: "1" }, y, series });
    const curve = ({ steps }, name, of, look) => ({ name, x: steps.map((row, i) => row.iteration ?? i), y: steps.map(of), ...look });
    const keys = d3.union(...stated.map(({ first, named }) => Object.keys(first).filter((key) => key !== "iteration" && !named.has(key))));
    const plain = [...keys].slice(0, HISTORY_CHARTS).map((key) => {
      const series = stated.filter(({ first }) => key in first).map((entry) => curve(entry, entry.name, (row) => row[key] ?? null, entry.look));
      const [low, high] = d3.extent(series.flatMap(({ y }) => y).filter((value) => value > 0));
      const label = key.replace(/_/g, " ");
      return chart(`${label}: ${series.map(({ name }) => name).join(", ")}`, { label, log: high / low > 50 }, series);
    });
    const moving = stated.map((entry) => {
      const own = Object.keys(entry.first).filter((key) => entry.named.has(key) && entry.first[key]).slice(0, 8);
      return own.length > 0 && chart(`Parameters of ${entry.name}`, { label: "Value over start", unit: "1" }, own.map((key) => curve(entry, key, (row) => row[key] / entry.first[key])));
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
    // The best whose model is a possible structure, next to the baseline.
    const best = entries.find(({ ok, result }) => ok && !result.unphysical) ?? entries[0];
    const state = { a: best, b: [find(data.baseline), ...entries].find((entry) => entry && entry !== best) ?? best };
    const [table, refill] = frequencies(item, entries, state);
    const parts = [
      ["Mode shapes compared (MAC)", () => columns(twoOf(state).map((entry) => lack(entry, entry.exhibit?.mac) ?? bench.macTable(entry)))],
      ["Receptances", () => receptances(stage, entries, state)],
      ["Change of the stiffness", () => changes(stage, state)],
      ["Iterations", () => histories(state)],
      ["Parameters", () => columns(twoOf(state).map((entry) => lack(entry, true) ?? bench.parameters(entry.name, entry.detail.parameters)))],
    ].map(([title, build]) => ({ box: el("div"), title, build }));
    const place = el("div", {}, !stage?.nodes.length && note(stage ? "The case came as matrices without a geometry." : NO_PICTURES));
    const nominal = nominalOf(stage, entries);
    const models = entries.filter(({ ok }) => ok).map(({ name, exhibit, detail }) => ({ name, exhibit, modes: detail.modes }));
    const view = stage?.nodes.length ? bench.structure(place, stage, nominal?.nominal ? [...models, { ...nominal, modes: [] }] : models) : null;
    const fill = () => {
      refill();
      for (const { box, build } of parts) box.replaceChildren(...[build()].flat(Infinity).filter(Boolean));
    };
    const labels = entries.map(({ name, ok, result }) => [name, `${name} (${ok ? `gain ${bench.share(result.gain)}${result.unphysical ? ", unphysical" : ""}` : bench.statusWord(result.status)})`]);
    const picker = (side) => el("label", {}, `${side.toUpperCase()} `, bench.select(`Strategy ${side.toUpperCase()}`, labels, state[side].name, (name) => {
      state[side] = find(name);
      fill();
      if (side === "a") view?.pick(name);
    }));
    root.append(el("div", { class: "case-pickers controls", role: "group", "aria-label": "Strategies to compare" }, picker("a"), picker("b")),
      table, section("Structure and mode shapes", place), ...parts.map(({ title, box }) => section(title, box)));
    fill();
    view?.pick(state.a.name);
    return root;
  };
}
