// State of the page: two controllers and the changes of their settings. The simulated scenarios, the address, and the
// scenario as a command or as TOML are derived from it.
import { EXAMPLE } from "./example.mjs";
import { pointsOf, seriesOf } from "./figure.mjs";

export const RUNS = ["a", "b"];
export const NO_LAW = "none";
export const YOURS = "yours"; // the visitor's function
// The settings that it has: those of the loop around it.
const OF_YOURS = ["controller.force_limit", "controller.observer_bandwidth"];
export const LARGE = ["rate", "error", "force", "estimates", "spectrum", "allan"]; // plots that can be large
const SHARED = ["plant", "reference", "disturbance", "run"];
// Fields that a scenario derives from others. The fields from which it derives them, and those that are chosen in other
// ways, are not offered.
const DERIVED = /^(guard\.|adaptation\.initial_(damping|stiffness))/;
const NOT_OFFERED =
  /^(device\.|plant\.(damping|stiffness)\.|controller\.(kind|adaptive)|adaptation\.kind|run\.record_every|datasheet\.pickoff_)/;

export const tableOf = (name) => name.split(".")[0];
export const isShared = (name) => SHARED.includes(tableOf(name));
export const isOffered = (data, name) => !DERIVED.test(name) && !NOT_OFFERED.test(name) && !data.hidden.includes(name);

// The page as a preset has it.
export function stateOf(preset) {
  return {
    preset: preset.key,
    a: preset.a,
    b: preset.b ?? NO_LAW,
    rate: preset.rate ?? "constant",
    sensors: preset.sensors ?? "exact",
    plot: preset.plot ?? "rate",
    speed: preset.speed ?? 7,
    window: preset.window ?? 20,
    peaks: preset.peaks ?? false,
    figure: preset.figure ?? "", // points of a drawn reference; "": the gyroscope's own
    code: EXAMPLE,
    shared: { ...preset.shared },
    own: { a: { ...preset.own?.a }, b: { ...preset.own?.b } },
  };
}

// The data of the gyroscope of a preset.
export function dataOf(data, presets, { preset }) {
  const { gyroscope } = presets.find(({ key }) => key === preset);
  return gyroscope ? { ...data, ...data.gyroscopes[gyroscope] } : data;
}

export const kindOf = (data, state, run) => data.laws[state[run]].settings["controller.kind"];

// Names of the settings of a run, in the core's order.
export function settingNames(data, kind) {
  return [...data.besides, ...data.kinds[kind].numbers.filter((name) => name in data.fields)];
}

// Names of the settings that the page offers for a run itself, and for both.
export function offeredNames(data, state, run) {
  const names = settingNames(data, kindOf(data, state, run)).filter((name) => isOffered(data, name));
  const own = names.filter((name) => !isShared(name));
  const shared = names.filter((name) => isShared(name) && !(state.figure && tableOf(name) === "reference"));
  return { own: state[run] === YOURS ? own.filter((name) => OF_YOURS.includes(name)) : own, shared };
}

// The scenario that the module simulates.
export function scenarioOf(data, state, run) {
  const settings = {
    ...data.base.settings,
    ...data.laws[state[run]].settings,
    ...data.sensors[state.sensors].settings,
    ...state.shared,
    ...state.own[run],
  };
  const known = settingNames(data, kindOf(data, state, run));
  const own = Object.fromEntries(known.map((name) => [name, settings[name]]));
  const device = data.devices[`${state.rate} ${state.sensors}`];
  const { scales, length, disturbance, volts } = data.base;
  const reference = state.figure ? drawn(data, state, own) : data.base.reference;
  const assumed = Object.fromEntries(
    Object.entries(data.base.assumed).map(([name, usual]) => [name, settings[`datasheet.${name}`] ?? usual]),
  );
  const { degrees } = data; // unit of the rates shown
  const yours = state[run] === YOURS;
  const all = { length, device, volts, reference, disturbance, assumed, degrees, yours };
  const given = Object.entries(all).filter(([, each]) => each);
  return { settings: own, scales, ...Object.fromEntries(given) };
}

// Takes the drawn figure as the reference into the settings; returns its terms. It lasts as long as the slowest motion
// of the gyroscope's own reference.
function drawn(data, state, settings) {
  for (const [name, value] of Object.entries(data.base.settings)) {
    if (tableOf(name) === "reference") {
      settings[name] = value;
    }
  }
  const frequencies = ["x", "y"].map((axis) => Math.abs(settings[`reference.frequency.${axis}`]));
  const { mean, terms } = seriesOf(pointsOf(state.figure), Math.min(...frequencies));
  mean.forEach((offset, axis) => {
    settings[`reference.kind[${axis}]`] = "sines";
    settings[`reference.offset.${"xy"[axis]}`] = offset;
  });
  return { terms, rows: [] };
}

