// Case by case: a row a case, a column a strategy, the baseline always in view next to the cases.
{
  const { el, data } = bench;
  let chosen = "left";

  // Return a cell, blue down to a quarter of what it is held against, vermilion up to four times.
  function cell(row, c, { of, say, offset }, against) {
    const value = of(row, c);
    const results = row.results.filter((r) => r.c === row.cases[c]);
    const why = results.find((r) => r.status !== "ok") ?? (results.length ? null : { status: "missing" });
    const tone = value === null || !against ? 0 : Math.log((value + offset) / (against + offset)) / Math.log(4);
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
      ["left", { title: `Error left (1 = ${bench.ranking.yardstick})`, of: bench.errorLeft, say: bench.number, offset: 0, against: () => 1 }],
      ...filter.blocks.map((k) => [data.blocks[k], { title: `${bench.blockName(k)}: rms frequency error, %`, of: (row, c) => bench.ranking.errorOf(row.index, cases[c], k), say: bench.small, offset: data.offset_percent }]),
    ]);
    const [holder, stated] = [el("div"), el("span", { class: "soft" })];
    const fill = (key) => {
      chosen = measures.has(key) ? key : "left";
      const measure = measures.get(chosen);
      const against = measure.against ?? ((c) => baseline && measure.of(baseline, c));
      const body = cases.map((index, c) => [el("th", { scope: "row", "data-sort": c }, bench.caseLink(data.cases[index])), ...strategies.map((row) => cell(row, c, measure, against(c)))]);
      const table = bench.table("Case by case", ["Case", ...strategies.map((row) => row.strategy)], body, `matrix toned ${baseline ? "fixed" : ""}`);
      for (const head of table.tHead.rows[0].cells) head.dataset.down = "";
      sortable(table);
      holder.replaceChildren(bench.scroll(table));
      stated.textContent = `Medians over the seeds. Blue: less than ${chosen === "left" ? `the ${bench.ranking.yardstick} leaves` : "the baseline"}, vermilion: more. A name sorts the cases.`;
    };
    const select = bench.select("Figure of every case", [...measures].map(([key, { title }]) => [key, title]), chosen, fill);
    fill(chosen);
    return [el("h2", {}, "Case by case"), el("p", { class: "controls" }, select, stated), holder];
  };
}
