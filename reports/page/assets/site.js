"use strict";
// Sorts tables by their heads and filters their rows; without it, the pages are read as they are.
const byText = new Intl.Collator("en").compare;
for (const { tHead: { rows: [{ cells: heads }] }, tBodies: [body] } of document.querySelectorAll("table.sortable")) {
  for (const head of heads) {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    button.addEventListener("click", () => {
      const sign = head.getAttribute("aria-sort") === "ascending" ? -1 : 1;
      const keyed = [...body.rows].map((row) => {
        const { dataset: { value }, textContent } = row.cells[head.cellIndex];
        return [value === undefined ? textContent : value && Number(value), row];
      });
      // What has no value stays last in either direction.
      keyed.sort(([a], [b]) => (a === "") - (b === "") || sign * (typeof a === "number" ? a - b : byText(a, b)));
      body.append(...keyed.map(([, row]) => row));
      for (const other of heads) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", sign > 0 ? "ascending" : "descending");
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
