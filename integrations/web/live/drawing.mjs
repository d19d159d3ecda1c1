// A canvas on which a visitor draws a figure for the mass to follow, its points as text, and ready figures.
import { $ } from "./controls.mjs";
import { FIGURES, pointsOf, textOf } from "./figure.mjs";
import { fitted } from "./plot.mjs";

const EDGE = 1.4; // from the middle to the edge, q0

export class Drawing {
  #line = null; // while it is drawn
  #shown = []; // the reference
  #corners = []; // points of its text

  // `set` is called with the text of a figure, "" for the gyroscope's own.
  constructor(set) {
    const canvas = $("sketch");
    const option = (value, words) => new Option(words, value);
    $("figures").append(option("", "the gyroscope's own"), ...Object.keys(FIGURES).map((name) => option(name, name)));
    $("figures").append(option("drawn", "drawn or typed"));
    $("figures").addEventListener("change", () => {
      const name = $("figures").value;
      name === "drawn" ? $("points").focus() : set(FIGURES[name] ?? "");
    });
    $("points").addEventListener("change", () => set($("points").value.trim()));
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.#line = [this.#at(event)];
    });
    canvas.addEventListener("pointermove", (event) => {
      // A fast pointer has moved several times since the last event.
      const events = event.getCoalescedEvents?.() ?? [];
      this.#line?.push(...(events.length ? events : [event]).map((each) => this.#at(each)));
    });
    canvas.addEventListener("pointerup", () => {
      const text = this.#line ? textOf(this.#line) : "";
      this.#line = null;
      if (text) {
        set(text);
      }
    });
    canvas.addEventListener("pointercancel", () => (this.#line = null));
  }

  #at({ clientX, clientY }) {
    const { left, top, width, height } = $("sketch").getBoundingClientRect();
    const size = Math.min(width, height) / 2 / EDGE;
    return [(clientX - left - width / 2) / size, -(clientY - top - height / 2) / size].map((a) =>
      Math.max(-EDGE, Math.min(EDGE, a)),
    );
  }

  // A figure's text, and the points of the reference that it makes, or null.
  show(text, shown) {
    const name = Object.keys(FIGURES).find((name) => FIGURES[name] === text);
    $("figures").value = name ?? (text && "drawn");
    $("points").value = text;
    this.#shown = shown ?? [];
    this.#corners = text ? pointsOf(text) : [];
  }

  draw(theme) {
    if (!$("drawing").open) {
      return;
    }
    const { context, width, height } = fitted($("sketch"));
    const size = Math.min(width, height) / 2 / EDGE;
    const place = ([x, y]) => [width / 2 + x * size, height / 2 - y * size];
    const stroke = (points, color, thick) => {
      context.strokeStyle = color;
      context.lineWidth = thick;
      context.beginPath();
      points.forEach((point) => context.lineTo(...place(point)));
      context.stroke();
    };
    for (const a of [-1, 0, 1]) {
      stroke([[-EDGE, a], [EDGE, a]], theme.grid, 1);
      stroke([[a, -EDGE], [a, EDGE]], theme.grid, 1);
    }
    stroke(this.#shown, theme.muted, 1.5);
    if (this.#line) {
      stroke(this.#line, theme.accent, 3);
      return;
    }
    context.fillStyle = theme.accent;
    for (const [x, y] of this.#corners.map(place)) {
      context.fillRect(x - 2, y - 2, 4, 4);
    }
  }
}
