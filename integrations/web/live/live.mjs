// The live page: playback, drawing and controls.
import { CHANNELS, PER_RADIAN, place } from "./channels.mjs";
import { $, element, selectField, settingField, sliderField } from "./controls.mjs";
import { Drawing } from "./drawing.mjs";
import { Editor } from "./editor.mjs";
import { EXAMPLE } from "./example.mjs";
import { pointsOf } from "./figure.mjs";
import { History } from "./history.mjs";
import { Plot, drawLogLog } from "./plot.mjs";
import { presets } from "./presets.mjs";
import { Scene, figureOf, periodOf } from "./scene.mjs";
import { allan, errorsOf, spectrum } from "./spectra.mjs";
import {
  LARGE,
  NO_LAW,
  RUNS,
  YOURS,
  dataOf,
  fromHash,
  offeredNames,
  scenarioOf,
  stateOf,
  tableOf,
  toCommand,
  toHash,
  toToml,
} from "./state.mjs";

const STROBE = 1.5; // s on the screen for a period that is seen through a stroboscope
const TAP = 20; // velocity added by a tap
const SPOKEN_EVERY = 2000; // ms
const SHOWN_EVERY = 100; // numbers, ms
const VIEWED_EVERY = 250; // spectrum and Allan deviation, ms
const LONGEST_FRAME = 0.05; // s; where frames take longer, time slows down
const TICK = 100; // ms
const MOST_TICKS = 20; // for an answer while a visitor's function runs; a page that is starved has fewer

const still = matchMedia("(prefers-reduced-motion: reduce)");

let all, data, state, theme; // `data`: of the preset's gyroscope
let pages = presets;
let history = new History(0, 1, 1);
let scenarios = [];
let simulated = []; // the runs that they are of: the state may have others already
let points = []; // the channels of each run's last sample
let ended = []; // when each run diverged, or null
let playing = false;
let busy = false; // the worker has been asked for samples
let owed = 0; // samples that time has passed for
let sample = 0; // the coming one
let started = 0; // how often: what was asked for before is void
let cursor = null;
let figure = [];
let dirty = true;
let failed = false; // the visitor's function has ended the runs
const allowed = new Set([EXAMPLE]); // functions that may run: an address can bring one that nobody has read
let reversal = Infinity; // the sample at which the page reverses the rate by itself

// -- The worker

const waiting = new Map();
let asked = 0;
let worker, workerSource, wasm;

function startWorker() {
  worker = new Worker(workerSource);
  worker.onmessage = ({ data: message }) => {
    if (!waiting.has(message.id)) {
      return; // from a worker that has been ended
    }
    const { resolve, reject } = waiting.get(message.id);
    waiting.delete(message.id);
    if (message.problem === undefined) {
      resolve(message);
    } else {
      reject(Object.assign(new RangeError(message.problem), { line: message.line }));
    }
  };
  worker.onerror = (event) => {
    event.preventDefault();
    pause();
    problem("The simulation has stopped with an error. Reload the page to start again.");
  };
  return ask("load", { wasm, data: all });
}

function ask(is, content = {}) {
  const id = ++asked;
  const answered = new Promise((resolve, reject) => waiting.set(id, { resolve, reject }));
  worker.postMessage({ is, id, ...content });
  if (is !== "load" && runs().some((run) => state[run] === YOURS)) {
    watch(id);
  }
  return answered;
}

// Ends the worker if it does not answer: the visitor's function may have an endless loop.
function watch(id) {
  let ticks = 0;
  const timer = setInterval(() => {
    if (waiting.has(id) && ++ticks < MOST_TICKS) {
      return;
    }
    clearInterval(timer);
    if (waiting.has(id)) {
      worker.terminate();
      const unanswered = [...waiting.values()];
      waiting.clear();
      startWorker();
      const words = "Your function has not returned within 2 s, so it has been ended: change it and run it again";
      unanswered.forEach(({ reject }) => reject(Object.assign(new RangeError(words), { line: null })));
    }
  }, TICK);
}

function problem(sentence) {
  $("problem").hidden = !sentence;
  $("problem").textContent = sentence;
}

// Shows why something cannot be done. Errors of the visitor's function have a line, or null.
function fail({ message, line }) {
  problem(message);
  if (line !== undefined) {
    failed = true;
    pause();
    editor.fail(message, line);
  }
}

// -- Running

const presetOf = () => pages.find(({ key }) => key === state.preset);
const runs = () => RUNS.filter((run) => state[run] !== NO_LAW);
const stepOf = () => scenarios[0].settings["run.step"];
// A unit of time in ms.
const unitOfTime = () => 1e3 / (data.base.scales["plant.angular_rate"] ?? 1e3);
const degrees = () => (data.degrees ? PER_RADIAN : 1);
const unitOfRate = () => (data.degrees ? "deg/s" : "rad/s");
const milliseconds = (samples) => samples * stepOf() * unitOfTime();

