// Elements of the settings, made from the descriptions of the fields. Each has refresh(), which shows its value.

export const $ = (id) => document.getElementById(id);

export function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) {
      made.addEventListener(key.slice(2), value);
    } else if (value !== false && value !== undefined) {
      made.setAttribute(key, value === true ? "" : value);
    }
  }
  made.append(...children);
  return made;
}

let made = 0;
const newId = () => `field-${++made}`;

const signs = { omega0: "ω₀", q0: "q₀", alpha: "α", "^2": "²", "^3": "³", "*": " " };
const pretty = (unit) => unit.replace(/omega0|q0|alpha|\^[23](?!\d)|\*/g, (sign) => signs[sign]);
const shown = (value) => (value === null || value === Infinity ? "inf" : String(value));

// Calls `show` unless `input` holds typed text that is not yet set: another setting may be refreshed meanwhile.
function unlessEdited(input, show) {
  let edited = false;
  input.addEventListener("input", () => (edited = true));
  input.addEventListener("change", () => (edited = false));
  input.addEventListener("blur", () => edited && ((edited = false), show()));
  return () => edited || show();
}

// A number, a choice or a switch. `value()` reads it, `set(value)` is called with another.
export function settingField(name, field, { label = name, fixed = field.fixed, value, set }) {
  const id = newId();
  const input = field.choices ? choiceOf(field, id) : numberOf(field, id);
  const read = () => {
    if (field.choices) {
      return field.choices[input.selectedIndex];
    }
    const text = input.value.trim();
    return field.infinite && text === "inf" ? null : text === "" ? NaN : Number(text);
  };
  input.setAttribute("aria-describedby", `${id}-help`);
  input.addEventListener("change", () => set(read()));
  const unit = field.unit && field.unit !== "1" ? `, ${pretty(field.unit)}` : "";
  const words = element("p", { class: "help", id: `${id}-help` }, field.description + (fixed ? " Restarts." : ""));
  const made = element("div", { class: "field stacked" }, element("label", { for: id }, label + unit), input, words);
  made.refresh = unlessEdited(input, () => {
    if (field.choices) {
      input.selectedIndex = field.choices.indexOf(value());
    } else {
      input.value = shown(value());
    }
  });
  made.refresh();
  return made;
}

function choiceOf({ choices }, id) {
  return element("select", { id }, ...choices.map((choice) => element("option", {}, String(choice))));
}

function numberOf(field, id) {
  if (field.infinite) {
    return element("input", { id, type: "text", inputmode: "decimal" });
  }
  const { minimum = field.exclusiveMinimum, maximum = field.exclusiveMaximum } = field;
  return element("input", { id, type: "number", step: field.whole ? 1 : "any", min: minimum, max: maximum });
}

// One of several, by key.
export function selectField(label, options, { value, set, help = "" }) {
  const id = newId();
  const choices = options.map(([key, words]) => element("option", { value: key }, words));
  const select = element("select", { id, onchange: () => set(select.value) }, ...choices);
  const made = element("div", { class: "field stacked" }, element("label", { for: id }, label), select);
  if (help) {
    select.setAttribute("aria-describedby", `${id}-help`);
    made.append(element("p", { class: "help", id: `${id}-help` }, help));
  }
  made.refresh = () => (select.value = value());
  made.refresh();
  return made;
}

// A slider from `low` to `high`, whose positions `to` and `from` map to values and back. `live`: whether to set it
// while it moves.
export function sliderField(label, field, { low, high, step, to = Number, from = Number, live, words, value, set }) {
  const id = newId();
  const input = element("input", { id, type: "range", min: low, max: high, step, "aria-describedby": `${id}-help` });
  const output = element("output", { for: id });
  const show = (number) => {
    output.textContent = words(number);
    input.setAttribute("aria-valuetext", words(number));
  };
  input.addEventListener("input", () => (live ? set(to(input.value)) : show(to(input.value))));
  input.addEventListener("change", () => !live && set(to(input.value)));
  const help = element("p", { class: "help", id: `${id}-help` }, field.description + (live ? "" : " Restarts."));
  const made = element("div", { class: "field" }, element("label", { for: id }, label), output, input, help);
  made.refresh = unlessEdited(input, () => {
    input.value = from(value());
    show(value());
  });
  made.refresh();
  return made;
}
