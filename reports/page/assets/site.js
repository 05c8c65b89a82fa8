"use strict";
// Sorts tables by their heads and filters their rows; without it, the pages are read as they are.
(() => {
  const value = (row, column) => {
    const cell = row.cells[column];
    const number = Number(cell.dataset.value || "nothing");
    return Number.isNaN(number) ? null : number;
  };

  const compare = (a, b, column, numeric) => {
    if (!numeric) return a.cells[column].textContent.localeCompare(b.cells[column].textContent);
    const [first, second] = [value(a, column), value(b, column)];
    if (first === null || second === null) return (first === null) - (second === null);
    return first - second;
  };

  const sort = (table, head) => {
    const column = head.cellIndex;
    const numeric = head.dataset.kind === "number";
    const falling = head.getAttribute("aria-sort") === "ascending";
    const rows = [...table.tBodies[0].rows];
    rows.sort((a, b) => {
      // What has no value stays last in either direction.
      const missing = numeric && (value(a, column) === null || value(b, column) === null);
      return compare(a, b, column, numeric) * (falling && !missing ? -1 : 1);
    });
    table.tBodies[0].append(...rows);
    for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", falling ? "descending" : "ascending");
  };

  for (const table of document.querySelectorAll("table.sortable")) {
    for (const head of table.tHead.rows[0].cells) {
      const button = document.createElement("button");
      button.type = "button";
      button.append(...head.childNodes);
      button.addEventListener("click", () => sort(table, head));
      head.append(button);
    }
  }

  const field = document.getElementById("filter");
  if (field) {
    field.parentElement.hidden = false;
    const count = document.getElementById("count");
    field.addEventListener("input", () => {
      const words = field.value.toLowerCase().split(/\s+/).filter(Boolean);
      let shown = 0;
      for (const row of document.querySelectorAll("table.filtered tbody tr")) {
        const name = row.querySelector("th").textContent.toLowerCase();
        row.hidden = !words.every((word) => name.includes(word));
        shown += row.hidden ? 0 : 1;
      }
      count.textContent = words.length ? `${shown} shown` : "";
    });
  }
})();
