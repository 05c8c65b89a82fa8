// What stands below the leaderboard: performance profiles, accuracy against cost, groups.
{
  const { el, svg, data } = bench;
  const MOST_CURVES = 8;
  const MOST_RANKED = 60;
  const FARTHEST = 1000;

  // Return the share of problems within a factor of the best, strategy by strategy.
  function profile(rows, filter) {
    const shown = rows.slice(0, MOST_CURVES);
    const nominal = rows.find((row) => row.strategy === data.baseline);
    if (nominal && !shown.includes(nominal)) shown.splice(-1, 1, nominal);
    const problems = bench.ranking.problems(rows, filter);
    if (!problems.length) return null;
    const offset = data.offset_percent;
    const ratios = rows.map((_, k) =>
      problems.map(({ errors }) => {
        const best = Math.min(...errors.filter((e) => e !== null));
        return errors[k] === null ? Infinity : (errors[k] + offset) / (best + offset);
      }).sort((a, b) => a - b),
    );
    const finite = ratios.flat().filter(Number.isFinite);
    const most = Math.max(...finite, 2);
    const decade = 10 ** Math.floor(Math.log10(most));
    const end = Math.min(FARTHEST, [1, 2, 5, 10].map((k) => k * decade).find((v) => v >= most));
    const series = shown.map((row) => {
      const own = ratios[rows.indexOf(row)];
      const [x, y] = [[], []];
      const push = (tau, count) => void (x.push(tau), y.push(count / own.length));
      if (!(own[0] <= 1 + 1e-9)) push(1, 0);
      own.forEach((tau, i) => {
        if (tau <= end && !(own[i + 1] <= tau * (1 + 1e-9))) push(tau, i + 1);
      });
      if (x[x.length - 1] < end) push(end, own.filter((tau) => tau <= end).length);
      return { label: row.strategy, x, y, role: row.strategy === data.baseline ? "nominal" : "other" };
    });
    const left = rows.length > shown.length ? ` Shown: the ${shown.length - (nominal && rows.indexOf(nominal) >= MOST_CURVES ? 1 : 0)} best${nominal ? " and the nominal model" : ""}; filter the strategies to see others.` : "";
    return bench.charts.profile({
      title: "Performance profiles",
      note: `How often is a strategy within a factor τ of the best one? ${bench.plural(problems.length, "problem")}, one a case and block; errors with ${offset} % added as in the score. Left edge: how often it is the best; high and left is good.${left}`,
      xLabel: "factor τ of the best rms error",
      yLabel: "share of problems",
      xRange: [1, end],
      series,
      height: 360,
    });
  }

  function cost(rows) {
    const found = rows.filter((row) => row.ok && row.seconds > 0);
    if (!found.length) return null;
    const series = [["physical", false, 2], ["unphysical", true, 1]].map(([label, unphysical, style]) => {
      const own = found.filter((row) => row.unphysical === unphysical);
      return { label, style, x: own.map((r) => r.seconds), y: own.map((r) => 1 - r.skill), names: own.map((r) => r.strategy) };
    });
    return bench.charts.scatter({
      title: "Accuracy against cost",
      note: "What is left of the error (1 - skill; 1 = the textbook model) against wall time, median over the cases. Low and left is good.",
      xLabel: "wall time in s", yLabel: "error left",
      logX: true, logY: true, height: 360,
      lines: [{ y: 1, label: "textbook model" }],
      series: series.filter((s) => s.x.length),
    });
  }

  // Return the groups without a difference shown; the n-th has the n-th letter.
  function groups() {
    return (data.statistics && data.statistics.groups) || [];
  }

  // Return the mean rank of every strategy over the structures by its score, equal scores share ranks.
  function meanRanks() {
    const rows = bench.ranking.rows(bench.ranking.everything());
    if (!rows.length) return [];
    const cases = rows[0].structures.length;
    const totals = new Map(rows.map((row) => [row.index, 0]));
    for (let c = 0; c < cases; c += 1) {
      const values = rows.map((row) => bench.median(row.perStructure.map((l) => l[c])));
      rows.forEach((row, k) => {
        const below = values.filter((v) => v < values[k] - data.tie).length;
        const same = values.filter((v) => Math.abs(v - values[k]) <= data.tie).length;
        totals.set(row.index, totals.get(row.index) + below + (same + 1) / 2);
      });
    }
    return [...totals].map(([s, total]) => ({ s, rank: total / cases })).sort((a, b) => a.rank - b.rank || a.s - b.s);
  }

  function sentence() {
    const { note, pairs } = data.statistics;
    const apart = (pairs || []).filter(([, , p]) => p < 0.05).length;
    return [note, pairs && pairs.length ? `${apart} of ${bench.plural(pairs.length, "pair")} differ.` : ""].filter(Boolean).join(" ");
  }

  // Draw mean ranks with a bar for every group, as a critical-difference diagram turned by 90 degrees.
  function rankChart(width) {
    const ranks = meanRanks().slice(0, MOST_RANKED);
    const bars = groups();
    const place = new Map(ranks.map((item, k) => [item.s, k]));
    const names = Math.min(190, width * 0.36);
    const column = Math.max(10, Math.min(22, (width * 0.3) / Math.max(bars.length, 1)));
    const shown = bars.slice(0, Math.floor((width * 0.3) / column));
    const [row, top] = [22, 26];
    const right = width - shown.length * column - 16;
    const height = top + ranks.length * row + 40;
    const last = Math.max(...ranks.map((item) => item.rank), 2);
    const x = (rank) => names + 14 + ((rank - 1) / (last - 1)) * (right - names - 30);
    const y = (k) => top + k * row + row / 2;
    const node = svg("svg", { viewBox: `0 0 ${width} ${height}`, width, height, class: "canvas", "aria-hidden": "true" });
    const step = [1, 2, 5, 10, 20, 50, 100, 200].find((s) => last / s <= (right - names) / 40) || 500;
    const ticks = [1];
    for (let t = step > 1 ? step : 2; t <= last; t += step) if (t - 1 > step / 2) ticks.push(t);
    for (const t of ticks)
      node.append(
        svg("line", { class: "grid", x1: x(t), x2: x(t), y1: top, y2: height - 36 }),
        svg("text", { class: "tick mid", x: x(t), y: height - 22 }, t),
      );
    node.append(svg("text", { class: "name mid", x: (names + right) / 2, y: height - 5 }, "mean rank over the structures (1 is best)"));
    ranks.forEach((item, k) => {
      const name = bench.shortened(data.strategies[item.s].name, Math.floor(names / 6.6));
      node.append(
        svg("line", { class: "grid", x1: names + 6, x2: width - 10, y1: y(k), y2: y(k) }),
        svg("text", { class: "label end", x: names, y: y(k) + 4 }, name),
        bench.marker(bench.palette.style(0), x(item.rank), y(k), 4.5),
      );
    });
    shown.forEach((group, g) => {
      const at = group.map((s) => place.get(s)).filter((k) => k !== undefined).sort((a, b) => a - b);
      if (!at.length) return;
      const cx = right + 10 + g * column + column / 2;
      node.append(svg("text", { class: "label mid", x: cx, y: top - 10 }, bench.letter(g)));
      node.append(svg("line", { class: "bar", x1: cx, x2: cx, y1: y(at[0]) - 5, y2: y(at[at.length - 1]) + 5 }));
      for (const k of at) node.append(svg("circle", { class: "member", cx, cy: y(k), r: 4.5 }));
    });
    return node;
  }

  function comparison() {
    if (!data.statistics) return null;
    const plot = el("div", { class: "plot" });
    let width = 0;
    const redraw = (room) => {
      if (!room || Math.abs(room - width) < 2) return;
      width = room;
      plot.replaceChildren(rankChart(width));
    };
    if (data.strategies.length > 1) {
      redraw(640);
      new ResizeObserver((entries) => redraw(Math.floor(entries[0].contentRect.width))).observe(plot);
    }
    const ranked = meanRanks();
    const listed = groups().map((group, g) => {
      const names = ranked.filter((item) => group.includes(item.s)).map((item) => data.strategies[item.s].name);
      return el("li", {}, el("b", {}, `${bench.letter(g)}: `), names.join(", "));
    });
    const means = ranked.map((item) => el("li", {}, `${data.strategies[item.s].name}: ${item.rank.toFixed(2)}`));
    return el("figure", { class: "chart wide" },
      el("figcaption", {}, el("strong", {}, "Which strategies differ by more than chance"), el("span", {}, sentence()),
        listed.length ? el("span", {}, "A bar joins strategies without a difference shown; its dots are the members. Ranks are by score alone, and for the whole run whatever the filter.", ranked.length > MOST_RANKED ? ` Drawn: the first ${MOST_RANKED} of ${ranked.length}.` : "") : null,
        listed.length ? el("details", { class: "numbers" }, el("summary", {}, "Groups in words"), el("ul", { class: "groups" }, listed)) : null,
        means.length ? el("details", { class: "numbers" }, el("summary", {}, "Mean ranks"), el("ol", { class: "groups" }, means)) : null),
      plot);
  }

  let whole = null;
  bench.overview = {
    groups,
    // Return the tier of every strategy by its index, null where nothing was tested.
    tiers() {
      const found = data.strategies.map(() => null);
      ((data.statistics && data.statistics.tiers) || []).forEach((tier, t) => tier.forEach((s) => (found[s] = t + 1)));
      return found;
    },
    // Return the letters of every strategy, by its index.
    letters() {
      const found = data.strategies.map(() => "");
      groups().forEach((group, g) => group.forEach((s) => (found[s] += (found[s] ? " " : "") + bench.letter(g))));
      return found;
    },
    // Return the figures for the rows of a filtered board, as a list of elements.
    figures(rows, filter) {
      whole = whole || comparison();
      return [profile(rows, filter), cost(rows), whole].filter(Boolean);
    },
  };
}
