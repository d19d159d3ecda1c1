// An editor for a visitor's function, with the numbers of its lines.
import { $ } from "./controls.mjs";

export class Editor {
  // `run` is called with the text.
  constructor(run) {
    $("code").addEventListener("input", () => this.#lay(null));
    $("code").addEventListener("keydown", (event) => {
      if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) {
        event.preventDefault();
        run($("code").value);
      }
    });
    $("run-code").addEventListener("click", () => run($("code").value));
  }

  // note: text below it.
  show(text, note) {
    $("code").value = text;
    $("code-note").textContent = note;
    this.#lay(null);
  }

  // Shows a sentence, and the line that it is about.
  fail(sentence, line) {
    $("own").open = true;
    $("code-note").textContent = sentence;
    this.#lay(line);
    if (line && $("own").contains(document.activeElement)) {
      const lines = $("code").value.split("\n");
      const begin = lines.slice(0, line - 1).join("\n").length + (line > 1);
      $("code").focus();
      $("code").setSelectionRange(begin, begin + (lines[line - 1] ?? "").length);
    }
  }

  #lay(wrong) {
    const count = $("code").value.split("\n").length;
    $("code").rows = count;
    const number = (i) => `${i + 1 === wrong ? "▸" : ""}${i + 1}`;
    $("lines").textContent = Array.from({ length: count }, (_, i) => number(i)).join("\n");
  }
}