// From t = 0, with the settings as they are. Returns whether they can be run.
async function restart() {
  const attempt = ++started;
  busy = true;
  const names = runs();
  const wanted = names.map((run) => scenarioOf(data, state, run));
  const bin = Math.max(1, Math.round(data.bin / wanted[0].settings["run.step"]));
  try {
    const code = allowed.has(state.code) ? state.code : EXAMPLE;
    await ask("start", { scenarios: wanted, bin, step: data.base.settings["run.step"], code });
  } catch (error) {
    if (attempt === started) {
      busy = false;
      fail(error);
    }
    return false;
  }
  if (attempt !== started) {
    return true;
  }
  scenarios = wanted;
  simulated = names;
  history = new History(wanted.length, milliseconds(bin), milliseconds(1));
  points = wanted.map(() => new Float64Array(CHANNELS.length).fill(NaN));
  ended = wanted.map(() => null);
  [sample, owed, cursor] = [0, 0, null];
  failed = false;
  figure = figureOf(wanted[0]);
  const { reverses } = presetOf();
  const acts = reverses && !still.matches && !Object.hasOwn(state.shared, "plant.angular_rate");
  reversal = acts ? Math.round(reverses.first / milliseconds(1)) : Infinity;
  scene.restart(smallForce() / 2, unitOfTime());
  problem("");
  showRuns();
  await advance(1);
  return true;
}

let advanced = Promise.resolve();
function advance(samples) {
  advanced = taken(samples);
  return advanced;
}
async function taken(samples) {
  const attempt = started;
  busy = true;
  try {
    const { found, diverged } = await ask("advance", { first: sample, samples });
    if (attempt !== started) {
      return;
    }
    sample += samples;
    found.forEach(({ count, bins, point }, run) => {
      history.add(run, bins);
      points[run] = count ? point : points[run];
      ended[run] = diverged[run] === null ? null : diverged[run] * unitOfTime();
    });
    scene.turn(turning(), samples * stepOf(), samples / Math.max(1, state.speed / milliseconds(1)));
    dirty = true;
    if (ended.every((time) => time !== null)) {
      pause();
    }
  } catch (error) {
    pause();
    if (attempt === started) {
      fail(error);
    }
  } finally {
    if (attempt === started) {
      busy = false;
      dirty = true;
    }
  }
}

// Ωz in rad per unit of time.
function turning() {
  const rate = points[0][place.rate] / degrees() / (scenarios[0].scales["plant.angular_rate"] ?? 1);
  return still.matches ? 0 : rate;
}

async function play() {
  if (failed || (ended.length && ended.every((time) => time !== null))) {
    if (!(await restart()) || failed) {
      return;
    }
  }
  playing = true;
  $("play").textContent = "Pause";
}
function pause() {
  playing = false;
  $("play").textContent = "Play";
  dirty = true;
}

async function oneStep() {
  pause();
  await advanced;
  if (!failed || (await restart())) {
    await advance(1);
  }
}

// The preset acts: the state and the address stay as they are.
async function reverse() {
  if (sample < reversal) {
    return; // restarted, or the visitor has moved the rate
  }
  const { every } = presetOf().reverses;
  reversal += Math.round(every / milliseconds(1));
  await tune("plant.angular_rate", -scenarios[0].settings["plant.angular_rate"]);
  refreshed.forEach((field) => field.refresh());
  showRate();
}

function kick(velocity) {
  ask("kick", { velocity }).catch(fail);
}

// -- Settings

// A force that counts as small: 2, or a fifth of a limit below 10.
const smallForce = () => Math.min(2, 0.2 * (scenarios[0].settings["controller.force_limit"] ?? Infinity));

const valueOf = (name, run) => scenarios[simulated.indexOf(run)]?.settings[name] ?? null;
const restarts = (name) => Boolean(data.fields[name].fixed);

// One of the settings of both runs, or of one.
async function set(name, value, run) {
  const into = run ? state.own[run] : state.shared;
  reversal = name === "plant.angular_rate" ? Infinity : reversal;
  const had = Object.hasOwn(into, name);
  const before = into[name];
  into[name] = value;
  const done = restarts(name) ? await restart() : await tune(name, value, run);
  if (!done && into[name] === value) {
    if (had) {
      into[name] = before;
    } else {
      delete into[name];
    }
  }
  refresh();
}

async function tune(name, value, run) {
  const changes = simulated.map((each) => (!run || each === run ? { [name]: value } : {}));
  try {
    await ask("set", { changes });
  } catch (error) {
    fail(error);
    return false;
  }
  scenarios.forEach((scenario, i) => Object.assign(scenario.settings, changes[i]));
  figure = figureOf(scenarios[0]);
  if (run) {
    showRuns();
  }
  problem("");
  return true;
}

