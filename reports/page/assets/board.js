// The leaderboard: a sortable table, filters that compute it anew, and the gains case by case.
{
  const { el, data, number, count, share, small, cell, ranking, overview } = bench;
  const LAZY = 4000; // rows times cases from which intervals come after the table
  const state = { filter: null, rows: [], drawn: false, timer: 0 };
  const parts = {};

  bench.blockName = (k) => (data.blocks[k] === "used" ? "given" : data.blocks[k]);
  const twinsOf = (row) => data.strategies[row.index].twins;

  // A column: key, title, hint, what makes its cell of a row; words are left, and figures of gain sort downwards first.
  const figure = (key, title, hint, say, more) => ({ key, title, hint, cell: (row) => cell(row[key], say), right: true, ...more });
  const known = (key) => data.board.some((row) => row[key] !== null);
  const gain = (key, title, hint) => (key === "gain" || known(key)) && figure(key, title, hint, share, { down: true });
  const percent = (value) => (Number.isFinite(value) ? `${Math.round(100 * value)}` : "–");
  const COLUMNS = [
    { key: "rank", title: "Rank", right: true, hint: "yardsticks, which know nothing of the structure, have none", cell: (row) => cell(row.rank, (v) => (row.yardstick ? "=" : count(v)), { "data-sort": row.place }) },
    { key: "strategy", title: "Strategy", cell: nameCell },
    gain("gain", "Gain", `what the models gain over the ${ranking.yardstick}s on ${data.scored_on}, -1 to 1: mean of the two gains to the right; a job without a possible model counts as the model that was given`),
    { title: "95 % interval", right: true, cell: ({ gain_low: low, gain_high: high }) => el("td", { class: "right range", "data-low": low ?? "", "data-high": high ?? "" }, low === null ? "–" : `${share(low)} to ${share(high)}`) },
    figure("error_percent", "Off, %", "mean |ln(f_p / f_m)| in percent of the modes out of the given band", small),
    figure("better_share", "Better, %", `share of the structures where that is less than the ${ranking.yardstick}'s`, percent, { down: true }),
    figure("worse_share", "Worse, %", "share of the structures where it is larger by more than a quarter", percent),
    gain("error_gain", "Out of band", "gain by the frequencies out of the given band"),
    gain("change_gain", "Of changes", "gain by the changes of frequencies by modifications"),
    gain("gain_drawn", "From drawn", `gain of the start from the models as drawn, over the ${ranking.yardstick}s too`),
    gain("gain_tests", "On tests", "gain on tests alone, without computed truths"),
    data.strategies.some(({ twins }) => twins) && { key: "twins", title: "On twins", right: true, down: true, cell: (row) => cell(twinsOf(row)?.gain, (v) => (twinsOf(row) ? `${share(v)} (${share(twinsOf(row).original_gain)})` : number(v))),
      hint: "gain on similar structures under other names, drawn when the run began; next to it, in brackets, on the cases that have such twins; the lower one counts" },
    ...Object.keys(data.strategies[0]?.drawings ?? {}).flatMap((drawing) => [["gain", `Gain, ${drawing}`, share], ["error_percent", `Off, ${drawing}, %`, small]].map(([what, title, say]) => ({
      key: `${what} ${drawing}`, title, right: true, down: what === "gain", hint: `from the drawing ${drawing}; in brackets, from that of case.toml, on the cases that have both`,
      cell: (row) => { const [first, own] = data.strategies[row.index].drawings[drawing][what]; return cell(own, (v) => `${say(v)} (${say(first)})`); } }))),
    known("band_percent") && figure("band_percent", "In band, %", "error of modified modes in the given band, where the given frequencies nearly are the answer", small),
    known("shape_error") && figure("shape_error", "1 - MAC", "of the unseen modes, mean", share),
    figure("false_modes", "False modes", "modes that a test would see and did not, mean over the structures", small),
    ...data.blocks.map((block, k) => figure(`${block}_percent`, `${bench.blockName(k)} rms, %`, `rms frequency error of the ${block === "used" ? "modes that were given; no part of the gain" : `${block} modes`}; median over the cases`, small, { block: k })),
    { key: "flags", title: "Flags", cell: flagCell },
    { key: "coverage", title: "Answered", hint: "jobs that gave a possible model", cell: coverageCell },
    { key: "better_than", title: "Above", right: true, down: true, hint: "lines of the board that it is shown to be better than, after correction for all pairs", cell: (row) => cell(row.better_than.length, count, { title: row.better_than.join(", ") }) },
    { key: "worse_than", title: "Below", right: true, hint: "lines of the board that it is shown to be worse than", cell: (row) => cell(row.worse_than.length, count, { title: row.worse_than.join(", ") }) },
    known("responses_db") && figure("responses_db", "Responses, dB", "rms error of the log-magnitude of held-out frequency responses; no part of the gain; median over the cases", small),
    figure("parameters", "Un\u00adknowns", "free parameters, median over the cases", count),
    figure("seconds", "Time, s", "wall time, median over the cases", small),
  ].filter(Boolean);

  // Return a cell of words that sorts by something else.
  function cellOf(name, sort, ...content) {
    return el("td", { class: name, "data-sort": sort }, content);
  }
  function nameCell(row) {
    const open = ({ currentTarget: button }) => toggle(row, button);
    return el("th", { scope: "row", class: "name" }, el("button", { type: "button", class: "expand", title: "gains case by case", "aria-expanded": "false", "aria-controls": `cases-${row.index}`, onclick: open }, row.strategy));
  }
  function flagCell(row) {
    const { rigid_modes_lost: lost, negative_eigenvalues: negative } = row;
    const flags = [
      lost && `${bench.plural(lost, "rigid mode")} lost`, negative && bench.plural(negative, "negative eigenvalue"),
      row.unphysical && !lost && !negative && "unphysical", !row.unphysical && !row.ok && "no model",
      twinsOf(row)?.suspicious && "knows the cases?", data.strategies[row.index].unsteady && "two answers to one job",
      data.strategies[row.index].unconfined && "no sandbox",
    ].filter(Boolean).map((flag) => el("span", { class: "flag" }, el("span", { "aria-hidden": "true" }, "▲ "), flag));
    return el("td", { class: flags.length ? "flags" : "flags soft", "data-lost": lost, "data-negative": negative, "data-sort": lost + negative + (row.ok ? 0 : 1e9) }, flags.length ? flags : "none");
  }
  function coverageCell(row) {
    const misses = d3.rollups(row.results.filter((r) => r.status !== "ok"), (own) => own.length, (r) => r.status);
    if (row.total > row.results.length) misses.push(["missing", row.total - row.results.length]);
    const stated = misses.map(([status, n]) => el("div", { class: status === "not-applicable" ? "soft" : "bad" }, `${n} ${bench.statusWord(status)}`));
    return el("td", { class: "coverage", "data-ok": row.answered, "data-total": row.total, "data-sort": -row.answered - row.not_applicable / 1e6 }, `${row.answered} of ${row.total}`, stated);
  }

  // Return the gains of a strategy case by case.
  function detail(row) {
    const seeds = row.perSeed.length;
    const lines = row.cases.map((c, place) => {
      const own = row.results.filter((r) => r.c === c);
      const fine = own.filter((r) => r.status === "ok");
      const middle = (pick, say) => cell(bench.median(fine.map(pick).filter((v) => v !== null)), say);
      const said = [
        fine.length && (seeds > 1 ? `${fine.length} of ${seeds} seeds ok` : "✓ ok"),
        own.some((r) => r.unphysical) && "▲ unphysical",
        ...new Set(own.filter((r) => r.status !== "ok").map((r) => `${bench.statusText(r.status)}${r.reason ? `: ${r.reason}` : ""}`)),
        own.length < seeds && `${bench.statusText("missing")}${seeds > 1 ? ` for ${bench.plural(seeds - own.length, "seed")}` : ""}`,
      ];
      return [bench.caseLink(data.cases[c]), cell(row.gains[place], share), ...data.blocks.map((_, k) => middle((r) => r.rms[k], small)),
        middle((r) => bench.median(r.mac.filter((v) => v !== null))), middle((r) => r.parameters, count), middle((r) => r.seconds, small),
        el("td", { class: "said" }, said.filter(Boolean).join("; "))];
    });
    const heads = ["Case", "Gain", ...data.blocks.map((block) => `${block} rms, %`), "MAC", "Unknowns", "Time, s", "Outcome"];
    const { citation, version } = data.strategies[row.index];
    return [citation && el("p", { class: "soft" }, citation, version && ` (version ${version})`), bench.table(`${row.strategy}, case by case; medians over the seeds`, heads, lines)];
  }
  function toggle(row, button) {
    const [open, line] = [button.getAttribute("aria-expanded") !== "true", button.closest("tr")];
    button.setAttribute("aria-expanded", String(open));
    if (!line.nextElementSibling?.matches(".more")) line.after(el("tr", { class: "more", id: `cases-${row.index}` }, el("td", { colspan: COLUMNS.length }, el("div", { class: "inner" }, detail(row)))));
    line.nextElementSibling.hidden = !open;
  }

  // Compute rows, ranks and figures for the filter as it is, and draw them.
  function update(changed) {
    Object.assign(state.filter, changed);
    const strategies = new Set([...state.filter.strategies].filter((s) => data.strategies[s].name.toLowerCase().includes(state.filter.text)));
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
    clearTimeout(state.timer);
    const below = () => {
      parts.matrix.replaceChildren(...bench.caseMatrix(rows, filter));
      parts.figures.replaceChildren(...overview.figures(rows, filter));
    };
    if (state.drawn) state.timer = setTimeout(below, 60);
    else below();
    state.drawn = true;
  }
  function draw(rows) {
    const { blocks } = state.filter;
    const hidden = ({ block }) => block !== undefined && !blocks.includes(block);
    const lines = rows.map((row) => {
      const name = [row.unphysical && "unphysical", row.strategy === data.baseline && "baseline", row.yardstick && "yardstick"].filter(Boolean).join(" ");
      return el("tr", { class: name, "data-strategy": row.strategy }, COLUMNS.map((column) => Object.assign(column.cell(row), { hidden: hidden(column) })));
    });
    parts.body.replaceChildren(...(rows.length ? lines : [el("tr", {}, el("td", { colspan: COLUMNS.length }, "Nothing to show: no result passes the filters."))]));
    parts.sort();
    const kind = ranking.intervalKind(rows);
    COLUMNS.forEach((column, k) => {
      if (!column.key) parts.heads[k].textContent = `95 % interval${kind && ` over ${kind}`}`;
      parts.heads[k].hidden = hidden(column);
    });
    const [changed, fewer] = [!ranking.isWhole(state.filter), rows.length < data.strategies.length];
    const anew = changed ? "Gains, intervals, errors and ranks are computed anew for these, without twins" : "Ranks are among these";
    parts.status.textContent = `${rows.length} of ${bench.plural(data.strategies.length, "strategy", "strategies")}, ${rows[0]?.cases.length ?? 0} of ${bench.plural(data.cases.length, "case")}, ${blocks.length} of ${bench.plural(data.blocks.length, "block")}.`
      + (changed || fewer ? ` ${anew}; what is shown to differ is that of the whole run.` : "");
    parts.status.classList.toggle("changed", changed || fewer);
  }

  // Return the predictive board of the whole run, which has no ranks.
  function predictive() {
    const { rows, common } = data.predictive;
    const name = ({ strategy, yardstick, stated }) => el("th", { scope: "row" }, `${yardstick ? "= " : ""}${stated ? "± " : ""}${strategy}`);
    const parts = [["Above", "above"], ["In band", "band"]].flatMap(([title, band]) => {
      const [low, high, ...figures] = ["low", "high", "crps_percent", "coverage90", "skill"].map((key) => `${band}_${key}`);
      const range = (row) => el("td", { class: "right" }, row[low] === null ? "–" : `${share(row[low])} to ${share(row[high])}`);
      return [...["CRPS, %", "in 90 %", "skill"].map((head, k) => [`${title}: ${head}`, (row) => cell(row[figures[k]], k ? share : small)]), ["95 % interval", range]];
    });
    const known = rows.some((row) => row.above_crps_percent !== null || row.band_crps_percent !== null);
    const lines = rows.map((row) => [name(row), ...parts.map(([, make]) => make(row))]);
    return el("section", { id: "predictive" }, el("h2", {}, "Predictive board"), known && bench.scroll(bench.table("Predictive board", ["Strategy", ...parts.map(([head]) => head)], lines)),
      known && el("p", { class: "soft" }, "Of the whole run. Above: unseen modes above the highest given frequency; in band: modified ones below it. CRPS: continuous ranked probability score of ln f, less is better. In 90 %: share of the modes in 90 % intervals, near 0.90 where these are right. Skill: gain of the CRPS over that of the textbook model, -1 to 1. ±: states an uncertainty of its own."),
      el("p", { class: "soft" }, known ? common : "No uncertainty is stated, and to learn a common one takes 6 structures or more."));
  }

  bench.board = {
    rows: () => state.rows,
    // Return the page of the leaderboard.
    page() {
      state.filter = { ...ranking.everything(), text: "" };
      parts.body = el("tbody");
      parts.status = el("p", { class: "status", role: "status" });
      for (const name of ["top", "figures"]) parts[name] = el("div", { class: "columns" });
      parts.matrix = el("div");
      parts.heads = COLUMNS.map(({ key, title, hint, right, down }) => el("th", { scope: "col", class: right && "right", title: hint, "data-key": key, "data-still": !key, "data-down": down, "aria-sort": key === "rank" && "ascending" }, title));
      const table = el("table", { id: "board-table", class: "board", "aria-label": "Leaderboard; the buttons in the head sort it" }, el("thead", {}, el("tr", {}, parts.heads)), parts.body);
      parts.sort = sortable(table);
      const [first, ...rest] = data.finding;
      const page = el("section", { id: "board" }, el("h1", { tabindex: "-1" }, first ?? "Leaderboard"), rest.length > 0 && el("p", { class: "finding" }, rest.join(" ")), parts.top,
        el("h2", {}, "Leaderboard"), el("p", { class: "lead" }, data.lead, " Every rms is over the modes of a block, and the median over the cases."),
        bench.filters(update), parts.status, bench.scroll(table), predictive(), parts.matrix, el("h2", {}, "How the strategies compare"), parts.figures);
      update({});
      return page;
    },
  };
}
