// The leaderboard: a sortable table, filters that compute it anew, and the scores case by case.
{
  const { el, data, number, share, small, ranking, overview } = bench;
  const LAZY = 4000; // rows times cases from which intervals come after the table
  const state = { filter: null, text: "", key: "rank", down: false, rows: [] };
  const parts = {};
  const lines = new Map();

  const column = (key, title, hint, say, more = {}) => ({ key, title, hint, cell: (row) => value(row[key], say), ...more });
  const shown = (key) => data.board.some((row) => row[key] !== null);
  const twinsOf = (row) => data.strategies[row.index].twins;
  const COLUMNS = [
    column("rank", "Rank", null, bench.count),
    { key: "strategy", title: "Strategy", text: true, cell: nameCell },
    column("skill", "Skill", `part of the ${ranking.yardstick}'s error on ${data.scored_on} that is taken away: 1 is all of it, 0 none, less than 0 is worse; more is better`, share, { down: true }),
    { title: "95 % interval", cell: ({ skill_low: low, skill_high: high }) => el("td", { class: "right range", "data-low": low ?? "", "data-high": high ?? "" }, low === null ? "–" : `${share(low)} to ${share(high)}`) },
    shown("skill_drawn") && column("skill_drawn", "From drawn", `skill of the start from the models as drawn, against the ${ranking.yardstick}s too`, share, { down: true }),
    shown("skill_tests") && column("skill_tests", "On tests", "skill on tests alone, without computed truths", share, { down: true }),
    data.strategies.some((s) => s.twins) && { key: "twins", title: "On twins", down: true, hint: "skill on similar structures under other names, drawn when the run began; beside it, in brackets, on the cases that have such twins", by: (row) => twinsOf(row)?.skill,
      cell: (row) => value(twinsOf(row)?.skill, (v) => (twinsOf(row) ? `${share(v)} (${share(twinsOf(row).original_skill)})` : number(v))) },
    ...data.blocks.map((block, k) => column(`${block}_percent`, `${block === "used" ? "given" : block} rms, %`, `rms frequency error of the ${block === "used" ? "modes that were given; no part of the skill" : `${block} modes`}; median over the cases`, small, { block: k })),
    column("coverage90", "In 90 %", "share of unseen modes in the 90 % interval that the strategy states", share),
    column("crps_percent", "CRPS, %", "continuous ranked probability score of unseen modes in percent of the frequency, mean over the structures; the absolute error where no uncertainty is stated", small),
    { key: "flags", title: "Flags", text: true, cell: flagCell, by: (row) => row.rigid_modes_lost + row.negative_eigenvalues + (row.ok ? 0 : 1e9) },
    { key: "coverage", title: "Models", hint: "jobs that gave a model", text: true, cell: coverageCell, by: (row) => -row.ok - row.not_applicable / 1e6 },
    { key: "tier", title: "Tier", hint: "1: no difference from the best shown; 2: none from the best of the others", by: (row) => overview.tierOf.get(row.index), cell: (row) => el("td", { class: "right" }, bench.count(overview.tierOf.get(row.index))) },
    { key: "letters", title: "Group", hint: "strategies that share a letter: no difference shown", text: true, by: (row) => overview.letters(row.index), cell: (row) => el("td", { class: "letters" }, overview.letters(row.index)) },
    column("parameters", "Un\u00adknowns", "free parameters, median over the cases", bench.count),
    column("seconds", "Time, s", "wall time, median over the cases", small),
  ].filter(Boolean);

  function value(v, say, name = "") {
    return el("td", { class: `right ${name}`, "data-value": v ?? "" }, say(v ?? null));
  }
  function nameCell(row) {
    return el("th", { scope: "row", class: "name" }, el("button", { type: "button", class: "expand", title: "scores case by case", "aria-expanded": "false", "aria-controls": `cases-${row.index}`, onclick: () => toggle(row.index) }, row.strategy));
  }
  function flagCell(row) {
    const flags = [
      row.rigid_modes_lost && `${bench.plural(row.rigid_modes_lost, "rigid mode")} lost`,
      row.negative_eigenvalues && bench.plural(row.negative_eigenvalues, "negative eigenvalue"),
      row.unphysical && !row.rigid_modes_lost && !row.negative_eigenvalues && "unphysical",
      !row.unphysical && !row.ok && "no model",
      twinsOf(row)?.suspicious && "knows the cases?",
      data.strategies[row.index].unsteady && "two answers to one job",
    ].filter(Boolean).map((flag) => el("span", { class: "flag" }, el("span", { "aria-hidden": "true" }, "▲ "), flag));
    return el("td", { class: `flags ${flags.length ? "" : "soft"}`, "data-lost": row.rigid_modes_lost, "data-negative": row.negative_eigenvalues }, flags.length ? flags : "none");
  }
  function coverageCell(row) {
    const misses = d3.rollups(row.results.filter((r) => r.status !== "ok"), (own) => own.length, (r) => r.status);
    if (row.total > row.results.length) misses.push(["missing", row.total - row.results.length]);
    const told = misses.map(([status, n]) => el("div", { class: status === "not-applicable" ? "soft" : "bad" }, `${n} ${bench.statusWord(status)}`));
    return el("td", { class: "coverage", "data-ok": row.ok, "data-total": row.total }, `${row.ok} of ${row.total}`, told);
  }

  function detail(row) {
    const heads = ["Case", "Error left", ...data.blocks.map((b) => `${b} rms, %`), "MAC", "Unknowns", "Time, s", "Outcome"];
    const body = row.cases.map((c, place) => {
      const own = row.results.filter((r) => r.c === c);
      const fine = own.filter((r) => r.status === "ok");
      const mid = (pick) => bench.median(fine.map(pick).filter((v) => v !== null));
      const seeds = row.logs.length;
      const said = [
        fine.length && (seeds > 1 ? `${fine.length} of ${seeds} seeds ok` : "✓ ok"),
        own.some((r) => r.unphysical) && "▲ unphysical",
        ...new Set(own.filter((r) => r.status !== "ok").map((r) => `${bench.statusText(r.status)}${r.reason ? `: ${r.reason}` : ""}`)),
        own.length < seeds && `${bench.statusText("missing")}${seeds > 1 ? ` for ${bench.plural(seeds - own.length, "seed")}` : ""}`,
      ];
      return el("tr", {}, el("th", { scope: "row" }, el("a", { href: bench.caseHref(data.cases[c].name) }, data.cases[c].name)),
        value(bench.errorLeft(row, place), number), data.blocks.map((_, k) => value(mid((r) => r.rms[k]), small)),
        value(mid((r) => bench.median(r.mac.filter((v) => v !== null))), number), value(mid((r) => r.parameters), bench.count), value(mid((r) => r.seconds), small),
        el("td", { class: "said" }, said.filter(Boolean).join("; ")));
    });
    const { citation, version } = data.strategies[row.index];
    return [
      citation ? el("p", { class: "soft" }, citation, version ? ` (version ${version})` : "") : null,
      el("table", {}, el("caption", { class: "hidden" }, `${row.strategy}, case by case; medians over the seeds`),
        el("thead", {}, el("tr", {}, heads.map((h, k) => el("th", { scope: "col", class: k && k < heads.length - 1 ? "right" : "" }, h)))), el("tbody", {}, body)),
    ];
  }
  function toggle(index) {
    const line = lines.get(index);
    const button = line.tr.querySelector(".expand");
    const open = button.getAttribute("aria-expanded") !== "true";
    button.setAttribute("aria-expanded", String(open));
    if (open && !line.more) {
      line.more = el("tr", { class: "more", id: `cases-${index}` }, el("td", { colspan: COLUMNS.length }, el("div", { class: "inner" }, detail(line.row))));
      line.tr.after(line.more);
    }
    if (line.more) line.more.hidden = !open;
  }

  // Put the rows in order without computing anything anew; nothing stays at the end.
  function order() {
    const by = COLUMNS.find(({ key }) => key === state.key).by ?? ((row) => row[state.key]);
    const keyed = state.rows.map((row) => [by(row) ?? null, row]);
    keyed.sort(([a, p], [b, q]) => (a === null) - (b === null) || (a !== null && (state.down ? d3.descending(a, b) : d3.ascending(a, b))) || p.rank - q.rank);
    parts.body.append(...keyed.flatMap(([, row]) => [lines.get(row.index).tr, lines.get(row.index).more].filter(Boolean)));
    for (const th of parts.heads) {
      if (th.dataset.key === state.key) th.setAttribute("aria-sort", state.down ? "descending" : "ascending");
      else th.removeAttribute("aria-sort");
    }
  }
  function sortBy({ key, down }) {
    Object.assign(state, { key, down: state.key === key ? !state.down : Boolean(down) });
    order();
  }
  function head() {
    parts.heads = COLUMNS.map((own) => el("th", { scope: "col", class: own.text ? null : "right", "data-key": own.key },
      own.key ? el("button", { type: "button", title: own.hint, onclick: () => sortBy(own) }, own.title) : own.title));
    return el("thead", {}, el("tr", {}, parts.heads));
  }

  // Compute rows, ranks and figures for the filter as it is, and draw them.
  function update() {
    const text = state.text.toLowerCase();
    const strategies = new Set([...state.filter.strategies].filter((s) => data.strategies[s].name.toLowerCase().includes(text)));
    const filter = { ...state.filter, strategies };
    const rows = ranking.rows(filter);
    state.rows = rows;
    const finish = () => {
      ranking.intervals(rows, filter);
      draw(rows);
      parts.top.replaceChildren(...overview.top(rows));
    };
    if (rows.length * (rows[0]?.cases.length ?? 0) > LAZY) {
      draw(rows);
      setTimeout(() => state.rows === rows && finish(), 0);
    } else finish();
    clearTimeout(parts.timer);
    const below = () => {
      parts.matrix.replaceChildren(...bench.caseMatrix(rows, filter));
      parts.figures.replaceChildren(...overview.figures(rows, filter));
    };
    if (parts.drawn) parts.timer = setTimeout(below, 60);
    else below();
    parts.drawn = true;
  }
  function draw(rows) {
    lines.clear();
    for (const row of rows) {
      const name = [row.unphysical && "unphysical", row.strategy === data.baseline && "baseline"].filter(Boolean).join(" ");
      lines.set(row.index, { row, tr: el("tr", { class: name, "data-strategy": row.strategy }, COLUMNS.map((own) => own.cell(row))), more: null });
    }
    parts.body.replaceChildren(...(rows.length ? [] : [el("tr", {}, el("td", { colspan: COLUMNS.length }, "Nothing to show: no result passes the filters."))]));
    order();
    const kind = ranking.intervalKind(rows);
    COLUMNS.forEach((own, k) => {
      if (!own.key) parts.heads[k].textContent = `95 % interval${kind ? ` over ${kind}` : ""}`;
      for (const tr of [parts.heads[k].parentNode, ...[...lines.values()].map((line) => line.tr)]) tr.children[k].hidden = own.block !== undefined && !state.filter.blocks.includes(own.block);
    });
    const [changed, fewer] = [!ranking.isWhole(state.filter), rows.length < data.strategies.length];
    const count = `${rows.length} of ${bench.plural(data.strategies.length, "strategy", "strategies")}, ${rows[0]?.cases.length ?? 0} of ${bench.plural(data.cases.length, "case")}, ${state.filter.blocks.length} of ${bench.plural(data.blocks.length, "block")}.`;
    const anew = changed ? " Skills, intervals, errors and ranks are computed anew for these; the tiers and groups are those of the whole run." : fewer ? " Ranks are among these; the tiers and groups are those of the whole run." : "";
    parts.status.textContent = count + anew;
    parts.status.classList.toggle("changed", changed || fewer);
  }

  // Return the heading and the lines below it that say what the run shows.
  function finding() {
    const [first, ...rest] = data.finding;
    return [el("h1", { tabindex: "-1" }, first ?? "Leaderboard"), rest.length ? el("p", { class: "finding" }, rest.join(" ")) : null];
  }

  bench.errorLeft = (row, place) => (row.logs[0][place] === null ? null : bench.median(row.logs.map((logs) => Math.exp(logs[place]))));
  bench.board = {
    // Replace parts of the filter ({scenarios, blocks, strategies: Sets or lists, text}) and draw anew.
    setFilter(given) {
      const { filter } = state;
      if (given.scenarios) filter.scenarios = new Set(given.scenarios);
      if (given.blocks) filter.blocks = d3.sort(given.blocks);
      if (given.strategies) filter.strategies = new Set(given.strategies);
      if (given.text !== undefined) state.text = given.text;
      update();
    },
    rows: () => state.rows,
    // Return the page of the leaderboard.
    page() {
      state.filter = ranking.everything();
      parts.body = el("tbody");
      parts.status = el("p", { class: "status", role: "status" });
      for (const name of ["top", "figures"]) parts[name] = el("div", { class: "columns" });
      parts.matrix = el("div", {});
      const table = el("table", { id: "board-table", class: "board" }, el("caption", { class: "hidden" }, "Leaderboard; the buttons in the head sort it"), head(), parts.body);
      const page = el("section", { id: "board" }, finding(), parts.top, el("h2", {}, "Leaderboard"), el("p", { class: "lead" }, data.lead, " Every rms is over the modes of a block, and the median over the cases."),
        bench.filters(), parts.status, bench.scroll("Leaderboard", table), parts.matrix, el("h2", {}, "How the strategies compare"), parts.figures);
      update();
      return page;
    },
  };
}