// Selects another controller, sensor or rate profile. Settings of the former controller are dropped.
async function choose(name, key) {
  const before = structuredClone(state);
  state[name] = key;
  if (RUNS.includes(name)) {
    state.own[name] = {};
  }
  if (!(await restart())) {
    state = before;
  }
  build();
}

// The figure that the mass follows.
async function follow(figure) {
  try {
    if (figure) {
      pointsOf(figure);
    }
  } catch (error) {
    problem(error.message);
    build();
    return;
  }
  state.figure = figure;
  await restart();
  build();
}

// Runs a text of the visitor's in B, unless A is theirs.
async function runCode(text) {
  allowed.add(text);
  state.code = text;
  if (!runs().some((run) => state[run] === YOURS)) {
    state.b = YOURS;
    state.own.b = {};
  }
  problem("");
  const begun = await restart();
  build(!begun);
  if (begun) {
    play();
  }
}

const refreshed = [];
function refresh() {
  refreshed.forEach((field) => field.refresh());
  showRate();
  showSpeed();
  remember();
}

function showRate() {
  const rate = Number((degrees() * valueOf("plant.angular_rate", "a")).toPrecision(6));
  if (document.activeElement !== $("rate")) {
    $("rate").value = rate;
  }
  $("rate-value").textContent = `${String(rate).replace("-", "−")} ${unitOfRate()}`;
}

function showSpeed() {
  $("speed").value = Math.log10(state.speed);
  $("speed-value").textContent = `${Number(state.speed.toPrecision(2))} ms a second`;
  $("speed").setAttribute("aria-valuetext", $("speed-value").textContent);
  $("slow").textContent = `Slowed down ${spaced(Math.round(1e3 / state.speed))} times. The frame turns with the chip.`;
}
const spaced = (number) => String(Number(number.toPrecision(2))).replace(/(?<=\d)(?=(\d{3})+$)/g, ",");

// Keeps the address in step with the page. Browsers limit how often it may change. An address that a link has given
// meanwhile is for fromAddress.
let remembering;
function remember() {
  const { hash } = location;
  clearTimeout(remembering);
  remembering = setTimeout(() => {
    if (location.hash === hash) {
      window.history.replaceState(null, "", toHash(pages, state));
    }
  }, 300);
}

// -- Controls

// keepsNote: the editor shows an error.
function build(keepsNote = failed) {
  refreshed.length = 0;
  const added = (field) => {
    refreshed.push(field);
    return field;
  };
  const laws = Object.entries(data.laws).map(([key, { label }]) => [key, label]);
  $("laws").replaceChildren(
    ...RUNS.map((run) => {
      const options = run === "a" ? laws : [[NO_LAW, "no second run"], ...laws];
      const law = selectField("Controller", options, { value: () => state[run], set: (key) => choose(run, key) });
      const fields = element("fieldset", {}, element("legend", {}, `Run ${run.toUpperCase()}`), added(law));
      if (state[run] !== NO_LAW) {
        fields.append(...ownFields(run, added));
      }
      return fields;
    }),
  );
  $("shared").replaceChildren($("shared").firstElementChild, ...sharedFields(added));
  $("sentence").textContent = presetOf().sentence;
  for (const link of $("presets").querySelectorAll("a")) {
    const chosen = link.hash === `#${state.preset}`;
    chosen ? link.setAttribute("aria-current", "true") : link.removeAttribute("aria-current");
  }
  const buttons = $("out").querySelectorAll("button");
  RUNS.forEach((run, i) => (buttons[A_AS_TOML + i].disabled = [NO_LAW, YOURS].includes(state[run])));
  $("drawing").hidden = Boolean(data.own);
  drawing.show(state.figure, figure);
  $("own").open ||= runs().some((run) => state[run] === YOURS);
  if (!keepsNote) {
    editor.show(state.code, allowed.has(state.code) ? "" : UNREAD);
  }
  $("window").value = state.window;
  $("plot").value = state.plot;
  arrange();
  $("peaks").checked = state.peaks;
  refresh();
}

function plain(name, run, added) {
  const set_ = (value) => set(name, value, run);
  const label = name.split(".").slice(1).join(".");
  return added(settingField(name, data.fields[name], { label, value: () => valueOf(name, run ?? "a"), set: set_ }));
}

// Folded away, by the tables of a scenario.
function details(words, names, run, added) {
  const groups = [...new Set(names.map(tableOf))].flatMap((table) => [
    element("h3", {}, table),
    element(
      "div",
      { class: "settings", role: "group", "aria-label": table },
      ...names.filter((name) => tableOf(name) === table).map((name) => plain(name, run, added)),
    ),
  ]);
  return element("details", {}, element("summary", {}, `${words} (${names.length})`), ...groups);
}

