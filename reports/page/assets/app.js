// The shell: header, notes, navigation, and which page is shown.
{
  const { el, data } = bench;
  const pages = new Map();

  function facts() {
    const box = document.getElementById("facts");
    for (const [title, text] of data.header || []) box.append(el("div", {}, el("dt", {}, title), el("dd", {}, text)));
  }
  function notes() {
    if (!(data.notes || []).length) return;
    const box = document.getElementById("notes");
    box.hidden = false;
    box.append(el("h2", {}, "Notes on this run"), el("ul", {}, data.notes.map((note) => el("li", {}, note))));
  }
  function navigation() {
    const list = document.getElementById("pages");
    const link = (href, text, title) => el("li", {}, el("a", { href, title: title || null }, text));
    list.append(link("#board", "Leaderboard"));
    if (bench.casePage) list.append(...data.cases.map((item) => link(bench.caseHref(item.name), item.name, item.title)));
  }
  function missing(text) {
    return el("section", {}, el("h1", {}, "Nothing to show"), el("p", {}, text), el("p", {}, el("a", { href: "#board" }, "To the leaderboard")));
  }
  function pageOf({ page, name }) {
    if (page === "board") return pages.get("board") || keep("board", bench.board.page());
    const index = data.cases.findIndex((item) => item.name === name);
    if (index < 0) return missing(`There is no case “${name}”.`);
    if (!bench.casePage) return missing("This page has no case pages.");
    const root = el("section", { class: "case" });
    bench.casePage(root, index);
    return root;
  }
  function keep(key, node) {
    pages.set(key, node);
    return node;
  }
  function show(moved) {
    const route = bench.route();
    const main = document.getElementById("main");
    try {
      main.replaceChildren(pageOf(route));
    } catch (error) {
      main.replaceChildren(missing("This page could not be drawn."));
      reportError(error);
    }
    const href = route.page === "board" ? "#board" : bench.caseHref(route.name);
    for (const a of document.querySelectorAll("#pages a")) {
      if (a.getAttribute("href") === href) {
        a.setAttribute("aria-current", "page");
        if (a.parentNode.parentNode.scrollWidth > a.parentNode.parentNode.clientWidth) a.parentNode.parentNode.scrollLeft = a.offsetLeft - 40;
      } else a.removeAttribute("aria-current");
    }
    document.title = `${route.page === "board" ? "Leaderboard" : route.name} · femubench ${data.run}`;
    if (!moved) return;
    const title = main.querySelector("h1, h2");
    if (title) {
      title.setAttribute("tabindex", "-1");
      title.focus({ preventScroll: true });
    }
    window.scrollTo(0, Math.max(0, main.getBoundingClientRect().top + window.scrollY - 16));
  }

  function start() {
    performance.mark("bench-start");
    document.querySelector(".skip").addEventListener("click", (event) => {
      event.preventDefault();
      document.getElementById("main").focus();
    });
    facts();
    notes();
    navigation();
    show(false);
    window.addEventListener("hashchange", () => show(true));
    performance.mark("bench-drawn");
    performance.measure("bench", "bench-start", "bench-drawn");
    document.documentElement.dataset.ready = "yes";
  }
  document.addEventListener("DOMContentLoaded", start);
}