// -- The address

function word(value) {
  return value === null || value === Infinity ? "inf" : String(value);
}

function parsed(field, text) {
  if (field.choices) {
    return field.choices.find((choice) => String(choice) === text) ?? text;
  }
  return field.infinite && text === "inf" ? null : text.trim() === "" ? NaN : Number(text);
}

// Only what differs from the preset.
export function toHash(presets, state) {
  const preset = stateOf(presets.find(({ key }) => key === state.preset));
  const words = new URLSearchParams();
  for (const name of ["a", "b", "rate", "sensors", "plot", "speed", "window", "peaks", "figure"]) {
    if (state[name] !== preset[name]) {
      words.set(name, state[name]);
    }
  }
  if (state.code !== preset.code && RUNS.some((run) => state[run] === YOURS)) {
    words.set("code", state.code);
  }
  const changed = (settings, before, prefix) => {
    for (const [name, value] of Object.entries(settings)) {
      if (value !== before[name]) {
        words.set(prefix + name, word(value));
      }
    }
  };
  changed(state.shared, preset.shared, "");
  RUNS.forEach((run) => changed(state.own[run], preset.own[run], `${run}.`));
  const rest = words.toString();
  return `#${state.preset}${rest ? `&${rest}` : ""}`;
}

// `code`: the visitor's function, if the address has none. Throws RangeError, in one sentence, for what no page can
// show. Ranges of settings are checked where they are used.
export function fromHash(all, presets, hash, code = EXAMPLE) {
  const [key, ...rest] = hash.replace(/^#/, "").split("&");
  const state = { ...stateOf(chosen(presets, "preset", key || presets[0].key)), code };
  const data = dataOf(all, presets, state);
  for (const [name, text] of new URLSearchParams(rest.join("&"))) {
    take(data, state, name, text);
  }
  RUNS.filter((run) => state[run] !== NO_LAW).forEach((run) => {
    const known = offeredNames(data, state, run).own;
    const foreign = Object.keys(state.own[run]).find((name) => !known.includes(name));
    if (foreign) {
      throw new RangeError(`${run}.${foreign} is not a setting of ${data.laws[state[run]].label}`);
    }
  });
  return state;
}

function chosen(presets, name, key) {
  const found = presets.find((preset) => preset.key === key);
  if (!found) {
    throw new RangeError(`${name} is ${key}: it must be one of ${presets.map((preset) => preset.key).join(", ")}`);
  }
  return found;
}

function take(data, state, name, text) {
  const laws = Object.keys(data.laws);
  const choices = {
    a: laws,
    b: [NO_LAW, ...laws],
    rate: Object.keys(data.rates),
    sensors: Object.keys(data.sensors),
    plot: LARGE,
    window: data.windows.map(String),
    peaks: ["true", "false"],
  };
  if (Object.hasOwn(choices, name)) {
    if (!choices[name].includes(text)) {
      throw new RangeError(`${name} is ${text}: it must be one of ${choices[name].join(", ")}`);
    }
    state[name] = { window: Number, peaks: (word) => word === "true" }[name]?.(text) ?? text;
    return;
  }
  if (name === "code") {
    state.code = text;
    return;
  }
  if (name === "figure" && !data.own) {
    state.figure = text;
    if (text) {
      pointsOf(text);
    }
    return;
  }
  if (name === "speed") {
    state.speed = Number(text);
    const { minimum, maximum } = data.speeds;
    if (!(state.speed >= minimum && state.speed <= maximum)) {
      throw new RangeError(`speed is ${text}: it must be from ${minimum} to ${maximum}`);
    }
    return;
  }
  const [, run, setting] = /^(?:([ab])\.)?(.*)$/.exec(name);
  if (!Object.hasOwn(data.fields, setting) || !isOffered(data, setting) || isShared(setting) === Boolean(run)) {
    throw new RangeError(`${name} is nothing that this page can set`);
  }
  (run ? state.own[run] : state.shared)[setting] = parsed(data.fields[setting], text);
}

// -- The scenario elsewhere

// Settings of the scenario file of a controller: what a page of one scenario starts from.
const ofFile = (data, state, run) => ({ ...data.base.settings, ...data.laws[state[run]].settings });

// [field, value in TOML] of all that differs from `defaults`.
function differing(data, state, run, defaults) {
  const { settings } = scenarioOf(data, state, run);
  const found = new Map();
  const noise = ["disturbance.", "run.step"];
  const otherNoise = Object.keys(settings).some(
    (name) => noise.some((start) => name.startsWith(start)) && settings[name] !== defaults[name],
  );
  // A scenario derives them where they are not stated.
  const stated = (name) =>
    (name === "adaptation.initial_rate" && settings["plant.angular_rate"] !== defaults["plant.angular_rate"]) ||
    (name.startsWith("datasheet.") && !name.startsWith("datasheet.pickoff_") && otherNoise);
  for (const name of Object.keys(settings)) {
    if ((settings[name] !== defaults[name] || stated(name)) && !DERIVED.test(name)) {
      const [, path, part] = /^(.*?)(\.[xy]|\.(?:xx|xy|yy)|\[\d\])?$/.exec(name);
      found.set(path, part ? parts(path, settings) : toml(settings[name]));
    }
  }
  const hasHold = !data.hidden.includes("disturbance.hold_steps");
  if (hasHold && (found.has("disturbance.hold_steps") || found.has("run.step"))) {
    found.delete("disturbance.hold_steps");
    found.set("disturbance.hold", toml(settings["disturbance.hold_steps"] * settings["run.step"]));
  }
  if (data.own?.density && (found.has("disturbance.hold") || found.has("disturbance.standard_deviation"))) {
    found.set("disturbance.standard_deviation", toml(settings["disturbance.standard_deviation"]));
    found.set("disturbance.density", ""); // not set: noise has one of the two
  }
  if (state.figure) {
    found.set("reference.terms", termsOf(scenarioOf(data, state, run).reference.terms));
  }
  for (const changes of [data.rates[state.rate].scenario, data.sensors[state.sensors].scenario]) {
    Object.entries(changes).forEach(([path, value]) => found.set(path, toml(value)));
  }
  return [...found];
}

function parts(path, settings) {
  const of = (...names) => names.map((part) => toml(settings[path + part]));
  if (`${path}.xx` in settings) {
    const [xx, xy, yy] = of(".xx", ".xy", ".yy");
    return `{xx = ${xx}, xy = ${xy}, yy = ${yy}}`;
  }
  if (`${path}.x` in settings) {
    return `[${of(".x", ".y").join(", ")}]`;
  }
  const places = Object.keys(settings).filter((name) => name.startsWith(`${path}[`));
  return `[${places.map((name) => toml(settings[name])).join(", ")}]`;
}

function termsOf(numbers) {
  const terms = Array.from({ length: numbers.length / 6 }, (_, i) => {
    const pair = (at) => `[${numbers.slice(6 * i + at, 6 * i + at + 2).join(", ")}]`;
    return `{amplitude = ${pair(0)}, frequency = ${pair(2)}, phase = ${pair(4)}}`;
  });
  return `[${terms.join(", ")}]`;
}

function toml(value) {
  return typeof value === "string" ? JSON.stringify(value) : word(value);
}

// `fracgyro simulate` of a run.
export function toCommand(data, state, run) {
  if (state[run] === YOURS) {
    return `# run ${run.toUpperCase()} is a function of this page; simulate --controller takes one in Python`;
  }
  const { own } = data;
  const changes = differing(data, state, run, own ? ofFile(data, state, run) : data.defaults.command);
  if (own) {
    const toLaw = Object.entries(data.laws[state[run]].changes).map(([path, value]) => [path, toml(value)]);
    changes.unshift(...toLaw);
  }
  const words = changes.map(([path, value]) => {
    const change = `${path}=${value.replace(/^"(\w+)"$/, "$1")}`;
    return ` --set ${/^[\w.=+-]+$/.test(change) ? change : `'${change}'`}`;
  });
  return `fracgyro simulate${own ? ` ${quoted(own.name)}` : ""}${words.join("")}`;
}

const quoted = (word) => (/^[\w./+-]+$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`);

// A scenario file of a run.
export function toToml(data, state, run) {
  if (data.own) {
    const changes = differing(data, state, run, ofFile(data, state, run));
    return changes.reduce((text, [path, value]) => withLine(text, path, value), data.laws[state[run]].toml);
  }
  const tables = new Map();
  for (const [path, value] of differing(data, state, run, data.defaults.toml)) {
    const [table, field] = path.split(".");
    tables.set(table, [...(tables.get(table) ?? []), `${field} = ${value}`]);
  }
  const head = "# What is left out has the paper's values, in the corrected reading.";
  const bodies = [...tables].map(([table, lines]) => `[${table}]\n${lines.join("\n")}\n`);
  return [`${head}\n`, ...bodies].join("\n");
}

// A complete scenario file with another value of a field; "" unsets it.
function withLine(text, path, value) {
  const [table, field] = path.split(".");
  const lines = text.split("\n");
  const head = lines.findIndex((line) => line === `[${table}]` || line === `[[${table}]]`);
  const isField = (line) => line.startsWith(`${field} = `) || line === `# ${field} is not set`;
  const at = lines.findIndex((line, i) => i > head && isField(line));
  lines[at] = value ? `${field} = ${value}` : `# ${field} is not set`;
  return lines.join("\n");
}