function ownFields(run, added) {
  const names = offeredNames(data, state, run).own;
  const order = "controller.order";
  const fields = [];
  if (names.includes(order)) {
    const { minimum: low, maximum: high } = data.fields[order];
    const slider = {
      low,
      high,
      step: 0.02,
      live: false,
      words: (value) => String(value),
      value: () => valueOf(order, run),
      set: (value) => set(order, value, run),
    };
    fields.push(added(sliderField("Fractional order α", data.fields[order], slider)));
  }
  const rest = names.filter((name) => name !== order);
  return [...fields, details("All settings of this controller", rest, run, added)];
}

function sharedFields(added) {
  const noise = "disturbance.standard_deviation";
  const names = offeredNames(data, state, "a").shared;
  const usual = data.base.settings[noise] > 0 ? Math.round(Math.log10(data.base.settings[noise])) : 0;
  const quiet = usual - 2.02; // the slider's position of no noise
  const several = (of) => Object.keys(of).length > 1;
  const apart = ["plant.angular_rate", noise, "disturbance.seed"];
  const rest = names.filter((name) => !apart.includes(name));
  const choices = (of) => Object.entries(of).map(([key, { label }]) => [key, label]);
  const fields = [
    names.includes(noise) &&
      added(
        sliderField("Noise σ of the disturbing force", data.fields[noise], {
          low: quiet,
          high: usual + 1,
          step: 0.01,
          to: (position) => (Number(position) <= quiet ? 0 : Number((10 ** position).toPrecision(3))),
          from: (value) => (value > 0 ? Math.log10(value) : quiet),
          live: true,
          words: (value) => String(Number(value.toPrecision(3))),
          value: () => valueOf(noise, "a"),
          set: (value) => set(noise, value),
        }),
      ),
    several(data.rates) &&
      added(
        selectField("Angular rate", choices(data.rates), {
          value: () => state.rate,
          set: (key) => choose("rate", key),
          help: "Restarts.",
        }),
      ),
    several(data.sensors) &&
      added(
        selectField("Sensors", choices(data.sensors), {
          value: () => state.sensors,
          set: (key) => choose("sensors", key),
          help: "Restarts.",
        }),
      ),
    names.includes("disturbance.seed") && plain("disturbance.seed", undefined, added),
    details("All settings of gyroscope, reference, noise and run", rest, undefined, added),
  ];
  return fields.filter(Boolean);
}

// -- Plots and numbers

// Which channels, and how a run's line of each looks.
// In the order of LARGE. On a logarithmic scale the second channel of a run has another shade instead of dashes.
const PLOTS = [
  { title: "Angular rate", unit: "", least: 20, curves: [["rate_estimate", "estimated"]] },
  { title: "Tracking error |e|", unit: "in µm", log: true, curves: [["error.x", "x"], ["error.y", "y"]] },
  { title: "Force u", unit: "in m ω₀² q₀", least: 2, curves: [["control.x", "x"], ["control.y", "y"]] },
  {
    title: "Error of the estimated springs K and dampers D",
    unit: "relative to the true ones",
    log: true,
    curves: [["stiffness_error", "K"], ["damping_error", "D"]],
  },
];
// Views of the error of the rate over the time shown; drawn only if they are the large plot.
const VIEWS = [
  { title: "Spectrum of the rate's error", of: spectrum, per: "/√Hz over the frequency", unit: "Hz" },
  { title: "Allan deviation of the rate's error", of: allan, per: " over the averaging time", unit: "s" },
];
const TITLES = [...PLOTS, ...VIEWS].map(({ title }) => title); // in the order of LARGE
const FORCE = 2;
const DASHES = [
  [[], [3, 3]],
  [[10, 4], [10, 3, 2, 3]],
];
const TRUE_RATE = { run: 0, channel: place.rate, color: "text", dash: [4, 3], wide: false, label: "true" };

let plots = [];
let views = [];
let legends = [];

function buildPlots() {
  plots = PLOTS.map(({ title, unit, log, least }, i) => {
    const canvas = element("canvas", { role: "img", "aria-label": `${title} over time; the table has the numbers` });
    const legend = element("ul", { class: "legend" });
    const small = element("small", {}, unit); // that of a rate depends on the gyroscope
    const heading = element("h2", {}, title, " ", small);
    const box = element("div", { class: "plot" }, heading, legend, canvas);
    canvas.addEventListener("pointermove", ({ offsetX }) => moveCursor(plots[i].timeAt(offsetX, view())));
    canvas.addEventListener("pointerleave", () => moveCursor(null));
    return Object.assign(new Plot(canvas, { log, least }), { legend, box, small });
  });
  views = VIEWS.map((view) => {
    const canvas = element("canvas", { role: "img", "aria-label": `${view.title}, of each run` });
    const small = element("small");
    const box = element("div", { class: "plot tall" }, element("h2", {}, view.title, " ", small), canvas);
    return { ...view, canvas, small, box };
  });
}

