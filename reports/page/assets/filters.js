// The filters of the leaderboard: scenarios, blocks, strategies.
{
  const { el, data } = bench;

  // Return a menu of checkboxes; `change` takes the indices of those that are on.
  function menu(title, names, change) {
    const boxes = names.map((name, k) => el("input", { type: "checkbox", value: k, checked: true, onchange: tell }));
    const rows = boxes.map((box, k) => el("li", {}, el("label", {}, box, " ", names[k])));
    const count = el("span", { class: "count" });
    const button = (text, on) => el("button", { type: "button", class: "button", onclick: () => {
      for (const [k, box] of boxes.entries()) if (!rows[k].hidden) box.checked = on;
      tell();
    } }, text);
    const panel = el("fieldset", { class: "panel" }, el("legend", {}, title), el("div", { class: "row" }, button("All", true), button("None", false)), el("ul", { class: "boxes" }, rows));
    const node = el("details", { class: "menu", "data-filter": title.toLowerCase() }, el("summary", { class: "button" }, `${title}: `, count), panel);
    node.addEventListener("keydown", (event) => {
      if (event.key !== "Escape" || !node.open) return;
      node.open = false;
      node.firstChild.focus();
    });
    function show() {
      const on = boxes.flatMap((box, k) => (box.checked ? [k] : []));
      count.textContent = on.length === names.length ? `all ${names.length}` : on.length === 1 ? names[on[0]] : `${on.length} of ${names.length}`;
      node.classList.toggle("changed", on.length < names.length);
      return on;
    }
    function tell() {
      change(show());
    }
    show();
    return { node, narrow: (text) => rows.forEach((row, k) => (row.hidden = !names[k].toLowerCase().includes(text))), reset() {
      for (const box of boxes) box.checked = true;
      show();
    } };
  }

  // Return the row of filters above the table.
  bench.filters = () => {
    const set = bench.board.setFilter;
    const strategies = menu("Strategies", data.strategies.map((s) => s.name), (on) => set({ strategies: on }));
    const menus = [menu("Scenarios", data.scenarios, (on) => set({ scenarios: on.map((k) => data.scenarios[k]) })), menu("Blocks", data.blocks, (on) => set({ blocks: on })), strategies];
    const search = el("input", { type: "search", id: "find", autocomplete: "off", placeholder: "part of a name", oninput: () => {
      strategies.narrow(search.value.toLowerCase());
      set({ text: search.value });
    } });
    const reset = el("button", { type: "button", class: "button", id: "reset", onclick: () => {
      search.value = "";
      strategies.narrow("");
      for (const item of menus) item.reset();
      set({ ...bench.ranking.everything(), text: "" });
    } }, "Show everything");
    // One menu at a time, and none once the reader has gone elsewhere.
    const close = (kept) => menus.forEach(({ node }) => node !== kept && !node.contains(kept) && (node.open = false));
    for (const { node } of menus) node.addEventListener("toggle", () => node.open && close(node));
    document.addEventListener("pointerdown", (event) => close(event.target));
    return el("div", { class: "controls", role: "group", "aria-label": "Filters" }, menus.map(({ node }) => node), el("label", { for: "find" }, "Find a strategy ", search), reset);
  };
}
