"use strict";
// Sorts tables by their heads and filters their rows; without it, the pages are read as they are.
for (const table of document.querySelectorAll("table.sortable")) {
  const { tHead: { rows: [{ cells: heads }] }, tBodies: [body] } = table;
  for (const head of heads) {
    const { cellIndex: column, dataset: { kind } } = head;
    const valueOf = kind === "number"
      ? ({ dataset: { value } }) => (value === "" ? null : Number(value))
      : (cell) => cell.textContent || null;
    const compare = kind === "number" ? (a, b) => a - b : new Intl.Collator("en").compare;
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    button.addEventListener("click", () => {
      const falling = head.getAttribute("aria-sort") === "ascending";
      const rows = [...body.rows].map((row) => [valueOf(row.cells[column]), row]);
      // What has no value stays last in either direction.
      rows.sort(([a], [b]) => (a === null || b === null ? (a === null) - (b === null) : compare(a, b) * (falling ? -1 : 1)));
      body.append(...rows.map(([, row]) => row));
      for (const other of heads) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", falling ? "descending" : "ascending");
    });
    head.append(button);
  }
}

const field = document.getElementById("filter");
if (field) {
  field.parentElement.hidden = false;
  field.addEventListener("input", () => {
    const words = field.value.toLowerCase().split(/\s+/).filter(Boolean);
    const rows = [...document.querySelectorAll("table.filtered tbody tr")];
    for (const row of rows) {
      const name = row.querySelector("th").textContent.toLowerCase();
      row.hidden = !words.every((word) => name.includes(word));
    }
    const shown = rows.filter((row) => !row.hidden).length;
    document.getElementById("count").textContent = words.length ? `${shown} shown` : "";
  });
}
