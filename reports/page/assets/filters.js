// The filters of the leaderboard: scenarios, blocks, strategies.
{
  const { el, data } = bench;

  // Return a menu of checkboxes; `given` says what is on, `change` takes the indices that are.
  function menu(title, names, change) {
    const boxes = names.map((name, k) => el("input", { type: "checkbox", value: k, checked: true, onchange: tell }));
    const count = el("span", { class: "count" });
    const rows = boxes.map((box, k) => el("li", {}, el("label", {}, box, " ", names[k])));
    const all = (on) => {
      for (const [k, box] of boxes.entries()) if (!rows[k].hidden) box.checked = on;
      tell();
    };
    const button = (text, on, rest) => el("button", { type: "button", class: "small", onclick: () => all(on), ...rest }, text);
    const list = el("ul", { class: "boxes" }, rows);
    const panel = el("fieldset", { class: "panel" }, el("legend", {}, title), el("div", { class: "row" }, button("All", true), button("None", false)), list);
    const node = el("details", { class: "menu", "data-filter": title.toLowerCase() }, el("summary", {}, `${title}: `, count), panel);
    node.addEventListener("keydown", (event) => {
      if (event.key !== "Escape" || !node.open) return;
      node.open = false;
      node.firstChild.focus();
    });
    function chosen() {
      return boxes.flatMap((box, k) => (box.checked ? [k] : []));
    }
    function show() {
      const on = chosen();
      count.textContent = on.length === names.length ? `all ${names.length}` : on.length === 1 ? names[on[0]] : `${on.length} of ${names.length}`;
      node.classList.toggle("changed", on.length < names.length);
    }
    function tell() {
      show();
      change(chosen());
    }
    show();
    return {
      node,
      reset: () => {
        for (const box of boxes) box.checked = true;
        show();
      },
      narrow: (text) => rows.forEach((row, k) => (row.hidden = !names[k].toLowerCase().includes(text))),
    };
  }

  // Return the row of filters above the table.
  bench.filters = () => {
    const set = bench.board.setFilter;
    const scenarios = menu("Scenarios", data.scenarios, (on) => set({ scenarios: on.map((k) => data.scenarios[k]) }));
    const blocks = menu("Blocks", data.blocks, (on) => set({ blocks: on }));
    const strategies = menu("Strategies", data.strategies.map((s) => s.name), (on) => set({ strategies: on }));
    const menus = [scenarios, blocks, strategies];
    const search = el("input", { type: "search", id: "find", autocomplete: "off", placeholder: "part of a name", oninput: () => {
      strategies.narrow(search.value.toLowerCase());
      set({ text: search.value });
    } });
    const reset = el("button", { type: "button", class: "small", id: "reset", onclick: () => {
      search.value = "";
      strategies.narrow("");
      for (const item of menus) item.reset();
      set({ ...bench.ranking.everything(), text: "" });
    } }, "Show everything");
    const node = el("div", { class: "filters", role: "group", "aria-label": "Filters" }, menus.map((item) => item.node), el("label", { class: "find", for: "find" }, "Find a strategy ", search), reset);
    for (const { node: own } of menus)
      own.addEventListener("toggle", () => {
        if (own.open) for (const item of menus) if (item.node !== own) item.node.open = false;
      });
    document.addEventListener("pointerdown", (event) => {
      for (const item of menus) if (item.node.open && !item.node.contains(event.target)) item.node.open = false;
    });
    return node;
  };
}
