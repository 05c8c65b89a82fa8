// Charts of the run page: gains with intervals, calibration, profiles, cost, mean ranks with groups.
{
  const { el, data, ranking } = bench;
  const MOST_CURVES = 8;
  const OFFSET = 0.05; // percent, so that an error that is met does not decide a ratio
  const MOST_ROWS = 40;
  const FARTHEST = 1000;
  const LEVELS = [...d3.range(0.1, 0.95, 0.1).map((level) => Number(level.toFixed(1))), 0.95];
  const { note, pairs } = data.statistics;

  // Return the first rows, and the baseline with them.
  function first(rows, most) {
    const baseline = rows.find((row) => row.strategy === data.baseline);
    return rows.length <= most || rows.indexOf(baseline) < most ? rows.slice(0, most) : [...rows.slice(0, most - 1), baseline].filter(Boolean);
  }
  const left = (rows, shown) => (rows.length > shown.length ? ` Drawn: ${shown.length} of ${rows.length}; filter the strategies to see others.` : "");

  function gains(rows) {
    const shown = first(rows, MOST_ROWS);
    const nameOf = (row) => `${row.yardstick ? "= " : ""}${row.strategy}${row.unphysical ? " ▲" : ""}`;
    const names = shown.map(nameOf);
    const kind = ranking.intervalKind(rows);
    const drawn = shown.filter((row) => row.gain_drawn !== null);
    const given = `${ranking.yardstick}s`;
    return bench.draw({
      kind: "interval", title: `Gain of every strategy on ${data.scored_on}`,
      note: `${kind && `The line is the 95 % interval over ${kind}. `}0: the ${given}; 1: no error left; =: yardsticks that know nothing of the structure.${shown.some((row) => row.unphysical) ? " ▲: unphysical." : ""}${left(rows, shown)}`,
      x: { label: `gain over the ${given}`, unit: "1", high: 1 }, y: { names }, marks: [{ axis: "x", value: 0, label: "without data" }],
      series: [
        { name: `from the ${given}`, names, x: shown.map((row) => row.gain), y: names, low: shown.map((row) => row.gain_low), high: shown.map((row) => row.gain_high) },
        ...(drawn.length ? [{ name: "from the models as drawn", role: "nominal", x: drawn.map((row) => row.gain_drawn), y: drawn.map(nameOf), names: drawn.map(nameOf) }] : []),
      ],
    });
  }

  function calibration(rows) {
    const shown = rows.filter((row) => row.stated.length).slice(0, MOST_CURVES);
    if (!shown.length) return null;
    const modes = new Set(d3.extent(shown, (row) => d3.sum(row.stated, ({ levels }) => levels.length)));
    return bench.draw({
      kind: "calibration", title: "Are stated uncertainties true?",
      note: `Share of unseen modes inside the interval of each level that a strategy states; over ${[...modes].join(" to ")} modes, every structure counts alike. On the diagonal: true; below it: too sure; above: too cautious.`,
      x: { label: "stated level", unit: "1", low: 0, high: 1 }, y: { label: "share of unseen modes inside", unit: "1", low: 0, high: 1 },
      series: shown.map((row) => ({ name: row.strategy, x: LEVELS, y: LEVELS.map((level) => ranking.covered(row, level)) })),
    });
  }

  // Return the share of problems within a factor of the best, strategy by strategy.
  function profile(rows, filter) {
    const shown = first(rows, MOST_CURVES);
    const problems = ranking.problems(rows, filter);
    if (!problems.length) return null;
    const offset = OFFSET;
    const ratios = d3.transpose(problems.map((errors) => {
      const best = d3.min(errors.filter((e) => e !== null));
      return errors.map((e) => (e === null ? Infinity : (e + offset) / (best + offset)));
    })).map((own) => d3.sort(own));
    const most = d3.max(ratios.flat().filter(Number.isFinite)) ?? 2;
    const end = Math.min(FARTHEST, d3.nice(1, Math.max(most, 2), 4)[1]);
    const series = shown.map((row) => {
      const own = ratios[rows.indexOf(row)];
      const x = [1, ...new Set(own.filter((tau) => tau > 1 && tau < end)), end];
      return { name: row.strategy, x, y: x.map((tau) => d3.bisectRight(own, tau * (1 + 1e-9)) / own.length), role: row.strategy === data.baseline ? "nominal" : "other" };
    });
    return bench.draw({
      kind: "steps", title: "Performance profiles",
      note: `How often is a strategy within a factor τ of the best one? ${bench.plural(problems.length, "problem")}, one a case; errors out of the given band with ${offset} % added. Left edge: how often it is the best; high and left is good.${left(rows, shown)}`,
      x: { label: "factor τ of the best error", unit: "1", log: true, low: 1, high: end }, y: { label: "share of problems", unit: "1", low: 0, high: 1.02 }, series,
    });
  }

  function cost(rows) {
    const found = rows.filter((row) => row.ok && row.seconds > 0 && row.error_percent > 0);
    const textbook = data.board[0]?.textbook_percent;
    if (!found.length) return null;
    const series = [["physical", false, 2], ["unphysical", true, 1]].map(([name, unphysical, style]) => {
      const own = found.filter((row) => row.unphysical === unphysical);
      return { name, style, x: own.map((row) => row.seconds), y: own.map((row) => row.error_percent), names: own.map((row) => row.strategy) };
    });
    return bench.draw({
      kind: "scatter", title: "Accuracy against cost",
      note: "Error out of the given band, mean over the structures, against wall time, median over the cases. Low and left is good.",
      x: { label: "wall time, median over the cases", unit: "s", log: true }, y: { label: "error out of band", unit: "%", log: true },
      marks: textbook > 0 ? [{ axis: "y", value: textbook, label: ranking.yardstick }] : [], series: series.filter((s) => s.x.length),
    });
  }

  // Draw between how many lines of the board a difference is shown.
  function comparison() {
    const rows = data.board.filter((row) => row.better_than.length + row.worse_than.length).slice(0, MOST_ROWS);
    const names = rows.map((row) => `${row.yardstick ? "= " : ""}${row.strategy}`);
    const apart = pairs.filter(([, , p]) => p < 0.05).length;
    if (!pairs.length) return null;
    if (!rows.length) return el("figure", {}, el("figcaption", {}, el("b", {}, "Which strategies differ by more than chance"), ` None of ${bench.plural(pairs.length, "pair")}. ${note}`));
    return bench.draw({
      kind: "scatter", title: "Which strategies differ by more than chance",
      note: `${apart} of ${bench.plural(pairs.length, "pair")} differ. ${note} For the whole run whatever the filter.`,
      x: { label: "lines that it is shown to be better than", unit: "1", low: 0 }, y: { label: "lines that it is shown to be worse than", unit: "1", low: 0 },
      series: [{ name: "lines of the board", x: rows.map((row) => row.better_than.length), y: rows.map((row) => row.worse_than.length), names }],
    });
  }

  let whole = null;
  bench.overview = {
    top: (rows) => [gains(rows), calibration(rows)].filter(Boolean),
    figures: (rows, filter) => [profile(rows, filter), cost(rows), (whole ??= comparison())].filter(Boolean),
  };
}
