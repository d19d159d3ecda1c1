// Make scrolling elements scrollable with a keyboard, too.
for (const each of document.querySelectorAll(".table-wrapper, .highlight pre")) {
  if (each.scrollWidth > each.clientWidth) {
    each.tabIndex = 0;
  }
}
// Captions of the sidebar are headings without a level.
for (const each of document.querySelectorAll("[role=heading]:not([aria-level])")) {
  each.ariaLevel = "2";
}
// Parameters of a signature stand in lists of definitions that define nothing.
for (const each of document.querySelectorAll("dt.sig dl, dt.sig dd")) {
  each.role = "presentation";
}
// The picture of the live page is a link to it, and becomes it when clicked: nothing runs before.
const live = document.querySelector("img.live-page")?.closest("a");
live?.addEventListener("click", (event) => {
  if (event.ctrlKey || event.metaKey || event.shiftKey) {
    return;
  }
  event.preventDefault();
  const page = document.createElement("iframe");
  page.src = live.href;
  page.title = "Live page";
  page.className = "live-page";
  live.replaceWith(page);
  page.focus();
});
