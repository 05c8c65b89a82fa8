// The shell: notes, navigation, facts and downloads at the foot, and which page is shown.
{
  const { el, data } = bench;
  const put = (id, ...children) => document.getElementById(id).append(...children.flat());
  let board = null;

  // Hand a file over that came with the page, compressed and in base64.
  async function download({ name, type, gzip }) {
    const bytes = Uint8Array.from(atob(gzip), (letter) => letter.charCodeAt(0));
    const file = await new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).blob();
    const href = URL.createObjectURL(new Blob([file], { type }));
    Object.assign(document.createElement("a"), { href, download: name }).click();
    setTimeout(() => URL.revokeObjectURL(href), 1000);
  }
  function missing(text) {
    return el("section", {}, el("h1", {}, "Nothing to show"), el("p", {}, text), el("p", {}, el("a", { href: "#board" }, "To the leaderboard")));
  }
  function pageOf({ page, name }) {
    if (page === "board") return (board ??= bench.board.page());
    const index = data.cases.findIndex((item) => item.name === name);
    return index < 0 ? missing(`There is no case “${name}”.`) : bench.casePage(index);
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
      a.ariaCurrent = a.getAttribute("href") === href ? "page" : null;
      if (a.ariaCurrent) a.closest("ul").scrollLeft = a.offsetLeft - 40;
    }
    document.title = `${route.page === "board" ? "Leaderboard" : route.name} · femubench ${data.run}`;
    if (!moved) return;
    const title = main.querySelector("h1");
    title.setAttribute("tabindex", "-1");
    title.focus({ preventScroll: true });
    window.scrollTo(0, Math.max(0, main.getBoundingClientRect().top + window.scrollY - 16));
  }

  document.addEventListener("DOMContentLoaded", () => {
    performance.mark("bench-start");
    document.querySelector(".skip").addEventListener("click", (event) => {
      event.preventDefault();
      document.getElementById("main").focus();
    });
    put("facts", data.header.flatMap(([title, text]) => [el("dt", {}, title), el("dd", {}, text)]));
    put("downloads", data.downloads.map((file) => bench.button(file.title, () => download(file), { "data-file": file.name })));
    put("notes", el("h2", {}, "Notes on this run"), el("ul", {}, data.notes.map((note) => el("li", {}, note))));
    document.getElementById("notes").hidden = !data.notes.length;
    put("pages", [["#board", "Leaderboard"], ...data.cases.map(({ name, title }) => [bench.caseHref(name), name, title])].map(([href, text, title]) => el("li", {}, el("a", { href, title: title || null }, text))));
    show(false);
    window.addEventListener("hashchange", () => show(true));
    performance.mark("bench-drawn");
    performance.measure("bench", "bench-start", "bench-drawn");
    document.documentElement.dataset.ready = "yes";
  });
}
