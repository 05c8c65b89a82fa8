/* Tables of the case page: frequencies as the papers print them, a strategy a row; MAC; parameters. */
{
  const { el, data, number } = bench;
  const GROUPS = { used: "Used: given to the strategies", higher: "Held out: higher modes", modified: "Held out: after" };
  const FIRST = 12; // parameters shown before the rest is folded away

  const keyOf = (mode) => `${mode.block}|${mode.modification ?? ""}|${mode.mode}`;
  const under = (text) => text && el("span", { class: "case-under" }, text);

  /** Return a frequency in Hz; below it, where asked for, its error and MAC. */
  const frequency = (mode, measured, { errors, mac }) => {
    const hz = mode?.predicted_hz ?? null;
    const error = errors && hz > 0 ? `${bench.percent(100 * (hz / measured - 1), 2)} %` : null;
    return bench.cell(hz, () => [mode && hz === null ? "none" : bench.hertz(hz), under(error), under(mac && mode?.mac && `MAC ${mode.mac.toFixed(3)}`)]);
  };

  /** Return the rows of a strategy: its own and those of `others` ([Hz by strategy and mode, where they come from]). */
  const rowsOf = ({ name, mark, detail, result }, groups, others, options) => {
    const own = new Map(detail.modes.map((mode) => [keyOf(mode), mode]));
    // What an eigenvalue solution leaves of an exact fit says nothing.
    const rms = (block) => el("td", { class: "right case-sum" }, block && bench.small(result.rms[data.blocks.indexOf(block)]));
    const line = (said, of) => el("tr", { class: said ? "case-printed" : null, "data-strategy": name, "data-said": said }, el("th", { scope: "row" }, name, under(said || mark)),
      groups.map(({ block, modes, last }) => [modes.map((mode) => frequency(of(mode), mode.measured_hz, options)), last && rms(!said && block)]));
    return [line("", (mode) => own.get(keyOf(mode))), ...others.filter(([hertz]) => hertz[name]).map(([hertz, said]) => line(said, ({ modification, mode }) => {
      const hz = modification ? null : hertz[name][mode];
      return hz ? { predicted_hz: hz } : null;
    }))];
  };

  /** Return the table of natural frequencies of entries [{name, detail, result, mark}]; measured ones and baseline stay in view. */
  bench.frequencies = (entries, others, options) => {
    const modes = [...new Map(entries.flatMap(({ detail }) => detail.modes.map((mode) => [keyOf(mode), mode]))).values()];
    const groups = data.blocks.flatMap((block) => d3.groups(modes.filter((mode) => mode.block === block), (mode) => mode.modification ?? "")
      .map(([change, own], k, all) => ({ block, change, modes: own, last: k === all.length - 1 })));
    const head = (text, more) => el("th", { scope: "col", class: "right", ...more }, text);
    const across = (title, of, sum) => el("tr", {}, el("th", { scope: "row" }, title),
      groups.map((group) => [group.modes.map((mode) => head(of(mode), { "data-mode": keyOf(mode) })), group.last && el(sum ? "th" : "td", { class: "right case-sum" }, sum)]));
    const bands = groups.map(({ block, change, modes: own, last }) => el("th", { scope: "colgroup", class: "case-band", colspan: own.length + last }, GROUPS[block], change && ` “${change}”`));
    const rows = (baseline) => entries.filter(({ name }) => (name === data.baseline) === baseline).map((entry) => rowsOf(entry, groups, others, options));
    return [el("p", { class: "soft" }, "In Hz. “none”: the model has no mode that belongs to the measured one; “i”: imaginary. rms: of the frequency errors of a block."),
      bench.scroll(el("table", { class: "case-table case-frequencies", "aria-label": "Natural frequencies in Hz" },
        el("thead", {}, el("tr", {}, el("td"), bands), across("Mode", ({ mode }) => mode, "rms, %"), across("Measured", ({ measured_hz }) => bench.hertz(measured_hz), ""), rows(true)), el("tbody", {}, rows(false))))];
  };

  /** Return the MAC of a model's modes with the measured ones; the pairs are framed. */
  bench.macTable = ({ name, exhibit: { mac, modes } }) => {
    const caption = `${name}: MAC of measured and predicted mode shapes; framed: the pairs`;
    const rows = mac.rows.map((row, k) => {
      const partner = modes.find((mode) => !mode.modification && mode.paired === row);
      const pair = partner && d3.leastIndex(mac.columns, (hz) => Math.abs(hz - partner.hz));
      return [row, ...mac.values[k].map((value, c) => bench.cell(value, (v) => [v === null ? "–" : v.toFixed(2), c === pair && el("span", { class: "hidden" }, " pair")],
        { class: c === pair ? "case-pair" : "", style: bench.tone(-Math.max(value, 0)) }))];
    });
    return el("div", {}, el("p", { class: "soft" }, caption), bench.scroll(bench.table(caption, ["Mode \\ Hz", ...mac.columns.map(bench.hertz)], rows, "case-table toned")));
  };

  const parametersOf = (items, title) => {
    const heads = ["Parameter", "Before", items.some(({ std }) => std !== null) ? "After ± std" : "After", "Unit", "Change, %"];
    const right = (text) => el("td", { class: "right" }, text);
    return bench.scroll(bench.table(title, heads, items.map(({ name, before, after, std, unit, change }) => [name, right(number(before, 4)),
      `${number(after, 4)}${std === null ? "" : ` ± ${number(std, 2)}`}`, unit || "ratio", right(change === null ? "–" : bench.percent(100 * change, 1))]), "case-table"));
  };

  /** Return the parameters of a strategy, those that changed most first, as a chart and in numbers. */
  bench.parameters = (name, given) => {
    if (!given.length) return el("p", {}, `${name} has no parameters with a name.`);
    const items = given.map((item) => ({ ...item, change: item.before ? item.after / item.before - 1 : null, spread: item.before && item.std !== null ? Math.abs(item.std / item.before) : null }));
    // What starts at zero has no relative change; where it is a ratio, its value is of the same kind.
    if (items.length > FIRST) items.sort((a, b) => sizeOf(b) - sizeOf(a));
    const [shown, rest] = [items.slice(0, FIRST), items.slice(FIRST)];
    const drawn = shown.filter(({ change }) => change !== null);
    const edge = (sign) => drawn.map(({ change, spread }) => (spread === null ? null : 100 * (change + sign * spread)));
    const names = drawn.map((item) => item.name);
    const most = rest.length ? `The ${FIRST} of ${items.length} parameters that changed most. ` : "";
    return el("div", {},
      drawn.length > 0 && bench.draw({ kind: "interval", title: `${name}: change of its parameters`, x: { label: "change", unit: "%" }, y: { names }, marks: [{ axis: "x", value: 0, label: "" }],
        series: [{ name, names, x: drawn.map(({ change }) => 100 * change), y: names, low: edge(-1), high: edge(1) }],
        note: `${most}${edge(1).some((v) => v !== null) ? "The line is one standard deviation to either side." : "The method gives no uncertainty."}` }),
      parametersOf(shown, `Parameters of ${name}`), rest.length > 0 && bench.fold(`The other ${rest.length} parameters`, () => parametersOf(rest, `Parameters of ${name}, the rest`)));
  };
  const sizeOf = ({ change, unit, after }) => Math.abs(change ?? (unit ? Infinity : after));
}
