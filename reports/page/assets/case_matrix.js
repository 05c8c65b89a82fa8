// Case by case: a row a case, a column a strategy, the baseline always in view beside the cases.
{
  const { el, data, number, small } = bench;
  let chosen = "left";

  // Return the share of a colour, -1 (blue, a quarter of the error or less) to 1 (vermilion, four times).
  const tone = (ratio) => Math.max(-1, Math.min(1, Math.log(ratio) / Math.log(4)));

  function cell(row, c, measure, against) {
    const value = measure.of(row, c);
    const results = row.results.filter((r) => r.c === row.cases[c]);
    const why = results.find((r) => r.status !== "ok") ?? (results.length ? null : { status: "missing", reason: "" });
    const shade = value === null || !against ? 0 : tone((value + measure.offset) / (against + measure.offset));
    return el("td", { class: "right", "data-value": value ?? "", title: why ? `${row.strategy}, ${data.cases[row.cases[c]].name}: ${bench.statusWord(why.status)}${why.reason ? `: ${why.reason}` : ""}` : null,
      style: { "--tone": shade < 0 ? "var(--blue)" : "var(--vermilion)", "--share": `${Math.round(Math.abs(shade) * 45)}%` } },
      why ? `${bench.statusText(why.status)[0]} ` : "", why && value === null ? "" : measure.say(value));
  }

  // Return the heading, the choice of what is shown, and the table.
  bench.caseMatrix = (rows, filter) => {
    if (!rows.length) return [];
    const baseline = rows.find((row) => row.strategy === data.baseline);
    const columns = baseline ? [baseline, ...rows.filter((row) => row !== baseline)] : rows;
    const { cases } = rows[0];
    const measures = [
      { key: "left", title: `Error left (1 = ${bench.ranking.yardstick})`, of: bench.errorLeft, say: number, offset: 0 },
      ...filter.blocks.map((k) => ({ key: data.blocks[k], title: `${data.blocks[k] === "used" ? "given" : data.blocks[k]}: rms frequency error, %`, of: (row, c) => bench.ranking.errorOf(row.index, cases[c], k), say: small, offset: data.offset_percent })),
    ];
    const holder = el("div", {});
    const fill = () => {
      const measure = measures.find(({ key }) => key === chosen) ?? measures[0];
      const body = el("tbody", {}, cases.map((index, c) => {
        const against = measure.key === "left" ? 1 : baseline && measure.of(baseline, c);
        return el("tr", {}, el("th", { scope: "row" }, el("a", { href: bench.caseHref(data.cases[index].name) }, data.cases[index].name)), columns.map((row) => cell(row, c, measure, against)));
      }));
      const lines = [...body.children];
      const sort = (k) => (event) => {
        const head = event.currentTarget.parentNode;
        const down = head.getAttribute("aria-sort") !== "descending";
        for (const th of head.parentNode.children) th.removeAttribute("aria-sort");
        head.setAttribute("aria-sort", down ? "descending" : "ascending");
        const of = (tr) => (k === 0 ? lines.indexOf(tr) : Number(tr.children[k].dataset.value || NaN));
        body.append(...d3.sort(lines, (a, b) => (down ? d3.descending : d3.ascending)(of(a), of(b))));
      };
      const heads = ["Case", ...columns.map((row) => row.strategy)].map((name, k) => el("th", { scope: "col" }, el("button", { type: "button", onclick: sort(k) }, name)));
      holder.replaceChildren(bench.scroll("Case by case", el("table", { class: `matrix ${baseline ? "fixed" : ""}`, "aria-label": measure.title }, el("thead", {}, el("tr", {}, heads)), body)));
    };
    const select = el("select", { "aria-label": "Figure of every case", onchange: () => {
      chosen = select.value;
      fill();
    } }, measures.map(({ key, title }) => el("option", { value: key, selected: key === chosen }, title)));
    fill();
    return [el("h2", {}, "Case by case"),
      el("p", { class: "controls" }, select, el("span", { class: "soft" }, `Medians over the seeds. Blue: less than ${chosen === "left" ? `the ${bench.ranking.yardstick} leaves` : "the baseline"}, vermilion: more. A name sorts the cases.`)), holder];
  };
}
