// The filters of the leaderboard: scenarios, blocks, strategies.
{
  const { el, data } = bench;

  // Return a menu of checkboxes; `change` takes the indices of those that are on.
  function menu(title, names, change) {
    const tell = () => change(show());
    const boxes = names.map((name) => bench.tick(name, true, tell));
    const rows = boxes.map((label) => el("li", {}, label));
    const inputs = boxes.map((label) => label.firstChild);
    const count = el("span", { class: "count" });
    const turn = (on) => rows.forEach((row, k) => row.hidden || (inputs[k].checked = on));
    const button = (text, on) => bench.button(text, () => {
      turn(on);
      tell();
    });
    const panel = el("fieldset", { class: "panel" }, el("legend", {}, title), el("div", { class: "row" }, button("All", true), button("None", false)), el("ul", { class: "boxes" }, rows));
    // Of one name: one menu at a time.
    const node = el("details", { class: "menu", name: "filters", "data-filter": title.toLowerCase(), onkeydown: ({ key }) => {
      if (key !== "Escape" || !node.open) return;
      node.open = false;
      node.firstChild.focus();
    } }, el("summary", { class: "button" }, `${title}: `, count), panel);
    function show() {
      const on = d3.range(names.length).filter((k) => inputs[k].checked);
      count.textContent = on.length === names.length ? `all ${names.length}` : on.length === 1 ? names[on[0]] : `${on.length} of ${names.length}`;
      node.classList.toggle("changed", on.length < names.length);
      return on;
    }
    show();
    return { node, narrow: (text) => rows.forEach((row, k) => (row.hidden = !names[k].toLowerCase().includes(text))), reset() {
      turn(true);
      show();
    } };
  }

  // Return the row of filters above the table; `set` takes the parts of the filter that change.
  bench.filters = (set) => {
    const strategies = menu("Strategies", data.strategies.map(({ name }) => name), (on) => set({ strategies: new Set(on) }));
    const menus = [menu("Scenarios", data.scenarios, (on) => set({ scenarios: new Set(on.map((k) => data.scenarios[k])) })), menu("Blocks", data.blocks, (blocks) => set({ blocks })), strategies];
    const find = (given) => {
      const text = given.toLowerCase();
      strategies.narrow(text);
      return { text };
    };
    const search = el("input", { type: "search", id: "find", autocomplete: "off", placeholder: "part of a name", oninput: () => set(find(search.value)) });
    const reset = bench.button("Show everything", () => {
      search.value = "";
      const everything = { ...bench.ranking.everything(), ...find("") };
      for (const item of menus) item.reset();
      set(everything);
    }, { id: "reset" });
    // None is open once the reader has gone elsewhere.
    document.addEventListener("pointerdown", ({ target }) => menus.forEach(({ node }) => node.contains(target) || (node.open = false)));
    return el("div", { class: "controls", role: "group", "aria-label": "Filters" }, menus.map(({ node }) => node), el("label", { for: "find" }, "Find a strategy ", search), reset);
  };
}
