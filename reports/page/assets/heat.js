/* Matrices: a small one as a table of numbers and squares, a large one as a picture with its largest entries. */
{
  const { el } = bench;

  /** Return the style of an element of class case-shade. */
  const shade = (share) => ({ "--shade-light": bench.shade(share, false), "--shade-dark": bench.shade(share, true) });

  /** Return a number as m x 10^k. */
  const scientific = (value) => {
    const exponent = Math.floor(Math.log10(value));
    const raised = [...String(exponent)].map((sign) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(sign)]).join("");
    return `${(value / 10 ** exponent).toFixed(1)} × 10${raised}`;
  };

  /**
   * Return a table whose cells show a number 0..1 and a square of that size and shade.
   *
   * spec: caption, rowTitle, columnTitle, rows, columns (labels), values (rows of numbers or null),
   * pairs (the column of every row's partner, or null), digits.
   */
  const table = (spec) => {
    const cell = (value, row, column) => {
      if (value === null || value === undefined) return el("td", {}, "–");
      const paired = spec.pairs && spec.pairs[row] === column;
      const size = `${(1.3 * Math.sqrt(Math.min(Math.max(value, 0), 1))).toFixed(2)}rem`;
      const square = el("span", { class: "case-square case-shade", style: { width: size, height: size, ...shade(value) } });
      return el("td", { class: paired ? "case-pair" : "" }, el("span", { class: "case-square-box", "aria-hidden": "true" }, square),
        el("span", { class: "case-number" }, value.toFixed(spec.digits ?? 2)), paired ? el("span", { class: "case-hidden" }, " pair") : null);
    };
    const head = [`${spec.rowTitle} \\ ${spec.columnTitle}`, ...spec.columns].map((label) => el("th", { scope: "col" }, label));
    const rows = spec.values.map((values, row) => el("tr", {}, el("th", { scope: "row" }, spec.rows[row]), values.map((value, column) => cell(value, row, column))));
    const table = el("table", { class: "case-heat", "aria-label": spec.caption }, el("thead", {}, el("tr", {}, head)), el("tbody", {}, rows));
    return el("div", {}, el("p", { class: "case-hint" }, spec.caption), bench.scroll(spec.caption, table));
  };

  /**
   * Return a picture of a symmetric matrix on a logarithmic scale, its largest entries as text.
   *
   * spec: title, axis (what rows and columns are), labels, values (base64 of size x size bytes, 0 for
   * none), size, lowest, highest (log10 of the value of byte 0 and 255), unit.
   */
  const image = (spec) => {
    const { size, lowest, highest, unit } = spec;
    const bytes = Uint8Array.from(atob(spec.values), (sign) => sign.charCodeAt(0));
    const value = (byte) => (byte ? 10 ** (lowest + (byte / 255) * (highest - lowest)) : null);
    const values = d3.range(size).map((i) => Array.from(bytes.subarray(i * size, (i + 1) * size), value));
    const names = spec.labels.map(String);
    const axis = { label: spec.axis, unit: "", names };
    const figure = bench.draw({ kind: "cells", title: spec.title, x: axis, y: axis, values,
      value: { label: "size", unit, log: true, low: 10 ** lowest, high: 10 ** (highest > lowest ? highest : lowest + 1) } });
    const upper = d3.cross(d3.range(size), d3.range(size)).filter(([i, j]) => j >= i && values[i][j]);
    const top = d3.sort(upper, ([i, j]) => -values[i][j]).slice(0, 5);
    figure.append(el("p", { class: "case-list-title" }, "Largest entries"),
      el("ol", { class: "case-list" }, top.map(([i, j]) => el("li", {}, `${names[i]} – ${names[j]}: ${scientific(values[i][j])} ${unit}`))));
    return figure;
  };

  bench.heat = { table, image, shade, scientific };
}