// Draws the spectrum or the Allan deviation, of the time shown.
function drawView({ canvas, of, unit }, { from, to }) {
  const curves = simulated.map((color, run) => {
    const numbers = errorsOf(history, run, place.rate_error, from, to);
    return { points: of(numbers, history.bin / 1e3), color, wide: true };
  });
  drawLogLog(canvas, curves, unit, theme);
}

// Puts the large plot first; it and the last one have an axis of time.
function arrange() {
  const large = [...plots, ...views][LARGE.indexOf(state.plot)];
  const listed = [large, ...plots.filter((plot) => plot !== large)];
  listed.forEach((plot, i) => {
    const last = i === listed.length - 1;
    plot.times = last || plot === large;
    plot.box.className = `plot${plot === large ? " tall" : ""}${last ? " timed" : ""}`;
  });
  if (listed.some(({ box }, i) => $("plot-list").children[i] !== box)) {
    $("plot-list").replaceChildren(...listed.map(({ box }) => box));
  }
  dirty = true;
}

// Its law, and what of that is set otherwise.
function described(run) {
  const own = Object.entries(state.own[run]).map(([name, value]) => `, ${name.split(".").pop()} ${value ?? "inf"}`);
  return data.laws[state[run]].label + own.join("");
}

// The lines of the runs there are.
function showRuns() {
  const names = simulated;
  const lines = names.map((run, i) =>
    element("li", {}, swatch(run, DASHES[i][0]), `${run.toUpperCase()}: ${described(run)}`),
  );
  $("runs").replaceChildren(element("ul", { class: "legend" }, ...lines));
  legends = [];
  plots.forEach((plot, i) => {
    const curves = names.flatMap((run, at) =>
      PLOTS[i].curves.map(([channel, label], k) => ({
        run: at,
        channel: place[channel],
        color: PLOTS[i].log && k > 0 ? `${run}-second` : run,
        dash: PLOTS[i].log ? [] : DASHES[at][k],
        wide: k === 0,
        band: channel === "rate_estimate" ? place.rate_deviation : undefined,
        rare: channel === "rate_estimate" || channel.startsWith("control"),
        label: `${run.toUpperCase()} ${label}`,
      })),
    );
    plot.curves = i === 0 ? [...curves, TRUE_RATE] : curves;
    plot.legend.replaceChildren(
      ...plot.curves.map(({ run, channel, color, dash, label, band }) => {
        const value = element("span");
        legends.push(() => {
          const deviation = band === undefined ? NaN : at(run, band);
          const rate = channel === place.rate_estimate || channel === place.rate;
          const number = rate || cursor !== null ? text(at(run, channel)) : `RMS ${text(shownRms(run, channel))}`;
          value.textContent = `${label} ${number}${deviation > 0 ? ` ± ${text(deviation)}` : ""}`;
        });
        return element("li", {}, swatch(color, dash), value);
      }),
    );
  });
  plots[0].small.textContent = `in ${unitOfRate()}`;
  views.forEach(({ small, per }) => (small.textContent = `in ${unitOfRate()}${per}`));
  showLimits();
  const cells = names.map((run) => element("th", { scope: "col" }, run.toUpperCase()));
  const table = $("now").querySelector("table");
  table.tHead.replaceChildren(element("tr", {}, element("th", { scope: "col" }, "of run"), ...cells));
  table.tBodies[0].replaceChildren(...VALUES.map(([channel, words, unit]) => valueRow(channel, words, unit, names)));
}

// Draws the limits of the force.
function showLimits() {
  const limits = scenarios.map(({ settings }) => settings["controller.force_limit"]);
  plots[FORCE].least = smallForce();
  plots[FORCE].lines = simulated.flatMap((color, i) =>
    Number.isFinite(limits[i]) ? [-1, 1].map((sign) => ({ value: sign * limits[i], color })) : [],
  );
}

const VALUES = [
  ["rate", "true angular rate", "rate"],
  ["rate_estimate", "estimated angular rate", "rate"],
  ["rate_deviation", "its standard deviation", "rate"],
  ["error.x", "tracking error |x|", "µm"],
  ["error.y", "tracking error |y|", "µm"],
  ["control.x", "force x", "m ω₀² q₀"],
  ["control.y", "force y", "m ω₀² q₀"],
  ["stiffness_error", "error of K, of K", ""],
  ["damping_error", "error of D, of D", ""],
];
function valueRow(channel, words, unit, names) {
  const cells = names.map((run, i) => {
    const cell = element("td", { "data-run": run, "data-channel": channel });
    legends.push(() => (cell.textContent = text(at(i, place[channel]))));
    return cell;
  });
  const shown = unit === "rate" ? unitOfRate() : unit;
  return element("tr", {}, element("th", { scope: "row" }, shown ? `${words}, ${shown}` : words), ...cells);
}

