/* Tables of the case page: frequencies as the papers print them, parameters with uncertainty. */
{
  const GROUPS = {
    used: "Used: given to the strategies",
    higher: "Held out: higher modes, seen by the score alone",
    modified: "Held out: with the design change",
  };
  const FIRST = 12; // parameters shown before the rest is folded away

  const signed = (value, digits = 2) => `${value < 0 ? "\u2212" : "+"}${Math.abs(value).toFixed(digits)}`;
  const keyOf = (mode) => `${mode.block}|${mode.modification ?? ""}|${mode.mode}`;

  /** Return every measured mode that some strategy was compared with, in order. */
  const measuredModes = (columns) => {
    const found = new Map();
    for (const column of columns) for (const mode of column.detail.modes) if (!found.has(keyOf(mode))) found.set(keyOf(mode), mode);
    return [...found.values()];
  };

  const errorOf = (mode) => (mode.predicted_hz === null || mode.predicted_hz <= 0 ? null : 100 * (mode.predicted_hz / mode.measured_hz - 1));

  const cell = (mode, options) => {
    const { el } = bench;
    if (!mode) return el("td", { class: "num" }, "\u2013");
    const missing = mode.predicted_hz === null;
    const lines = [missing ? el("span", { class: "case-none" }, "none") : bench.hertz(mode.predicted_hz)];
    const error = errorOf(mode);
    if (options.errors && error !== null) lines.push(el("span", { class: "case-under" }, `${signed(error)} %`));
    if (options.mac && mode.mac !== null) lines.push(el("span", { class: "case-under" }, `MAC ${mode.mac.toFixed(3)}`));
    return el("td", { class: "num" }, lines);
  };

  const printed = (value, measured, options) => {
    const { el } = bench;
    if (value === undefined || value === null) return el("td", { class: "num case-printed" }, "\u2013");
    const under = options.errors ? el("span", { class: "case-under" }, `${signed(100 * (value / measured - 1))} %`) : null;
    return el("td", { class: "num case-printed" }, bench.hertz(value), under);
  };

  // What an eigenvalue solution leaves of an exact fit says nothing.
  const rms = (value) => (value !== null && value < 0.001 ? "<0.001" : bench.number(value, 3));

  // Return what stands beside a strategy's column: Hz by mode, and where they come from.
  const beside = (papers, column) => papers.map(([named, mark]) => [named[column.name], mark]).filter(([hertz]) => hertz);

  const heads = (columns, papers) => {
    const { el } = bench;
    const pairs = columns.flatMap((column) => {
      const mark = column.mark ? el("span", { class: "case-mark" }, column.mark) : null;
      const own = el("th", { scope: "col", class: "num" }, column.name, mark);
      return [own, ...beside(papers, column).map(([, mark]) => el("th", { scope: "col", class: "num case-printed" }, column.name, el("span", { class: "case-mark" }, mark)))];
    });
    return el("thead", {}, el("tr", {}, el("th", { scope: "col" }, "Mode"), el("th", { scope: "col", class: "num" }, "Measured"), pairs));
  };

  const modeRow = (mode, columns, papers, options) => {
    const { el } = bench;
    const cells = columns.flatMap((column) => {
      const own = cell(column.detail.modes.find((item) => keyOf(item) === keyOf(mode)), options);
      return [own, ...beside(papers, column).map(([hertz]) => printed(mode.modification ? null : hertz[String(mode.mode)], mode.measured_hz, options))];
    });
    return el("tr", {}, el("th", { scope: "row" }, String(mode.mode)), el("td", { class: "num case-measured" }, bench.hertz(mode.measured_hz)), cells);
  };

  const rmsRow = (block, columns, papers) => {
    const { el, data } = bench;
    const at = data.blocks.indexOf(block);
    const cells = columns.flatMap((column) => {
      const own = el("td", { class: "num" }, rms(column.result.rms[at]));
      return [own, ...beside(papers, column).map(() => el("td", { class: "num case-printed" }, ""))];
    });
    return el("tr", { class: "case-sum" }, el("th", { scope: "row", title: "Root mean square of the frequency errors" }, "rms, %"), el("td", { class: "num" }, ""), cells);
  };

  /**
   * Return the table of natural frequencies in Hz.
   *
   * columns: [{name, detail, result, mark}]. papers: [Hz by strategy and mode, where they come from].
   * options: errors, mac: whether they stand under every frequency.
   */
  const frequencies = (columns, papers, options) => {
    const { el, data } = bench;
    const modes = measuredModes(columns);
    const wide = 2 + columns.length + columns.flatMap((column) => beside(papers, column)).length;
    const bodies = data.blocks.flatMap((block) => {
      const own = modes.filter((mode) => mode.block === block);
      const changes = [...new Set(own.map((mode) => mode.modification ?? ""))];
      return changes.map((change, k) => {
        const title = (GROUPS[block] ?? block) + (change ? ` \u201c${change}\u201d` : "");
        const rows = own.filter((mode) => (mode.modification ?? "") === change).map((mode) => modeRow(mode, columns, papers, options));
        const last = k === changes.length - 1 ? rmsRow(block, columns, papers) : null;
        const head = el("th", { scope: "rowgroup", colspan: wide, class: "case-band" }, el("span", {}, title));
        return el("tbody", {}, el("tr", {}, head), rows, last);
      });
    });
    const legend = "In Hz. \u201cnone\u201d: the model has no mode that belongs to the measured one; \u201ci\u201d: imaginary.";
    const table = el("table", { class: "case-table case-frequencies", "aria-label": "Natural frequencies in Hz" }, heads(columns, papers), bodies);
    return el("div", {}, el("p", { class: "case-hint" }, legend), bench.scroll("Natural frequencies", table));
  };

  /** Return a bar from zero to the left or right, with the uncertainty as a thin line. */
  const bar = (change, std, top) => {
    const { svg } = bench;
    const x = (value) => 60 + (58 * Math.min(Math.max(value, -top), top)) / (top || 1);
    const spread = std === null ? null : svg("line", { x1: x(change - std), x2: x(change + std), y1: 8, y2: 8, class: "case-spread" });
    return svg("svg", { viewBox: "0 0 120 16", class: "case-bar", "aria-hidden": "true" },
      svg("rect", { x: Math.min(x(0), x(change)), width: Math.max(Math.abs(x(change) - x(0)), 0.8), y: 3, height: 10, class: change < 0 ? "case-less" : "case-more" }),
      svg("line", { x1: 60, x2: 60, y1: 0, y2: 16, class: "case-zero" }), spread);
  };

  const parameterRow = (item, top, hasStd) => {
    const { el } = bench;
    const value = (number) => bench.number(number, 4);
    const after = hasStd ? `${value(item.after)}${item.std === null || item.std === undefined ? "" : ` \u00b1 ${bench.number(item.std, 2)}`}` : value(item.after);
    const relative = item.change === null ? [el("td", { class: "num" }, "\u2013"), el("td", {}, "")]
      : [el("td", { class: "num" }, `${signed(100 * item.change, 1)} %`), el("td", {}, bar(item.change, item.spread, top))];
    return el("tr", {}, el("th", { scope: "row" }, item.name), el("td", { class: "num" }, value(item.before)), el("td", { class: "num" }, after),
      el("td", {}, item.unit || "ratio"), relative);
  };

  const parameterTable = (items, top, hasStd, name) => {
    const { el } = bench;
    const head = ["Parameter", "Before", hasStd ? "After \u00b1 std" : "After", "Unit", "Change", ""].map((text, k) =>
      text ? el("th", { scope: "col", class: k === 1 || k === 2 || k === 4 ? "num" : null }, text) : el("td", {}, ""));
    return bench.scroll(`Parameters of ${name}`, el("table", { class: "case-table" }, el("thead", {}, el("tr", {}, head)),
      el("tbody", {}, items.map((item) => parameterRow(item, top, hasStd)))));
  };

  /** Return the parameters of a strategy, those that changed most first. */
  const parameters = (name, given) => {
    const { el } = bench;
    if (!given.length) return el("p", {}, `${name} has no parameters with a name.`);
    const items = given.map((item) => ({
      ...item,
      change: item.before ? item.after / item.before - 1 : null,
      spread: item.before && item.std !== null && item.std !== undefined ? Math.abs(item.std / item.before) : null,
    }));
    // What starts at zero has no relative change; where it is a ratio, its value is of the same kind.
    const size = (item) => Math.abs(item.change ?? (item.unit ? Infinity : item.after));
    if (items.length > FIRST) items.sort((a, b) => size(b) - size(a));
    const top = Math.max(...items.map((item) => (item.change === null ? 0 : Math.abs(item.change) + (item.spread ?? 0))), 1e-6);
    const hasStd = items.some((item) => item.spread !== null || (item.std !== null && item.std !== undefined));
    const note = hasStd ? "The thin line is one standard deviation to either side." : "The method gives no uncertainty.";
    const rest = items.slice(FIRST);
    const more = rest.length ? el("details", { ontoggle: () => {
      if (more.children.length < 2) more.append(parameterTable(rest, top, hasStd, `${name}, the rest`));
    } }, el("summary", {}, `The other ${rest.length} parameters`)) : null;
    const count = rest.length ? `${items.length} parameters, the ${FIRST} that changed most first. ` : "";
    return el("div", {}, el("h3", {}, name), el("p", { class: "case-hint" }, `${count}${note}`), parameterTable(items.slice(0, FIRST), top, hasStd, name), more);
  };

  bench.caseTables = { frequencies, parameters };
}
