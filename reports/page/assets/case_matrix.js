// Case by case: a row a case, a column a strategy, the baseline always in view next to the cases.
{
  const { el, data } = bench;
  const OFFSET = 0.05; // percent, so that an error that is met does not paint all others
  let chosen = "gain";

  // Return a cell, blue for a gain and vermilion for a loss; of an error down to a quarter of what it is
  // held against, and up to four times.
  function cell(row, c, { of, say, ratio }, against) {
    const value = of(row, c);
    const results = row.results.filter((r) => r.c === row.cases[c]);
    const why = results.find((r) => r.status !== "ok") ?? (results.length ? null : { status: "missing" });
    const tone = value === null ? 0 : !ratio ? -value : against ? Math.log((value + OFFSET) / (against + OFFSET)) / Math.log(4) : 0;
    const stated = why && `${row.strategy}, ${data.cases[row.cases[c]].name}: ${bench.statusWord(why.status)}${why.reason ? `: ${why.reason}` : ""}`;
    return bench.cell(value, (v) => [why && `${bench.statusText(why.status)[0]} `, why && v === null ? "" : say(v)], { title: stated, style: bench.tone(Math.max(-1, Math.min(1, tone))) });
  }

  // Return the heading, the choice of what is shown, and the table.
  bench.caseMatrix = (rows, filter) => {
    if (!rows.length) return [];
    const baseline = rows.find((row) => row.strategy === data.baseline);
    const strategies = baseline ? [baseline, ...rows.filter((row) => row !== baseline)] : rows;
    const { cases } = rows[0];
    const measures = new Map([
      ["gain", { title: `Gain over the ${bench.ranking.yardstick}`, of: (row, c) => row.gains[c], say: bench.share, ratio: false }],
      ...filter.blocks.map((k) => [data.blocks[k], { title: `${bench.blockName(k)}: rms frequency error, %`, of: (row, c) => bench.ranking.errorOf(row.index, cases[c], k), say: bench.small, ratio: true }]),
    ]);
    const [holder, stated] = [el("div"), el("span", { class: "soft" })];
    const fill = (key) => {
      chosen = measures.has(key) ? key : "gain";
      const measure = measures.get(chosen);
      const against = (c) => baseline && measure.of(baseline, c);
      const body = cases.map((index, c) => [el("th", { scope: "row", "data-sort": c }, bench.caseLink(data.cases[index])), ...strategies.map((row) => cell(row, c, measure, against(c)))]);
      const table = bench.table("Case by case", ["Case", ...strategies.map((row) => row.strategy)], body, `matrix toned ${baseline ? "fixed" : ""}`);
      for (const head of table.tHead.rows[0].cells) head.dataset.down = "";
      sortable(table);
      holder.replaceChildren(bench.scroll(table));
      stated.textContent = `${chosen === "gain" ? `Means over the seeds. Blue: better than the ${bench.ranking.yardstick}, vermilion: worse.` : "Medians over the seeds. Blue: less than the baseline, vermilion: more."} A name sorts the cases.`;
    };
    const select = bench.select("Figure of every case", [...measures].map(([key, { title }]) => [key, title]), chosen, fill);
    fill(chosen);
    return [el("h2", {}, "Case by case"), el("p", { class: "controls" }, select, stated), holder];
  };
}