function swatch(color, dash) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  made.setAttribute("viewBox", "0 0 32 10");
  made.setAttribute("aria-hidden", "true");
  const path = document.createElementNS("http://www.w3.org/2000/svg", "path");
  path.setAttribute("d", "M0 5H32");
  const pattern = dash.join(" ") || "none";
  path.setAttribute("style", `stroke: var(--${color}); stroke-width: 2.5; stroke-dasharray: ${pattern}`);
  made.append(path);
  return made;
}

// Value of a channel at the last sample, or at the cursor.
function at(run, channel) {
  return cursor === null ? points[run][channel] : history.last(run, channel, cursorBin(run));
}
const cursorBin = (run) =>
  Math.max(history.first(run), Math.min(history.count(run) - 1, Math.max(0, history.at(cursor))));
const shownTime = () =>
  cursor === null ? milliseconds(Math.max(0, sample - 1)) : history.time(Math.max(0, cursorBin(0)));

// Over the time shown.
function shownRms(run, channel) {
  const { from, to } = view();
  return history.rms(run, channel, from, to);
}

// RMS of both runs over the time shown: momentary values may say the opposite of the curves.
function measured() {
  const number = (of) => text(of).replace("e-", "e−"); // which is not broken at the end of a line
  const each = (of) => simulated.map((run, i) => `${run.toUpperCase()} ${number(of(i))}`).join(", ");
  const rate = each((run) => shownRms(run, place.rate_error));
  const error = each((run) => Math.hypot(shownRms(run, place["error.x"]), shownRms(run, place["error.y"])));
  return `RMS over the time shown: error of the rate ${rate} ${unitOfRate()}; tracking error ${error} µm.`;
}

function text(number) {
  if (!Number.isFinite(number)) {
    return "–";
  }
  const size = Math.abs(number);
  const words = size !== 0 && (size < 1e-3 || size >= 1e6) ? number.toExponential(3) : number.toPrecision(4);
  return words.replace("-", "−").replace("e−", "e-").replace("e+", "e");
}

function view() {
  const now = milliseconds(Math.max(0, sample - 1));
  const length = state.window * unitOfTime();
  const to = Math.max(now, length);
  return { from: to - length, to, cursor, peaks: state.peaks };
}

function moveCursor(time) {
  cursor = history.runs && history.count(0) ? time : null;
  dirty = true;
}

function showNumbers() {
  legends.forEach((show) => show());
  $("measured").textContent = measured();
  const ends = ended.flatMap((time, i) => {
    return time === null ? [] : [`Run ${simulated[i].toUpperCase()} diverged at ${time.toPrecision(4)} ms.`];
  });
  const paused = playing || busy ? "" : ", paused";
  $("clock").textContent = `t = ${shownTime().toFixed(3)} ms${paused}. ${ends.join(" ")}`;
  const where = cursor === null ? "" : ", at the cursor";
  $("now").querySelector("caption").textContent = `At t = ${shownTime().toFixed(3)} ms${where}`;
}

function spoken() {
  const parts = simulated.map((run, i) => {
    const [estimate, deviation] = [points[i][place.rate_estimate], points[i][place.rate_deviation]];
    const band = deviation > 0 ? ` plus or minus ${text(deviation)}` : "";
    const rate = Number.isFinite(estimate) ? `estimate ${text(estimate)}${band}` : "no estimate";
    const error = `RMS error x ${text(shownRms(i, place["error.x"]))} µm`;
    return ended[i] === null ? `run ${run.toUpperCase()} ${rate}, ${error}` : `run ${run.toUpperCase()} has diverged`;
  });
  return `t ${milliseconds(sample).toFixed(1)} ms: rate ${text(points[0][place.rate])}; ${parts.join("; ")}`;
}

// -- Frames

const scene = new Scene($("scene"));
const drawing = new Drawing(follow);
const editor = new Editor(runCode);
const UNREAD =
  "This function came with the address; until you run it, the example runs in its place. It cannot send anything " +
  "anywhere, but read it first.";
let [frameBefore, shownAt, spokenAt, viewedAt] = [0, 0, 0, 0];

function frame(now) {
  const seconds = Math.min((now - frameBefore) / 1e3, LONGEST_FRAME);
  frameBefore = now;
  if (playing && !busy) {
    owed += (state.speed * seconds) / milliseconds(1);
    const samples = Math.min(Math.floor(owed), Math.max(1, reversal - sample));
    if (samples > 0) {
      owed -= samples;
      const turns = sample + samples >= reversal;
      advance(samples).then(() => turns && reverse());
    }
  }
  if (dirty && scenarios.length) {
    dirty = false;
    const seen = view();
    plots.forEach((plot) => plot.draw(history, seen, theme));
    const shownView = views[LARGE.indexOf(state.plot) - plots.length];
    if (shownView && (!playing || now - viewedAt >= VIEWED_EVERY)) {
      viewedAt = now;
      drawView(shownView, seen);
    }
    const seenRate = degrees() * valueOf("plant.angular_rate", "a");
    const turned = (Number.isFinite(points[0][place.rate]) ? points[0][place.rate] : seenRate) / Number($("rate").max);
    drawing.draw(theme);
    scene.draw(history, seenPoints(), figure, theme, turned);
    if (!(playing || busy) || now - shownAt >= SHOWN_EVERY) {
      shownAt = now;
      showNumbers();
    }
  }
  if (playing && now - spokenAt >= SPOKEN_EVERY) {
    spokenAt = now;
    $("spoken").textContent = spoken();
  }
  requestAnimationFrame(frame);
}

