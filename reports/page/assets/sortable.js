"use strict";
// Let the heads of a table sort its rows; returns what puts them in order once more. Heads with
// data-down sort downwards first, those with data-still not at all. A row goes by the data-sort of its
// cell, its data-value or its text; without any it stays last. Equal rows keep the order that they came
// in, and a row of class "more" stays below its own.
function sortable(table) {
  const { tHead: { rows: [{ cells: heads }] }, tBodies: [body] } = table;
  const words = new Intl.Collator("en", { numeric: true });
  const places = new Map();

  function keyOf({ dataset, textContent }) {
    const key = dataset.sort ?? dataset.value ?? textContent.trim();
    return key === "" ? null : Number.isFinite(Number(key)) ? Number(key) : key;
  }
  function compare(a, b) {
    if (typeof a === "number" && typeof b === "number") return a - b;
    return typeof a === typeof b ? words.compare(a, b) : typeof a === "number" ? -1 : 1;
  }
  function sort() {
    const head = [...heads].find((one) => one.ariaSort);
    const rows = [...body.rows].filter((row) => !row.classList.contains("more"));
    for (const row of rows) if (!places.has(row)) places.set(row, places.size);
    if (!head) return;
    const way = head.ariaSort === "descending" ? -1 : 1;
    const keyed = rows.map((row) => [keyOf(row.cells[head.cellIndex] ?? row), row]);
    keyed.sort(([a, p], [b, q]) => (a === null) - (b === null) || (a !== null && way * compare(a, b)) || places.get(p) - places.get(q));
    body.append(...keyed.flatMap(([, row]) => (row.nextElementSibling?.matches(".more") ? [row, row.nextElementSibling] : [row])));
  }

  for (const head of heads) {
    if ("still" in head.dataset) continue;
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const down = head.ariaSort ? head.ariaSort === "ascending" : "down" in head.dataset;
      for (const other of heads) other.ariaSort = null;
      head.ariaSort = down ? "descending" : "ascending";
      sort();
    });
  }
  return sort;
}
document.querySelectorAll("table.sortable").forEach(sortable);
