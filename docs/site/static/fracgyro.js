// Long names in tables break after a dot, a slash or an underscore.
for (const each of document.querySelectorAll("td code .pre, th code .pre")) {
  const parts = each.textContent.split(/(?<=[._/])(?=\w)/);
  each.replaceChildren(...parts.flatMap((part) => [part, document.createElement("wbr")]).slice(0, -1));
}
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
// In the reference of a scenario, tables that belong to kinds: each section with such tables gets a choice of one kind.
const OWNERS = /^For (.*):$/;
for (const section of document.querySelectorAll("article section")) {
  const parts = [...section.children].filter((each) => each.tagName === "P" && OWNERS.test(each.textContent));
  if (parts.length < 2) {
    continue;
  }
  const kindsOf = (part) => part.textContent.match(OWNERS)[1].split(", ");
  const label = document.createElement("label");
  const select = document.createElement("select");
  const kinds = [...new Set(parts.flatMap(kindsOf))].sort();
  select.append(new Option("all kinds", ""), ...kinds.map((kind) => new Option(kind)));
  select.addEventListener("change", () => {
    for (const part of parts) {
      const shown = !select.value || kindsOf(part).includes(select.value);
      part.classList.toggle("unchosen", !shown);
      part.nextElementSibling.classList.toggle("unchosen", !shown);
    }
  });
  label.className = "kind-filter";
  label.append("Fields of", select);
  section.querySelector("p").after(label);
}