// Points for the scene: a mass that is faster than frames is seen as through a stroboscope, each time a little more
// of a period later.
function seenPoints() {
  const period = periodOf(scenarios[0]) * unitOfTime();
  const shown = sample * milliseconds(1);
  if (!playing || state.speed < 5 * period || history.count(0) < 2) {
    return points;
  }
  const phase = (performance.now() / 1e3 / STROBE) % 1;
  const time = (Math.floor(shown / period - phase) + phase) * period - period;
  return points.map((point, run) => {
    const at = (time + history.step) / history.bin - 1; // between two bins
    const i = Math.floor(at);
    if (i < history.first(run) || i + 1 >= history.count(run)) {
      return point;
    }
    return point.map((_, channel) => {
      const [one, next] = [history.last(run, channel, i), history.last(run, channel, i + 1)];
      return one + (at - i) * (next - one);
    });
  });
}

function readTheme() {
  const style = getComputedStyle(document.documentElement);
  const names = ["surface", "text", "muted", "grid", "accent", "a", "b", "a-second", "b-second"];
  theme = Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
  dirty = true;
}

// -- Taking it along

async function copy(words, what) {
  $("text").hidden = false;
  $("text").value = words;
  try {
    await navigator.clipboard.writeText(words);
    $("copied").textContent = `${what} copied.`;
  } catch {
    $("text").select();
    $("copied").textContent = `${what}: copy it from below.`;
  }
}

async function saveSeen() {
  const { from } = view();
  const { text: content } = await ask("csv", { since: Math.round(from / milliseconds(1)), step: stepOf() });
  save(new Blob([content], { type: "text/csv" }), "fracgyro.csv");
}

// Saves the scene and the large plot, with the runs and their RMS above, as a PNG file.
async function savePicture() {
  const large = [...plots, ...views][LARGE.indexOf(state.plot)];
  const ratio = window.devicePixelRatio || 1;
  const [plot, drawn] = [large.canvas, scene.canvas];
  const gap = 16 * ratio;
  const head = 72 * ratio;
  const picture = element("canvas", {
    width: plot.width + drawn.width + 3 * gap,
    height: Math.max(plot.height, drawn.height) + head + gap,
  });
  const context = picture.getContext("2d");
  context.fillStyle = theme.surface;
  context.fillRect(0, 0, picture.width, picture.height);
  context.drawImage(drawn, gap, head);
  context.drawImage(plot, drawn.width + 2 * gap, head);
  context.fillStyle = theme.text;
  const labels = simulated.map((run) => `${run.toUpperCase()}: ${described(run)}`).join("   ");
  [`fracgyro: ${presetOf().title}, ${TITLES[LARGE.indexOf(state.plot)]}`, labels, measured()].forEach((words, i) => {
    context.font = `${i ? "" : "bold "}${13 * ratio}px system-ui, sans-serif`;
    context.fillText(words, gap, (20 + 20 * i) * ratio, picture.width - 2 * gap);
  });
  save(await new Promise((resolve) => picture.toBlob(resolve)), "fracgyro.png");
}

