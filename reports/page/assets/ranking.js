// Gains and ranks of any part of a run, by the rule of docs/scoring.md. Without a filter the figures are
// those of the run's own leaderboard.
{
  const RESAMPLES = 1999;
  const { data, median } = bench;
  const FIGURES = Object.keys(data.cases[0]?.start ?? { gain: 0 });
  const seeds = d3.sort(new Set([...data.seeds, ...data.results.map((r) => r.seed)]));
  const found = new Map(data.results.map((r) => [`${r.s}:${r.c}:${r.seed}`, r]));
  const byStrategy = d3.group(data.results, (r) => r.s);
  const resultAt = (s, c, seed) => found.get(`${s}:${c}:${seed}`);
  const structureOf = (c) => data.cases[c].structure;
  const mean = (values) => d3.mean(values) ?? null; // of what is known

  // Return the cases that are shown, and those of them that count: who holds data back, where one does.
  function gridOf(filter) {
    const cases = d3.range(data.cases.length).filter((c) => filter.scenarios.has(data.cases[c].scenario));
    const held = cases.filter((c) => data.cases[c].counts);
    const counted = held.length ? held : cases;
    const tested = counted.filter((c) => data.cases[c].test);
    const tests = tested.length && tested.length < counted.length ? tested : null;
    return { cases, counted, tests, structures: [...new Set(counted.map(structureOf))], whole: isWhole(filter) };
  }
  // Return the mean over seeds, then over the cases of every structure; what is missing counts as the
  // model that was given.
  function byStructure(s, cases, name) {
    const own = (c) => mean(seeds.map((seed) => (resultAt(s, c, seed) ?? data.cases[c].start)[name]));
    return d3.rollups(cases, (same) => mean(same.map(own)), structureOf).map(([, value]) => value);
  }

  function rowOf(s, grid) {
    const { cases, counted, structures } = grid;
    const place = new Map(cases.map((c, i) => [c, i]));
    const per = Object.fromEntries(FIGURES.map((name) => [name, byStructure(s, counted, name)]));
    const textbook = d3.rollups(counted, (same) => mean(same.map((c) => data.cases[c].textbook_percent)), structureOf).map(([, value]) => value);
    const share = (tell) => mean(per.error_percent.map((e, i) => (e === null || textbook[i] === null ? null : Number(tell(e, textbook[i])))));
    const results = (byStrategy.get(s) ?? []).filter((r) => place.has(r.c));
    const fine = results.filter((r) => r.status === "ok");
    const { name: strategy, yardstick } = data.strategies[s];
    const given = data.board.find((own) => own.strategy === strategy);
    const row = {
      index: s, strategy, yardstick, rank: null, gain_low: null, gain_high: null, gain_drawn: null,
      ...Object.fromEntries(FIGURES.map((name) => [name, mean(per[name])])),
      better_share: share((e, r) => e < r * (1 - data.tie)), worse_share: share((e, r) => e > 1.25 * r),
      gain_tests: grid.tests && mean(byStructure(s, grid.tests, "gain")),
      rigid_modes_lost: d3.sum(fine, (r) => r.lost), negative_eigenvalues: d3.sum(fine, (r) => r.negative),
      parameters: middle(fine, (r) => r.parameters), seconds: middle(fine, (r) => r.seconds), responses_db: middle(fine, (r) => r.responses),
      ...Object.fromEntries(data.blocks.map((block, k) => [`${block}_percent`, middle(fine, (r) => r.rms[k])])),
      ok: fine.length, answered: results.filter((r) => r.answered).length, not_applicable: results.filter((r) => r.status === "not-applicable").length,
      total: cases.length * seeds.length, unphysical: results.some((r) => r.unphysical), better_than: [], worse_than: [],
      gains: cases.map((c) => mean(seeds.map((seed) => (resultAt(s, c, seed) ?? data.cases[c].start).gain))),
      perStructure: per.gain, perSeed: seeds.map((seed) => mean(counted.map((c) => (resultAt(s, c, seed) ?? data.cases[c].start).gain))),
      results, cases, structures,
      stated: fine.filter(({ levels }) => levels?.length),
    };
    // Twins, which may lower a gain, are in the run's own figures alone.
    const own = [...FIGURES, "gain_drawn", "gain_tests", "better_share", "worse_share", "better_than", "worse_than"];
    return grid.whole && given ? { ...row, ...Object.fromEntries(own.map((name) => [name, given[name]])) } : row;
  }
  // Return the share of unseen modes in the central interval of a level that a strategy states, of
  // every job, then means over structures.
  function covered(row, level) {
    const inside = (all) => d3.mean(all, ({ levels }) => d3.mean(levels, (reached) => Number(reached <= level)));
    return mean(d3.rollups(row.stated, inside, ({ c }) => structureOf(c)).map(([, value]) => value));
  }
  // Return the median over cases of the median over seeds.
  function middle(results, value) {
    const valued = results.filter((r) => (value(r) ?? null) !== null);
    return median(d3.rollups(valued, (own) => median(own.map(value)), (r) => r.c).map(([, own]) => own));
  }
  // Sort rows by gain; those that lie no further apart than a tie share a rank, in the order of their
  // names, and yardsticks have none.
  function ranked(rows) {
    const ties = (all) => {
      const sorted = d3.sort(all, (a, b) => b.gain - a.gain);
      const ranks = new Map();
      sorted.forEach((row, k) => ranks.set(row, k && sorted[k - 1].gain - row.gain <= data.tie ? ranks.get(sorted[k - 1]) : k + 1));
      return ranks;
    };
    for (const [row, rank] of ties(rows.filter((row) => !row.yardstick))) row.rank = rank;
    const order = ties(rows);
    rows.sort((a, b) => order.get(a) - order.get(b) || (a.strategy < b.strategy ? -1 : 1));
    return rows.map((row, place) => ({ ...row, place }));
  }

  // Resample values, the same draws for every strategy, and fill the 95 % intervals of their means in.
  function resample(rows, valuesOf, tail) {
    const n = valuesOf(rows[0]).length;
    const random = d3.randomLcg(20260 + n);
    const drawn = Uint16Array.from({ length: n * RESAMPLES }, () => Math.floor(random() * n));
    for (const row of rows) {
      const own = valuesOf(row).map((value) => value / n);
      const means = new Float64Array(RESAMPLES);
      for (let t = 0; t < drawn.length; t += 1) means[Math.floor(t / n)] += own[drawn[t]];
      means.sort();
      [row.gain_low, row.gain_high] = [tail, 1 - tail].map((q) => d3.quantileSorted(means, q));
    }
  }
  // Return what intervals are over: "structures", "seeds" or "" where there are none.
  function intervalKind([first]) {
    return first?.structures.length >= data.statistics.fewest ? "structures" : first && seeds.length > 1 ? "seeds" : "";
  }
  // Fill the 95 % intervals in.
  function intervals(rows, filter) {
    const kind = intervalKind(rows);
    const given = new Map(data.board.map((row) => [row.strategy, row]));
    if (kind && isWhole(filter)) for (const row of rows) ({ gain_low: row.gain_low, gain_high: row.gain_high } = given.get(row.strategy) ?? row);
    else if (kind === "seeds") resample(rows, (row) => row.perSeed, data.statistics.tails[seeds.length]);
    else if (kind === "structures") resample(rows, (row) => row.perStructure, data.statistics.tails[rows[0].structures.length]);
  }
  // Tell whether the cases are those of the whole run; blocks and strategies change no gain.
  function isWhole(filter) {
    return data.scenarios.every((s) => filter.scenarios.has(s));
  }

  // Return the rms error of a strategy in a block of a case, median over seeds; null without a model.
  function errorOf(s, c, k) {
    const value = median(seeds.map((seed) => {
      const result = resultAt(s, c, seed);
      return (result?.status === "ok" ? result.rms[k] : null) ?? Infinity;
    }));
    return Number.isFinite(value) ? value : null;
  }
  // Return the errors out of band of the strategies on the cases that are shown.
  function problems(rows, filter) {
    const error = (s, c) => mean(seeds.map((seed) => (resultAt(s, c, seed) ?? data.cases[c].start).error_percent));
    return gridOf(filter).counted.map((c) => rows.map((row) => error(row.index, c))).filter((errors) => errors.some((e) => e !== null));
  }

  bench.ranking = {
    yardstick: `${data.yardstick === "textbook" ? "textbook" : "nominal"} model`,
    intervals, intervalKind, isWhole, problems, errorOf, covered,
    rows(filter) {
      const grid = gridOf(filter);
      if (!grid.cases.length) return [];
      return ranked(data.strategies.flatMap((_, s) => (filter.strategies.has(s) ? [rowOf(s, grid)] : [])));
    },
    // Return the filter that lets everything through.
    everything: () => ({ scenarios: new Set(data.scenarios), blocks: data.blocks.map((_, k) => k), strategies: new Set(data.strategies.map((_, s) => s)) }),
  };
}
