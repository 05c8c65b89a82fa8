"use strict";
// Sorts tables and ties the list of places to the drawing; the page reads the same without it.
const bench = globalThis.bench || {};
bench.diagnosis = {
  key(cell) {
    const value = cell.dataset.value;
    return value === undefined ? cell.textContent.trim() : Number(value);
  },

  compare(first, second) {
    const numbers = typeof first === "number" && typeof second === "number";
    if (numbers) return first - second;
    if (typeof first === "number") return -1;
    if (typeof second === "number") return 1;
    return first.localeCompare(second, undefined, { numeric: true });
  },

  sort(table, head, column) {
    const down = head.getAttribute("aria-sort") === "ascending";
    for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", down ? "descending" : "ascending");
    const body = table.tBodies[0];
    const { key, compare } = bench.diagnosis;
    const rows = [...body.rows].map((row) => [key(row.cells[column]), row]);
    rows.sort((a, b) => (down ? compare(b[0], a[0]) : compare(a[0], b[0])));
    body.append(...rows.map((pair) => pair[1]));
  },

  makeSortable(table) {
    [...table.tHead.rows[0].cells].forEach((head, column) => {
      const button = document.createElement("button");
      button.type = "button";
      button.append(...head.childNodes);
      head.append(button);
      button.addEventListener("click", () => bench.diagnosis.sort(table, head, column));
    });
  },

  tie(item) {
    const drawing = document.querySelector(".on-structure svg");
    const own = drawing ? [...drawing.querySelectorAll(`g[data-at="${item.dataset.at}"]`)] : [];
    const parts = item.dataset.all ? [...drawing.querySelectorAll("[data-everywhere]")] : own;
    if (!parts.length) return;
    const light = (on) => [item, ...parts].forEach((part) => part.classList.toggle("lit", on));
    for (const part of [item, ...parts]) {
      part.addEventListener("pointerenter", () => light(true));
      part.addEventListener("pointerleave", () => light(false));
    }
  },
};
document.querySelectorAll("table.sortable").forEach(bench.diagnosis.makeSortable);
document.querySelectorAll(".places li").forEach(bench.diagnosis.tie);
