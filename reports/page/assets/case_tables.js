/* Tables of the case page: frequencies as the papers print them, a strategy a row; parameters. */
{
  const { el, data, number } = bench;
  const GROUPS = { used: "Used: given to the strategies", higher: "Held out: higher modes", modified: "Held out: after" };
  const FIRST = 12; // parameters shown before the rest is folded away

  const signed = (value, digits = 2) => `${value < 0 ? "\u2212" : "+"}${Math.abs(value).toFixed(digits)}`;
  const keyOf = (mode) => `${mode.block}|${mode.modification ?? ""}|${mode.mode}`;
  const under = (text) => el("span", { class: "case-under" }, text);

  /** Return a frequency in Hz; below it, where asked for, its error and MAC. */
  const cell = (mode, measured, options, name = "") => {
    const hz = mode?.predicted_hz;
    const error = hz > 0 ? 100 * (hz / measured - 1) : null;
    return el("td", { class: `right ${name}`, "data-value": hz ?? "" }, !mode ? "\u2013" : hz === null ? el("span", { class: "soft" }, "none") : bench.hertz(hz),
      options.errors && error !== null ? under(`${signed(error)} %`) : null, options.mac && mode?.mac ? under(`MAC ${mode.mac.toFixed(3)}`) : null);
  };

  /** Return the rows of a strategy: its own and those of `beside` ([Hz by strategy and mode, where they come from]). */
  const rowsOf = (entry, groups, beside, options) => {
    const own = new Map(entry.detail.modes.map((mode) => [keyOf(mode), mode]));
    // What an eigenvalue solution leaves of an exact fit says nothing.
    const rms = (block) => el("td", { class: "right case-sum" }, block ? bench.small(entry.result.rms[data.blocks.indexOf(block)]) : "");
    const line = (said, of, sum) => el("tr", { class: said ? "case-printed" : "", "data-strategy": entry.name, "data-said": said },
      el("th", { scope: "row" }, entry.name, said ? under(said) : entry.mark ? under(entry.mark) : null),
      groups.map(({ block, modes, last }) => [modes.map((mode) => cell(of(mode), mode.measured_hz, options)), last ? rms(sum && block) : null]));
    const named = beside.filter(([hertz]) => hertz[entry.name]).map(([hertz, said]) => line(said, (mode) => {
      const hz = mode.modification ? null : hertz[entry.name][mode.mode];
      return hz ? { predicted_hz: hz } : null;
    }, false));
    return [line("", (mode) => own.get(keyOf(mode)), true), ...named];
  };

  /**
   * Return the table of natural frequencies in Hz; the measured ones and the baseline stay in view.
   *
   * entries: [{name, detail, result, mark}]. beside: see rowsOf. options: errors, mac: whether they
   * stand under every frequency.
   */
  bench.frequencies = (entries, beside, options) => {
    const modes = new Map(entries.flatMap((entry) => entry.detail.modes.map((mode) => [keyOf(mode), mode])));
    const groups = data.blocks.flatMap((block) => d3.groups([...modes.values()].filter((mode) => mode.block === block), (mode) => mode.modification ?? "")
      .map(([change, own], k, all) => ({ block, change, modes: own, last: k === all.length - 1 })));
    const head = (text, more = {}) => el("th", { scope: "col", class: "right", ...more }, text);
    const across = (title, of, sum) => el("tr", {}, el("th", { scope: "row" }, title), groups.map((group) => [group.modes.map((mode) => head(of(mode), { "data-mode": keyOf(mode) })), group.last ? el(sum ? "th" : "td", { scope: sum ? "col" : null, class: "right case-sum" }, sum) : null]));
    const [baseline, others] = [entries.filter(({ name }) => name === data.baseline), entries.filter(({ name }) => name !== data.baseline)];
    const rows = (listed) => listed.map((entry) => rowsOf(entry, groups, beside, options));
    const table = el("table", { class: "case-table case-frequencies", "aria-label": "Natural frequencies in Hz" },
      el("thead", {}, el("tr", {}, el("td", {}), groups.map(({ block, change, modes: own, last }) => el("th", { scope: "colgroup", class: "case-band", colspan: own.length + (last ? 1 : 0) }, GROUPS[block], change ? ` \u201c${change}\u201d` : ""))),
        across("Mode", (mode) => mode.mode, "rms, %"), across("Measured", (mode) => bench.hertz(mode.measured_hz), ""), rows(baseline)),
      el("tbody", {}, rows(others)));
    return [el("p", { class: "soft" }, "In Hz. \u201cnone\u201d: the model has no mode that belongs to the measured one; \u201ci\u201d: imaginary. rms: of the frequency errors of a block."), bench.scroll("Natural frequencies", table)];
  };

  const table = (items, title) => {
    const stated = items.some((item) => item.std !== null);
    const heads = ["Parameter", "Before", stated ? "After \u00b1 std" : "After", "Unit", "Change, %"];
    const rows = items.map((item) => [number(item.before, 4), `${number(item.after, 4)}${item.std === null ? "" : ` \u00b1 ${number(item.std, 2)}`}`, item.unit || "ratio", item.change === null ? "\u2013" : signed(100 * item.change, 1)]
      .map((text, k) => el("td", { class: k === 2 ? null : "right" }, text)));
    return bench.scroll(title, el("table", { class: "case-table" }, el("thead", {}, el("tr", {}, heads.map((text, k) => el("th", { scope: "col", class: k % 3 === 0 ? null : "right" }, text)))),
      el("tbody", {}, items.map((item, k) => el("tr", {}, el("th", { scope: "row" }, item.name), rows[k])))));
  };

  /** Return the parameters of a strategy, those that changed most first, as a chart and in numbers. */
  bench.parameters = (name, given) => {
    if (!given.length) return el("p", {}, `${name} has no parameters with a name.`);
    const items = given.map((item) => ({ ...item, change: item.before ? item.after / item.before - 1 : null, spread: item.before && item.std !== null ? Math.abs(item.std / item.before) : null }));
    // What starts at zero has no relative change; where it is a ratio, its value is of the same kind.
    const size = (item) => Math.abs(item.change ?? (item.unit ? Infinity : item.after));
    if (items.length > FIRST) items.sort((a, b) => size(b) - size(a));
    const [shown, rest] = [items.slice(0, FIRST), items.slice(FIRST)];
    const drawn = shown.filter((item) => item.change !== null);
    const edge = (sign) => drawn.map((item) => (item.spread === null ? null : 100 * (item.change + sign * item.spread)));
    const names = drawn.map((item) => item.name);
    const chart = drawn.length ? bench.draw({ kind: "interval", title: `${name}: change of its parameters`, x: { label: "change", unit: "%" }, y: { label: "", unit: "", names },
      series: [{ name, names, x: drawn.map((item) => 100 * item.change), y: names, low: edge(-1), high: edge(1) }], marks: [{ axis: "x", value: 0, label: "" }], height: 20 * drawn.length + 76,
      note: `${rest.length ? `The ${FIRST} of ${items.length} parameters that changed most. ` : ""}${edge(1).some((v) => v !== null) ? "The line is one standard deviation to either side." : "The method gives no uncertainty."}` }) : null;
    const more = rest.length ? el("details", { ontoggle: () => more.children.length < 2 && more.append(table(rest, `Parameters of ${name}, the rest`)) }, el("summary", {}, `The other ${rest.length} parameters`)) : null;
    return el("div", {}, chart, table(shown, `Parameters of ${name}`), more);
  };
}
