// The leaderboard: a sortable table, filters that recompute it, and the scores case by case.
{
  const { el, svg, data, number } = bench;
  const LAZY = 4000; // rows times cases from which intervals come after the table
  const state = { filter: null, text: "", key: "rank", down: false, rows: [], kind: "" };
  const parts = {};
  const lines = new Map();
  let letters = [];
  let tiers = [];

  const COLUMNS = [
    { key: "rank", title: "Rank", cell: (row) => value(row.rank, bench.count) },
    { key: "strategy", title: "Strategy", text: true, cell: nameCell },
    { key: "skill", title: "Skill", down: true, hint: "part of the textbook model's error on unseen data that is taken away: 1 is all of it, 0 none, less than 0 is worse; more is better", cell: (row) => value(row.skill, share, "strong") },
    { key: "interval", title: "95 % interval", still: true, cell: intervalCell },
    ...(data && data.board && data.board.some((row) => row.skill_drawn !== null) ? [{ key: "skill_drawn", title: "From drawn", down: true, hint: "skill of the start from the models as drawn, against the textbook models too", cell: (row) => value(row.skill_drawn, share) }] : []),
    ...(data && data.board && data.board.some((row) => row.skill_tests !== null) ? [{ key: "skill_tests", title: "On tests", down: true, hint: "skill on tests alone, without computed truths", cell: (row) => value(row.skill_tests, share) }] : []),
    ...(data && data.strategies && data.strategies.some((s) => s.twins) ? [{ key: "twins", title: "On twins", down: true, hint: "skill on similar structures under other names, drawn when the run began; beside it, in brackets, on the cases that have such twins", cell: twinsCell }] : []),
    ...(data && data.blocks ? data.blocks : []).map((block, k) => ({ key: `${block}_percent`, title: `${block === "used" ? "given" : block} rms,\u00a0%`, block: k, hint: block === "used" ? "median rms frequency error of the modes that were given; no part of the skill" : `median rms frequency error of the ${block} modes`, cell: (row) => value(row[`${block}_percent`], small) })),
    { key: "coverage90", title: "In 90\u00a0%", hint: "share of unseen modes in the 90 % interval that the strategy states", cell: (row) => value(row.coverage90, share) },
    { key: "crps_percent", title: "CRPS,\u00a0%", hint: "continuous ranked probability score of unseen modes in percent of the frequency; the absolute error where no uncertainty is stated", cell: (row) => value(row.crps_percent, small) },
    { key: "flags", title: "Flags", text: true, cell: flagCell },
    { key: "coverage", title: "Coverage", text: true, cell: coverageCell },
    { key: "tier", title: "Tier", hint: "1: no difference from the best shown; 2: none from the best of the others", cell: (row) => el("td", { class: "right" }, bench.count(tiers[row.index])) },
    { key: "letters", title: "Group", text: true, hint: "strategies that share a letter: no difference shown", cell: (row) => el("td", { class: "letters" }, letters[row.index] || (bench.overview.groups().length ? "alone" : "–")) },
    { key: "parameters", title: "Unknowns", hint: "free parameters, median over the cases", cell: (row) => value(row.parameters, bench.count) },
    { key: "seconds", title: "Time,\u00a0s", hint: "wall time, median over the cases", cell: (row) => value(row.seconds, small) },
  ];

  // Parts of a whole have three decimals; rounding errors are none.
  function share(v) {
    return v === null || v === undefined ? number(v) : v.toFixed(3).replace(/^-(?=0\.000$)/, "").replace("-", "\u2212");
  }
  function small(v) {
    return v !== null && v > 0 && v < 0.001 ? "< 0.001" : number(v);
  }
  function value(v, say, name = "") {
    return el("td", { class: `right ${name}`, "data-value": v === null || v === undefined ? "" : v }, say(v));
  }
  function twinsOn(row) {
    return data.strategies[row.index].twins || null;
  }
  function twinsCell(row) {
    const twins = twinsOn(row);
    return value(twins && twins.skill, (v) => (twins ? `${share(v)} (${share(twins.original_skill)})` : number(v)));
  }
  function nameCell(row) {
    const button = el("button", { type: "button", class: "expand", title: "scores case by case", "aria-expanded": "false", "aria-controls": `cases-${row.index}`, onclick: () => toggle(row.index) }, row.strategy);
    return el("th", { scope: "row", class: "name" }, button);
  }
  function intervalCell(row) {
    const cell = el("td", { class: "interval" });
    fillInterval(cell, row);
    return cell;
  }
  function fillInterval(cell, row) {
    const text = row.skill_low === null ? "" : `${share(row.skill_low)} to ${share(row.skill_high)}`;
    cell.replaceChildren(bar(row), el("span", { class: "range", "data-low": row.skill_low ?? "", "data-high": row.skill_high ?? "" }, text || "–"));
  }

  // The bars share one axis from the least figure of the board, or -1, to 1; what is less lies at its end.
  const WIDE = 120;
  function across(v) {
    const [low, high] = state.range;
    return 5 + ((Math.max(v, low) - low) / (high - low)) * (WIDE - 10);
  }
  // One element without children, which CSS draws: hundreds of rows stay quick to put in order.
  function bar(row) {
    const px = (v) => `${v.toFixed(1)}px`;
    const [low, high] = row.skill_low === null ? [row.skill, row.skill] : [row.skill_low, row.skill_high];
    const style = { "--one": px(across(0)), "--at": px(across(row.skill)), "--low": px(across(low)), "--wide": px(across(high) - across(low)) };
    return el("span", { class: "whisker", style });
  }
  function scaleBar() {
    const ticks = [-1, 0, 1].filter((t) => t >= state.range[0]);
    const node = svg("svg", { class: "scale", width: WIDE, height: 14, viewBox: `0 0 ${WIDE} 14`, "aria-hidden": "true" });
    for (const t of ticks) node.append(svg("text", { class: "tick mid", x: Math.min(Math.max(across(t), 12), WIDE - 8), y: 11 }, String(t).replace("-", "\u2212")));
    return node;
  }

  function flagCell(row) {
    const flags = [];
    if (row.rigid_modes_lost) flags.push(`${bench.plural(row.rigid_modes_lost, "rigid mode")} lost`);
    if (row.negative_eigenvalues) flags.push(bench.plural(row.negative_eigenvalues, "negative eigenvalue"));
    if (row.unphysical && !flags.length) flags.push("unphysical");
    if (!flags.length && !row.ok) flags.push("no model");
    if (twinsOn(row) && twinsOn(row).suspicious) flags.push("knows the cases?");
    if (data.strategies[row.index].unsteady) flags.push("two answers to one job");
    const items = flags.map((flag) => el("span", { class: "flag" }, el("span", { "aria-hidden": "true" }, "▲ "), flag));
    return el("td", { class: items.length ? "flags" : "flags soft", "data-lost": row.rigid_modes_lost, "data-negative": row.negative_eigenvalues }, items.length ? items : "none");
  }
  function missesOf(row) {
    const found = new Map();
    for (const r of row.results) if (r.status !== "ok") found.set(r.status, (found.get(r.status) || 0) + 1);
    const gone = row.total - row.results.length;
    if (gone > 0) found.set("missing", gone);
    return found;
  }
  function coverageCell(row) {
    const misses = [...missesOf(row)].map(([status, n], k) => [k ? ", " : "", el("span", { class: status === "not-applicable" ? "soft" : "bad" }, `${n} ${bench.statusWord(status)}`)]);
    return el("td", { class: "coverage", "data-ok": row.ok, "data-total": row.total }, `${row.ok} of ${row.total} ok`, misses.length ? el("div", { class: "misses" }, misses) : null);
  }

  function detail(row) {
    const heads = ["Case", "Error left", ...data.blocks.map((b) => `${b} rms,\u00a0%`), "MAC", "Unknowns", "Time,\u00a0s", "Outcome"];
    const body = row.cases.map((c, place) => {
      const own = row.results.filter((r) => r.c === c);
      const fine = own.filter((r) => r.status === "ok");
      const mid = (pick) => bench.median(fine.map(pick).filter((v) => v !== null && v !== undefined));
      const macs = (r) => bench.median(r.mac.filter((v) => v !== null));
      const said = [...new Set(own.filter((r) => r.status !== "ok").map((r) => `${bench.statusText(r.status)}${r.reason ? `: ${r.reason}` : ""}`))];
      const flags = own.some((r) => r.unphysical) ? ["▲ unphysical"] : [];
      const seeds = row.logs.length;
      if (own.length < seeds) said.push(seeds > 1 ? `${bench.statusText("missing")} for ${bench.plural(seeds - own.length, "seed")}` : bench.statusText("missing"));
      const ok = fine.length && seeds > 1 ? [`${fine.length} of ${seeds} seeds ok`] : fine.length ? ["✓ ok"] : [];
      return el("tr", {},
        el("th", { scope: "row" }, el("a", { href: bench.caseHref(data.cases[c].name) }, data.cases[c].name)),
        value(row.logs[0][place] === null ? null : bench.median(row.logs.map((logs) => Math.exp(logs[place]))), number),
        data.blocks.map((_, k) => value(mid((r) => r.rms[k]), small)),
        value(mid(macs), number), value(mid((r) => r.parameters), bench.count), value(mid((r) => r.seconds), small),
        el("td", { class: "said" }, [...ok, ...flags, ...said].join("; ")));
    });
    const about = data.strategies[row.index];
    return [
      about.citation ? el("p", { class: "citation" }, about.citation, about.version ? ` (version ${about.version})` : "") : null,
      el("table", { class: "plain" }, el("caption", { class: "hidden" }, `${row.strategy}, case by case`),
        el("thead", {}, el("tr", {}, heads.map((h, k) => el("th", { scope: "col", class: k && k < heads.length - 1 ? "right" : "" }, h)))),
        el("tbody", {}, body)),
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

  function keyOf(row, key) {
    if (key === "flags") return row.rigid_modes_lost + row.negative_eigenvalues + (row.ok ? 0 : 1e9);
    if (key === "coverage") return -row.ok - row.not_applicable / 1e6;
    if (key === "letters") return letters[row.index] || "~";
    if (key === "twins") return twinsOn(row) && twinsOn(row).skill;
    if (key === "tier") return tiers[row.index];
    return row[key];
  }
  // Put the rows in order without computing anything anew; nothing stays at the end.
  function order() {
    const sign = state.down ? -1 : 1;
    const keyed = state.rows.map((row) => [keyOf(row, state.key), row]);
    keyed.sort(([a, p], [b, q]) => {
      const [none, other] = [a === null || a === undefined, b === null || b === undefined];
      if (none || other) return none - other || p.rank - q.rank;
      return sign * (a < b ? -1 : a > b ? 1 : 0) || p.rank - q.rank;
    });
    parts.body.append(...keyed.flatMap(([, row]) => Object.values(lines.get(row.index)).filter((node) => node instanceof Node)));
    for (const th of parts.heads) {
      if (!th.dataset.key) continue;
      const own = th.dataset.key === state.key;
      if (own) th.setAttribute("aria-sort", state.down ? "descending" : "ascending");
      else th.removeAttribute("aria-sort");
    }
  }
  function sortBy(key, down = state.key === key ? !state.down : Boolean((COLUMNS.find((column) => column.key === key) || {}).down)) {
    Object.assign(state, { key, down });
    order();
  }

  function head() {
    parts.heads = COLUMNS.map((column) => {
      const label = column.still ? el("span", { class: "still" }, column.title) : el("button", { type: "button", class: "sort", title: column.hint || null, onclick: () => sortBy(column.key) }, column.title, el("span", { class: "way", "aria-hidden": "true" }));
      return el("th", { scope: "col", class: column.text ? "left" : "right", "data-key": column.still ? null : column.key }, label);
    });
    parts.interval = parts.heads[COLUMNS.findIndex((column) => column.still)];
    return el("thead", {}, el("tr", {}, parts.heads));
  }

  function intervalsNow() {
    state.kind = bench.ranking.intervals(state.rows, state.filter);
  }
  // Compute rows, ranks and figures for the filter as it is, and draw them.
  function update() {
    const text = state.text.toLowerCase();
    const kept = new Set([...state.filter.strategies].filter((s) => data.strategies[s].name.toLowerCase().includes(text)));
    const filter = { ...state.filter, strategies: kept };
    const rows = bench.ranking.rows(filter);
    const later = rows.length * (rows.length ? rows[0].cases.length : 0) > LAZY;
    state.rows = rows;
    if (!later) intervalsNow();
    draw();
    if (later) setTimeout(() => state.rows === rows && (intervalsNow(), draw()), 0);
    clearTimeout(parts.timer);
    const figures = () => parts.figures.replaceChildren(...bench.overview.figures(state.rows, filter));
    if (parts.drawn) parts.timer = setTimeout(figures, 60);
    else figures();
    parts.drawn = true;
  }
  function draw() {
    const { rows } = state;
    const values = rows.flatMap((row) => [row.skill, row.skill_low]).filter((v) => v !== null);
    state.range = [Math.max(-1, Math.min(-0.1, ...values)), 1];
    lines.clear();
    for (const row of rows) lines.set(row.index, { row, tr: el("tr", { class: row.unphysical ? "unphysical" : "", "data-strategy": row.strategy }, COLUMNS.map((column) => column.cell(row))), more: null });
    parts.body.replaceChildren();
    if (!rows.length) parts.body.append(el("tr", {}, el("td", { colspan: COLUMNS.length, class: "empty" }, "Nothing to show: no result passes the filters.")));
    order();
    const kind = bench.ranking.intervalKind(rows);
    parts.interval.replaceChildren(el("span", { class: "still" }, `95 % interval${kind ? ` over ${kind}` : ""}`), scaleBar());
    COLUMNS.forEach((column, k) => {
      const off = column.block !== undefined && !state.filter.blocks.includes(column.block);
      for (const tr of [parts.heads[k].parentNode, ...[...lines.values()].map((line) => line.tr)]) tr.children[k].hidden = off;
    });
    say();
  }
  function say() {
    const changed = !bench.ranking.isWhole(state.filter);
    const fewer = state.rows.length < data.strategies.length;
    const first = `${state.rows.length} of ${bench.plural(data.strategies.length, "strategy", "strategies")}, ${state.rows.length ? state.rows[0].cases.length : 0} of ${bench.plural(data.cases.length, "case")}, ${state.filter.blocks.length} of ${bench.plural(data.blocks.length, "block")}.`;
    const anew = changed ? " Skills, intervals, errors and ranks are computed anew for these; the tiers and groups are those of the whole run." : fewer ? " Ranks are among these; the tiers and groups are those of the whole run." : "";
    parts.status.textContent = first + anew;
    parts.status.classList.toggle("changed", changed || fewer);
  }

  bench.board = {
    check: () => bench.ranking.check(),
    sortBy,
    // Replace parts of the filter ({scenarios, blocks, strategies: Sets or lists, text}) and draw anew.
    setFilter(given) {
      const { filter } = state;
      if (given.scenarios) filter.scenarios = new Set(given.scenarios);
      if (given.blocks) filter.blocks = [...given.blocks].sort((a, b) => a - b);
      if (given.strategies) filter.strategies = new Set(given.strategies);
      if (given.text !== undefined) state.text = given.text;
      update();
    },
    filter: () => ({ ...state.filter, text: state.text }),
    rows: () => state.rows,
    // Return the page of the leaderboard.
    page() {
      state.filter = bench.ranking.everything();
      letters = bench.overview.letters();
      tiers = bench.overview.tiers();
      parts.body = el("tbody");
      parts.status = el("p", { class: "status", role: "status" });
      parts.figures = el("div", { class: "figures" });
      const table = el("table", { id: "board-table", class: "board" }, el("caption", { class: "hidden" }, "Leaderboard; the buttons in the head sort it"), head(), parts.body);
      const page = el("section", { id: "board" },
        el("h1", { tabindex: "-1" }, "Leaderboard"),
        el("p", { class: "lead" }, data.lead),
        bench.filters(), parts.status, bench.scroll("Leaderboard", table), el("h2", {}, "How the strategies compare"), parts.figures);
      update();
      return page;
    },
  };
}
