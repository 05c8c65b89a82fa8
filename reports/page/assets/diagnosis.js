"use strict";
// Ties the list of places to the drawing; the page reads the same without it.
for (const row of document.querySelectorAll("tr[data-row]")) {
  const at = row.dataset.row === "everywhere" ? "[data-everywhere]" : `[data-at="${row.dataset.row}"]`;
  const parts = [row, ...document.querySelectorAll(`.first svg g${at}`)];
  const light = ({ type }) => parts.forEach((part) => part.classList.toggle("lit", type === "pointerenter"));
  for (const part of parts) {
    part.addEventListener("pointerenter", light);
    part.addEventListener("pointerleave", light);
  }
}
