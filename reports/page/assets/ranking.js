// Scores, skills and ranks of any part of a run, by the rules of docs/scoring.md. Without a filter the
// figures are those of the run's own leaderboard.
{
  const RESAMPLES = 1999;
  const { data, median } = bench;
  const all = data && data.results ? prepare() : null;

  function prepare() {
    const seeds = [...new Set([...(data.seeds || []), ...data.results.map((r) => r.seed)])].sort((a, b) => a - b);
    const found = new Map(data.results.map((r) => [`${r.s}:${r.c}:${r.seed}`, r]));
    const perStrategy = data.strategies.map(() => []);
    const perCase = data.cases.map(() => []);
    for (const result of data.results) {
      perStrategy[result.s].push(result);
      perCase[result.c].push(result);
    }
    const scored = data.cases.some((c) => has(c.reference));
    const baseline = data.strategies.findIndex((s) => s.name === data.baseline);
    return { seeds, found, perStrategy, perCase, scored, baseline };
  }
  function has(reference) {
    return Boolean(reference) && Object.keys(reference).length > 0;
  }
  function resultAt(s, c, seed) {
    return all.found.get(`${s}:${c}:${seed}`) || null;
  }

  // Return what a result is measured against, block by block; null where a block is not there.
  function referenceOf(result) {
    const { reference } = data.cases[result.c];
    if (all.scored) return data.blocks.map((b) => (reference && b in reference ? reference[b] : null));
    const base = all.baseline < 0 ? null : resultAt(all.baseline, result.c, result.seed);
    return base ? base.rms : data.blocks.map(() => null);
  }

  // Return the logarithm of the score in a block; without one, of the score that the result came with.
  function logScore(result, k) {
    const failure = Math.log(data.score_of_failure);
    if (!result) return failure;
    if (result.status === "not-applicable") return 0;
    if (result.status !== "ok") return failure;
    if (k === null) return result.score === null || result.score === undefined ? failure : Math.log(result.score);
    const reference = referenceOf(result)[k];
    const rms = result.rms[k];
    return rms === null || reference === null ? failure : Math.log((rms + data.offset_percent) / (reference + data.offset_percent));
  }

  // Return the cases that are shown and the units that count: blocks of cases with their weights. Unseen
  // data count where there are any; what several cases of a structure share counts once.
  function gridOf(filter) {
    const whole = isWhole(filter);
    const [cases, units, open] = [[], [], []];
    data.cases.forEach((item, c) => {
      const own = all.perCase[c];
      if (!filter.scenarios.has(item.scenario) || !(own.length || has(item.reference))) return;
      const there = filter.blocks.filter((k) => (has(item.reference) ? data.blocks[k] in item.reference : own.some((r) => r.rms[k] !== null)));
      if (!there.length && !whole) return;
      cases.push(c);
      if (has(item.reference)) for (const k of there) units.push({ c, k, data: `${item.structure}:${k}:${item.reference[data.blocks[k]].toPrecision(9)}` });
      else if (whole) open.push({ c, k: null, weight: 1 });
      else for (const k of there) open.push({ c, k, weight: 1 });
    });
    const unseen = (unit) => data.blocks[unit.k] !== "used";
    const counted = units.some(unseen) ? units.filter(unseen) : units;
    const often = new Map();
    for (const unit of counted) often.set(unit.data, (often.get(unit.data) || 0) + 1);
    for (const unit of counted) unit.weight = 1 / often.get(unit.data);
    const kept = [...counted, ...open.filter((unit) => unit.k === null || !open.some(unseen) || unseen(unit))];
    const structures = [...new Set(kept.map((unit) => data.cases[unit.c].structure))];
    for (const unit of kept) unit.structure = structures.indexOf(data.cases[unit.c].structure);
    const tested = cases.filter((c) => data.cases[c].test);
    const tests = tested.length && tested.length < cases.length ? new Set(tested) : null;
    return { cases, blocks: filter.blocks, units: kept, structures, seeds: all.seeds, whole, tests };
  }

  // Return the weighted mean of values by group; null where a group has none.
  function means(values, units, group, count) {
    const [sums, weights] = [new Float64Array(count), new Float64Array(count)];
    units.forEach((unit, i) => {
      sums[group(unit)] += unit.weight * values[i];
      weights[group(unit)] += unit.weight;
    });
    return [...sums].map((sum, i) => (weights[i] ? sum / weights[i] : null));
  }
  // Return the means of the structures over their tests alone.
  function testsOf(values, grid) {
    const kept = grid.units.map((unit) => (grid.tests.has(unit.c) ? unit : { ...unit, weight: 0 }));
    return means(values, kept, (unit) => unit.structure, grid.structures.length).filter((mean) => mean !== null);
  }
  function skillOf(logs) {
    return logs.length ? 1 - Math.exp(logs.reduce((total, v) => total + v, 0) / logs.length) : null;
  }

  function rowOf(s, grid, kept) {
    const found = grid.seeds.map((seed) => grid.units.map(({ c, k }) => logScore(resultAt(s, c, seed), k)));
    const place = new Map(grid.cases.map((c, i) => [c, i]));
    const logs = found.map((own) => means(own, grid.units, (unit) => place.get(unit.c), grid.cases.length));
    const perStructure = found.map((own) => means(own, grid.units, (unit) => unit.structure, grid.structures.length));
    const skills = perStructure.map(skillOf);
    const onTests = grid.tests && found.map((own) => testsOf(own, grid)).map(skillOf);
    const results = all.perStrategy[s].filter((r) => kept.has(r.c));
    const fine = results.filter((r) => r.status === "ok");
    const name = data.strategies[s].name;
    const given = grid.whole ? data.board.find((row) => row.strategy === name) : null;
    const row = {
      index: s, strategy: name, rank: 0, skill: median(skills), skill_low: null, skill_high: null,
      skill_drawn: given ? given.skill_drawn : null, skill_tests: onTests && onTests[0] !== null ? median(onTests) : null,
      rigid_modes_lost: sum(fine, "lost"), negative_eigenvalues: sum(fine, "negative"),
      parameters: middle(fine, (r) => r.parameters), evaluations: middle(fine, (r) => r.evaluations),
      seconds: middle(fine, (r) => r.seconds), ok: fine.length,
      not_applicable: results.filter((r) => r.status === "not-applicable").length,
      total: grid.cases.length * grid.seeds.length, unphysical: results.some((r) => r.unphysical),
      logs, perStructure, skills, results, cases: grid.cases, structures: grid.structures,
    };
    data.blocks.forEach((b, k) => (row[`${b}_percent`] = middle(fine, (r) => r.rms[k])));
    const forecasts = fine.flatMap((r) => grid.blocks.filter((k) => r.forecast[k]).map((k) => [r.c, ...r.forecast[k]]));
    row.crps_percent = byStructure(forecasts, ([, modes, , crps]) => [modes, crps]);
    row.coverage90 = byStructure(forecasts.filter(([, , covered]) => covered !== null), ([, modes, covered]) => [modes, covered]);
    return row;
  }
  // Return the mean over the modes of every structure, then over structures; null without any.
  function byStructure(forecasts, parts) {
    const sums = new Map();
    for (const item of forecasts) {
      const { structure } = data.cases[item[0]];
      const [modes, total] = parts(item);
      const before = sums.get(structure) || [0, 0];
      sums.set(structure, [before[0] + modes, before[1] + total]);
    }
    const means = [...sums.values()].map(([modes, total]) => total / modes);
    return means.length ? means.reduce((a, b) => a + b, 0) / means.length : null;
  }
  function sum(results, key) {
    return results.reduce((total, r) => total + (r[key] || 0), 0);
  }
  // Return the median over cases of the median over seeds.
  function middle(results, value) {
    const byCase = new Map();
    for (const r of results) {
      const v = value(r);
      if (v === null || v === undefined) continue;
      if (!byCase.has(r.c)) byCase.set(r.c, []);
      byCase.get(r.c).push(v);
    }
    return median([...byCase.values()].map(median));
  }
  // Put physical strategies first, then unphysical ones, then who never gave a model; those whose sorted
  // skills lie no further apart than a tie share a rank, in the order of their names.
  function ranked(rows) {
    const tier = (r) => (r.ok + r.not_applicable === 0 ? 2 : 0) + (r.unphysical ? 1 : 0);
    rows.sort((a, b) => tier(a) - tier(b) || b.skill - a.skill);
    rows.forEach((row, k) => {
      const before = rows[k - 1];
      const tied = before && tier(row) === tier(before) && before.skill - row.skill <= data.tie * (1 - row.skill);
      row.rank = tied ? before.rank : k + 1;
    });
    return rows.sort((a, b) => a.rank - b.rank || (a.strategy < b.strategy ? -1 : 1));
  }

  function rowsOf(filter) {
    const grid = gridOf(filter);
    const kept = new Set(grid.cases);
    const rows = data.strategies.map((_, s) => s).filter((s) => filter.strategies.has(s)).map((s) => rowOf(s, grid, kept));
    if (!grid.units.length) return [];
    return ranked(rows);
  }

  function generator(seed) {
    let a = seed >>> 0;
    return () => {
      a = (a + 0x6d2b79f5) | 0;
      let t = Math.imul(a ^ (a >>> 15), 1 | a);
      t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
      return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
    };
  }
  function quantile(sorted, q) {
    const at = q * (sorted.length - 1);
    const low = Math.floor(at);
    return sorted[low] + (at - low) * ((sorted[low + 1] ?? sorted[low]) - sorted[low]);
  }
  // Draw `times` resamples of n things: how often each is drawn; the same for every strategy.
  function draws(n, times) {
    const random = generator(20260 + n);
    const counts = new Float64Array(n * times);
    for (let t = 0; t < times; t += 1) for (let i = 0; i < n; i += 1) counts[t * n + Math.floor(random() * n)] += 1;
    return counts;
  }
  // Resample structures, each with all its cases and seeds.
  function overStructures(rows) {
    const n = rows[0].structures.length;
    const counts = draws(n, RESAMPLES);
    const tail = data.statistics.tails[n];
    const found = new Float64Array(RESAMPLES);
    for (const row of rows) {
      const means = row.structures.map((_, i) => row.perStructure.reduce((total, logs) => total + logs[i], 0) / row.perStructure.length);
      for (let t = 0; t < RESAMPLES; t += 1) {
        let top = 0;
        for (let i = 0; i < n; i += 1) top += counts[t * n + i] * means[i];
        found[t] = top / n;
      }
      found.sort();
      [row.skill_low, row.skill_high] = [1 - Math.exp(quantile(found, 1 - tail)), 1 - Math.exp(quantile(found, tail))];
    }
  }
  function overSeeds(rows) {
    const n = rows[0].skills.length;
    for (const row of rows) {
      const random = generator(20260 + row.index);
      const found = Float64Array.from({ length: RESAMPLES }, () => median(row.skills.map(() => row.skills[Math.floor(random() * n)])));
      found.sort();
      [row.skill_low, row.skill_high] = [quantile(found, 0.025), quantile(found, 0.975)];
    }
  }

  // Fill the 95 % intervals in; returns what they are over: "structures", "seeds" or "" for none.
  function fillIntervals(rows, filter) {
    if (!rows.length) return "";
    const kind = intervalKind(rows);
    if (kind && isWhole(filter)) {
      const given = new Map(data.board.map((row) => [row.strategy, row]));
      for (const row of rows) ({ skill_low: row.skill_low, skill_high: row.skill_high } = given.get(row.strategy) || row);
    } else if (kind === "seeds") overSeeds(rows);
    else if (kind === "structures") overStructures(rows);
    return kind;
  }
  function intervalKind(rows) {
    if (!rows.length) return "";
    if (rows[0].structures.length >= data.statistics.fewest) return "structures";
    return rows[0].skills.length > 1 ? "seeds" : "";
  }
  // Tell whether cases and blocks are those of the whole run; the strategies change no figure.
  function isWhole(filter) {
    return filter.blocks.length === data.blocks.length && data.scenarios.every((s) => filter.scenarios.has(s));
  }

  // Return what differs from the run's own leaderboard by more than 1e-9 (rounded figures: 1e-3).
  function check() {
    const mine = new Map(rowsOf(bench.ranking.everything()).map((row) => [row.strategy, row]));
    const exact = ["rank", "skill", "skill_tests", "rigid_modes_lost", "negative_eigenvalues", "ok", "not_applicable", "total"];
    const errors = data.blocks.map((b) => `${b}_percent`);
    return data.board.flatMap((row) =>
      [...exact, ...errors, "coverage90", "crps_percent", "parameters", "evaluations", "seconds"].flatMap((key) => {
        const [a, b] = [row[key] ?? null, (mine.get(row.strategy) || {})[key] ?? null];
        const room = key === "seconds" ? 1e-3 : 1e-9;
        const same = a === b || (a !== null && b !== null && Math.abs(a - b) <= room * Math.max(1, Math.abs(a)));
        return same ? [] : [`${row.strategy}: ${key} is ${b}, the run says ${a}`];
      }),
    );
  }

  // Return every (case, block) with the rms error of each strategy, median over seeds: what a strategy
  // without model leaves open is null, and "not applicable" leaves the nominal error.
  function problems(rows, filter) {
    const hidden = filter.blocks.filter((k) => data.blocks[k] !== "used");
    return gridOf(filter).cases.flatMap((c) =>
      (hidden.length ? hidden : filter.blocks).map((b) => ({ c, b, errors: rows.map((row) => errorOf(row.index, c, b)) })).filter((p) => p.errors.some((e) => e !== null)),
    );
  }
  function errorOf(s, c, b) {
    const values = all.seeds.map((seed) => {
      const result = resultAt(s, c, seed);
      if (!result) return Infinity;
      const v = result.status === "not-applicable" ? referenceOf(result)[b] : result.status === "ok" ? result.rms[b] : null;
      return v === null || v === undefined ? Infinity : v;
    });
    const value = median(values);
    return Number.isFinite(value) ? value : null;
  }

  bench.ranking = {
    rows: rowsOf,
    intervals: fillIntervals,
    intervalKind,
    isWhole,
    problems,
    check,
    // Return the filter that lets everything through.
    everything: () => ({
      scenarios: new Set(data.scenarios),
      blocks: data.blocks.map((_, k) => k),
      strategies: new Set(data.strategies.map((_, s) => s)),
    }),
  };
}
