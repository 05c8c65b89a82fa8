// Scores, gains and ranks of any part of a run, by the rules of docs/scoring.md. Without a filter the
// figures are those of the run's own leaderboard.
{
  const RESAMPLES = 1999;
  const { data, median } = bench;
  const seeds = d3.sort(new Set([...data.seeds, ...data.results.map((r) => r.seed)]));
  const found = new Map(data.results.map((r) => [`${r.s}:${r.c}:${r.seed}`, r]));
  const [byStrategy, byCase] = [d3.group(data.results, (r) => r.s), d3.group(data.results, (r) => r.c)];
  const baseline = data.strategies.findIndex((s) => s.name === data.baseline);
  const has = (reference) => Object.keys(reference).length > 0;
  const scored = data.cases.some((c) => has(c.reference));
  const resultAt = (s, c, seed) => found.get(`${s}:${c}:${seed}`);
  const structureOf = (c) => data.cases[c].structure;

  // Return what a result is measured against in a block.
  const referenceOf = ({ c, seed }, k) => (scored ? data.cases[c].reference[data.blocks[k]] : resultAt(baseline, c, seed)?.rms[k]) ?? null;

  // Return the logarithm of the score in a block; without one, of the score that the result came with.
  function logScore(result, k) {
    const failure = Math.log(data.score_of_failure);
    const idle = result?.status === "not-applicable";
    if (idle && result.start.every((error) => error === null)) return 0;
    if (!idle && result?.status !== "ok") return failure;
    if (k === null) return result.score === null ? failure : Math.log(result.score);
    const [rms, reference] = [(idle ? result.start : result.rms)[k], referenceOf(result, k)];
    return rms === null || reference === null ? failure : Math.log((rms + data.offset_percent) / (reference + data.offset_percent));
  }

  // Return the cases that are shown and the units that count: blocks of cases with their weights. Unseen
  // data count where there are any; what several cases of a structure share counts once.
  function gridOf(filter) {
    const whole = isWhole(filter);
    const shown = d3.range(data.cases.length).map((c) => {
      const { reference, scenario } = data.cases[c];
      const [own, known] = [byCase.get(c) ?? [], has(reference)];
      const there = filter.blocks.filter((k) => (known ? data.blocks[k] in reference : own.some((r) => r.rms[k] !== null)));
      return filter.scenarios.has(scenario) && (own.length || known) && (there.length || whole) ? { c, known, there: known || !whole ? there : [null] } : null;
    }).filter(Boolean);
    const unseen = (listed) => (listed.some(({ k }) => data.blocks[k] !== "used") ? listed.filter(({ k }) => data.blocks[k] !== "used") : listed);
    const unitsOf = (wanted) => unseen(shown.flatMap(({ c, known, there }) => (known === wanted ? there.map((k) => ({ c, k, weight: 1 })) : [])));
    const counted = unitsOf(true);
    const shared = ({ c, k }) => `${structureOf(c)}:${k}:${data.cases[c].reference[data.blocks[k]].toPrecision(9)}`;
    for (const [, same] of d3.group(counted, shared)) for (const unit of same) unit.weight = 1 / same.length;
    const units = [...counted, ...unitsOf(false)];
    const structures = [...new Set(units.map((unit) => structureOf(unit.c)))];
    for (const unit of units) unit.structure = structures.indexOf(structureOf(unit.c));
    const cases = shown.map(({ c }) => c);
    const tested = new Set(cases.filter((c) => data.cases[c].test));
    return { cases, blocks: filter.blocks, units, structures, whole, tests: tested.size && tested.size < cases.length ? tested : null };
  }

  // Return the weighted mean of values by group; null where a group has none.
  function means(values, units, group, count, weight = (unit) => unit.weight) {
    const [sums, weights] = [new Float64Array(count), new Float64Array(count)];
    units.forEach((unit, i) => {
      sums[group(unit)] += weight(unit) * values[i];
      weights[group(unit)] += weight(unit);
    });
    return Array.from(sums, (sum, i) => (weights[i] ? sum / weights[i] : null));
  }
  const gainOf = (logs) => 1 - Math.exp(d3.mean(logs));

  function rowOf(s, grid) {
    const { cases, structures, units, blocks } = grid;
    const place = new Map(cases.map((c, i) => [c, i]));
    const logs = seeds.map((seed) => units.map(({ c, k }) => logScore(resultAt(s, c, seed), k)));
    const structured = (weight) => logs.map((own) => means(own, units, (unit) => unit.structure, structures.length, weight));
    const perStructure = structured();
    const gains = perStructure.map(gainOf);
    const tests = grid.tests && structured((unit) => (grid.tests.has(unit.c) ? unit.weight : 0)).map(gainOf);
    const results = (byStrategy.get(s) ?? []).filter((r) => place.has(r.c));
    const fine = results.filter((r) => r.status === "ok");
    const strategy = data.strategies[s].name;
    const forecasts = fine.flatMap((r) => blocks.flatMap((k) => (r.forecast[k] ? [{ c: r.c, ...r.forecast[k] }] : [])));
    const row = {
      index: s, strategy, rank: 0, gain: median(gains), gain_low: null, gain_high: null,
      gain_drawn: (grid.whole && data.board.find((own) => own.strategy === strategy)?.gain_drawn) ?? null,
      gain_tests: tests && Number.isFinite(tests[0]) ? median(tests) : null,
      rigid_modes_lost: d3.sum(fine, (r) => r.lost), negative_eigenvalues: d3.sum(fine, (r) => r.negative),
      parameters: middle(fine, (r) => r.parameters), seconds: middle(fine, (r) => r.seconds),
      ...Object.fromEntries(data.blocks.map((block, k) => [`${block}_percent`, middle(fine, (r) => r.rms[k])])),
      ok: fine.length, not_applicable: results.filter((r) => r.status === "not-applicable").length,
      total: cases.length * seeds.length, unphysical: results.some((r) => r.unphysical),
      logs: logs.map((own) => means(own, units, (unit) => place.get(unit.c), cases.length)),
      perStructure, gains, results, cases, structures,
      stated: forecasts.filter(({ levels }) => levels), crps_percent: byStructure(forecasts, ({ crps }) => crps),
    };
    return { ...row, coverage90: covered(row, 0.9) };
  }
  // Return the mean over the modes of every structure, then over structures; null without any.
  function byStructure(forecasts, total) {
    const own = d3.rollups(forecasts, (all) => d3.sum(all, total) / d3.sum(all, ({ modes }) => modes), ({ c }) => structureOf(c));
    return own.length ? d3.mean(own, ([, mean]) => mean) : null;
  }
  // Return the share of unseen modes in the central interval of a level that a strategy states.
  function covered(row, level) {
    return byStructure(row.stated, ({ levels }) => levels.filter((reached) => reached <= level).length);
  }
  // Return the median over cases of the median over seeds.
  function middle(results, value) {
    const valued = results.filter((r) => (value(r) ?? null) !== null);
    return median(d3.rollups(valued, (own) => median(own.map(value)), (r) => r.c).map(([, own]) => own));
  }
  // Put physical strategies first, then unphysical ones, then who never gave a model; those whose sorted
  // gains lie no further apart than a tie share a rank, in the order of their names.
  function ranked(rows) {
    const level = (r) => (r.ok + r.not_applicable === 0 ? 2 : 0) + (r.unphysical ? 1 : 0);
    rows.sort((a, b) => level(a) - level(b) || b.gain - a.gain);
    rows.forEach((row, k) => {
      const before = rows[k - 1];
      const tied = before && level(row) === level(before) && before.gain - row.gain <= data.tie * (1 - row.gain);
      row.rank = tied ? before.rank : k + 1;
    });
    return rows.sort((a, b) => a.rank - b.rank || (a.strategy < b.strategy ? -1 : 1));
  }

  // Draw resamples of structures, the same for every strategy, each with all its cases and seeds.
  function overStructures(rows) {
    const n = rows[0].structures.length;
    const random = d3.randomLcg(20260 + n);
    const drawn = Uint16Array.from({ length: n * RESAMPLES }, () => Math.floor(random() * n));
    for (const row of rows) {
      const own = row.structures.map((_, i) => d3.mean(row.perStructure, (logs) => logs[i]) / n);
      const left = new Float64Array(RESAMPLES);
      for (let t = 0; t < drawn.length; t += 1) left[Math.floor(t / n)] += own[drawn[t]];
      const tail = data.statistics.tails[n];
      [row.gain_low, row.gain_high] = ends(left, [1 - tail, tail]).map((log) => 1 - Math.exp(log));
    }
  }
  function overSeeds(rows) {
    for (const row of rows) {
      const random = d3.randomLcg(20260 + row.index);
      const drawn = Float64Array.from({ length: RESAMPLES }, () => median(row.gains.map(() => row.gains[Math.floor(random() * row.gains.length)])));
      [row.gain_low, row.gain_high] = ends(drawn, [0.025, 0.975]);
    }
  }
  const ends = (drawn, tails) => tails.map((q) => d3.quantileSorted(drawn.sort(), q));
  // Return what intervals are over: "structures", "seeds" or "" where there are none.
  function intervalKind([first]) {
    return first?.structures.length >= data.statistics.fewest ? "structures" : first && seeds.length > 1 ? "seeds" : "";
  }
  // Fill the 95 % intervals in.
  function intervals(rows, filter) {
    const kind = intervalKind(rows);
    const given = new Map(data.board.map((row) => [row.strategy, row]));
    if (kind && isWhole(filter)) for (const row of rows) ({ gain_low: row.gain_low, gain_high: row.gain_high } = given.get(row.strategy) ?? row);
    else if (kind === "seeds") overSeeds(rows);
    else if (kind === "structures") overStructures(rows);
  }
  // Tell whether cases and blocks are those of the whole run; the strategies change no figure.
  function isWhole(filter) {
    return filter.blocks.length === data.blocks.length && data.scenarios.every((s) => filter.scenarios.has(s));
  }

  // Return the rms error of a strategy in a block of a case, median over seeds; null without a model.
  // "Not applicable" leaves the error of the model that was given.
  function errorOf(s, c, k) {
    const value = median(seeds.map((seed) => {
      const result = resultAt(s, c, seed);
      return (result?.status === "not-applicable" ? (result.start[k] ?? referenceOf(result, k)) : result?.status === "ok" ? result.rms[k] : null) ?? Infinity;
    }));
    return Number.isFinite(value) ? value : null;
  }
  // Return the errors of the strategies in every block of unseen data of the cases that are shown.
  function problems(rows, filter) {
    const hidden = filter.blocks.filter((k) => data.blocks[k] !== "used");
    const all = d3.cross(gridOf(filter).cases, hidden.length ? hidden : filter.blocks);
    return all.map(([c, k]) => rows.map((row) => errorOf(row.index, c, k))).filter((errors) => errors.some((e) => e !== null));
  }

  bench.ranking = {
    yardstick: `${data.yardstick === "textbook" ? "textbook" : "nominal"} model`,
    intervals, intervalKind, isWhole, problems, errorOf, covered,
    rows(filter) {
      const grid = gridOf(filter);
      if (!grid.units.length) return [];
      return ranked(data.strategies.flatMap((_, s) => (filter.strategies.has(s) ? [rowOf(s, grid)] : [])));
    },
    // Return the filter that lets everything through.
    everything: () => ({ scenarios: new Set(data.scenarios), blocks: data.blocks.map((_, k) => k), strategies: new Set(data.strategies.map((_, s) => s)) }),
  };
}