function save(blob, name) {
  const url = URL.createObjectURL(blob);
  element("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}

const A_AS_TOML = 2; // B follows
function buildOut() {
  const button = (words, act) => element("button", { type: "button", onclick: act }, words);
  const both = (words) => runs().map((run) => words(data, state, run));
  const link = () => location.href.replace(/#.*$/, "") + toHash(pages, state);
  $("out").append(
    button("Copy the address", () => copy(link(), "The address was")),
    button("Copy as command", () => copy(both(toCommand).join("\n"), "The command was")),
    button("Copy A as TOML", () => copy(toToml(data, state, "a"), "The scenario was")),
    button("Copy B as TOML", () => copy(toToml(data, state, "b"), "The scenario was")),
    button("Save what is seen as CSV", saveSeen),
    button("Save a picture", savePicture),
  );
}

// -- Events

function listen() {
  const setRate = (rate) => set("plant.angular_rate", rate); // rad/s
  const rate = () => valueOf("plant.angular_rate", "a");
  $("play").addEventListener("click", () => (playing ? pause() : play()));
  $("step").addEventListener("click", oneStep);
  $("restart").addEventListener("click", restart);
  $("kick").addEventListener("click", () => kick([TAP, 0]));
  $("rate").addEventListener("input", () => setRate(Number($("rate").value) / degrees()));
  $("rate-double").addEventListener("click", () => setRate(2 * rate()));
  $("rate-reverse").addEventListener("click", () => setRate(-rate()));
  $("rate-zero").addEventListener("click", () => setRate(0));
  $("speed").addEventListener("input", () => {
    state.speed = Number((10 ** $("speed").value).toPrecision(3));
    showSpeed();
    remember();
  });
  $("window").addEventListener("change", () => {
    state.window = Number($("window").value);
    dirty = true;
    remember();
  });
  $("plot").append(...LARGE.map((key, i) => element("option", { value: key }, TITLES[i])));
  $("plot").addEventListener("change", () => {
    state.plot = $("plot").value;
    arrange();
    remember();
  });
  $("peaks").addEventListener("change", () => {
    state.peaks = $("peaks").checked;
    dirty = true;
    remember();
  });
  $("example").addEventListener("click", () => editor.show(EXAMPLE, ""));
  for (const event of ["pointermove", "pointerup", "toggle"]) {
    $("drawing").addEventListener(event, () => (dirty = true), true);
  }
  document.addEventListener("keydown", onKey);
  $("plot-list").addEventListener("keydown", onArrow);
  $("plot-list").addEventListener("blur", () => moveCursor(null));
  let from = null;
  $("scene").addEventListener("pointerdown", ({ offsetX, offsetY }) => (from = [offsetX, offsetY]));
  addEventListener("pointerup", ({ clientX, clientY }) => {
    if (from) {
      const { left, top } = $("scene").getBoundingClientRect();
      const [x, y] = scene.inFrame(clientX - left - from[0], clientY - top - from[1]);
      kick([x * TAP, y * TAP]);
      from = null;
    }
  });
  addEventListener("pointercancel", () => (from = null));
  addEventListener("hashchange", fromAddress);
  new ResizeObserver(() => (dirty = true)).observe(document.body);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", readTheme);
}

function onKey(event) {
  const { target, key, ctrlKey, metaKey, altKey } = event;
  const takesKeys = target.closest("input:not([type=range]):not([type=checkbox]), select, textarea");
  const act = { " ": () => (playing ? pause() : play()), ".": oneStep, r: restart, k: () => kick([TAP, 0]) }[
    key.toLowerCase()
  ];
  if (!act || takesKeys || ctrlKey || metaKey || altKey || !$("keys").checked) {
    return;
  }
  if (key === " " && target.closest("button, a, summary, input[type=checkbox]")) {
    return;
  }
  event.preventDefault();
  act();
}

function onArrow(event) {
  const way = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (event.key === "Escape") {
    moveCursor(null);
  }
  if (way) {
    event.preventDefault();
    const { from, to } = view();
    moveCursor(Math.max(from, Math.min(to, (cursor ?? to) + (way * (to - from)) / (event.shiftKey ? 10 : 100))));
  }
}

// The ranges for the preset's gyroscope.
function showRanges() {
  const rate = degrees() * Math.abs(data.base.settings["plant.angular_rate"]);
  const most = Number((3 * rate || 300).toPrecision(2));
  Object.assign($("rate"), { min: -most, max: most, step: most / 300 });
  Object.assign($("speed"), { min: Math.log10(data.speeds.minimum), max: Math.log10(data.speeds.maximum) });
  plots[0].least = Math.min(20, 0.2 * rate || 20);
  const label = (units) => `${Number((units * unitOfTime()).toPrecision(3))} ms`;
  $("window").replaceChildren(...data.windows.map((units) => element("option", { value: units }, label(units))));
}

// Shows the page of the address; if there is no such page, the first preset and the reason.
async function fromAddress() {
  let why = "";
  try {
    state = fromHash(all, pages, location.hash, state?.code);
  } catch (error) {
    why = error.message;
    state = stateOf(pages[0]);
  }
  data = dataOf(all, pages, state);
  showRanges();
  if (!(await restart())) {
    why = $("problem").textContent;
    state = stateOf(pages.find(({ key }) => key === state.preset));
    await restart();
  }
  build();
  problem(why);
}

async function main() {
  all = JSON.parse(new TextDecoder().decode(await unpacked("data")));
  pages = all.presets ?? presets;
  readTheme();
  const source = new Blob([await unpacked("worker")], { type: "text/javascript" });
  workerSource = URL.createObjectURL(source);
  wasm = await unpacked("module");
  await startWorker();
  $("presets").append(
    ...pages.map(({ key, title }) => element("li", {}, element("a", { href: `#${key}` }, title))),
  );
  $("version").textContent = `fracgyro ${all.version}`;
  buildPlots();
  buildOut();
  listen();
  await fromAddress();
  requestAnimationFrame(frame);
  if (!still.matches) {
    play();
  }
}

main().catch((error) => problem(error.message));
