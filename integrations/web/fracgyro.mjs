// fracgyro in a browser or in node: runs, closed loops that are tuned while they run, and the controller by itself.
//
//     import { load } from "./fracgyro.mjs";
//     const fracgyro = await load();
//     const run = await fracgyro.simulate(fracgyro.paper.corrected, { "controller.order": 0.8, "run.duration": 20 });
//     run.time, run.column("error.x");
//
// Settings bear the names and units of a scenario's fields, with [0], .x or .xx for parts; `fracgyro.fields` has
// their meanings and ranges. `fracgyro export web my.toml --out my.json` makes a scenario of your own. Types are in
// fracgyro.d.ts.

// Loads the module and its data, by default from this file's folder. In node, which cannot fetch files, pass both.
// `single`: the module whose controllers compute in single precision, and which has no loop.
export async function load({ wasm, data, single = false } = {}) {
  const fetched = async (name) => {
    const response = await fetch(new URL(name, import.meta.url));
    if (!response.ok) {
      throw new Error(`${name} cannot be loaded: the server answered ${response.status}`);
    }
    return response;
  };
  data ??= await (await fetched("fracgyro.json")).json();
  wasm ??= await (await fetched(single ? "fracgyro-single.wasm" : "fracgyro.wasm")).arrayBuffer();
  return new Fracgyro(await WebAssembly.compile(wasm), data);
}

const LARGEST_RECORD = 2e9; // bytes
const BUFFERED = 4096; // rows
const INPUTS = 11; // numbers of a sample that a law is given
// The guard's verdict on a sample, by number; 5 is a rejected saved state.
const STATUSES = ["ok", "saturated", "not_finite", "out_of_range", "restarted", "", "implausible", "lost"];
// Numbers of the datasheet that the filter of the measured motions needs.
const FILTERED = ["force_noise", "position_noise", "velocity_noise", "delay"];
// Numbers of the event trigger, and of the disturbance observer around a controller.
const TRIGGER = ["event_threshold", "event_share"];
const COMPENSATION = "compensation_bandwidth";
// Numbers of the datasheet by which measurements are corrected.
const PICKOFFS = ["pickoff_gain_error[0]", "pickoff_gain_error[1]", "pickoff_misalignment"];

const channelOf = (column) => column.split(/[.[]/)[0];

class Fracgyro {
  #module;
  #data;

  constructor(module, data) {
    this.#module = module;
    this.#data = data;
    this.version = data.version;
    this.single = !WebAssembly.Module.exports(module).some(({ name }) => name === "loop_start");
    this.fields = data.fields;
    this.paper = data.paper;
  }

  // The closed loop from t = 0 to run.duration.
  async simulate(scenario, changes = {}, { law } = {}) {
    const { settings, loop } = await this.#started(scenario, changes, law);
    const { "run.step": step, "run.record_every": every } = settings;
    const samples = stepsOf(settings) + 1;
    const width = loop.columns.length;
    const rows = roomFor(Math.ceil(samples / every) * width, () => {
      const why = `as ${Math.ceil(samples / every)} samples do not fit into memory`;
      return `run.record_every is ${every}: it must be larger, ${why}`;
    });
    const length = loop.runInto(rows, samples, every);
    const time = Float64Array.from({ length }, (_, i) => i * (step * every));
    const column = (name) => {
      const at = loop.columns.indexOf(name);
      if (at < 0) {
        throw new RangeError(`${name} is not a column; known are ${loop.columns.join(", ")}`);
      }
      return Float64Array.from({ length }, (_, i) => rows[i * width + at]);
    };
    const diverged = loop.diverged ? loop.samples * step : null;
    return { time, columns: loop.columns, column, diverged, rows: rows.subarray(0, length * width) };
  }

  // The closed loop in parts, from t = 0 on; it may go beyond run.duration.
  async loop(scenario, changes = {}, { law } = {}) {
    const { settings, sensing, core, loop, valuesOf } = await this.#started(scenario, changes, law);
    const step = settings["run.step"];
    const first = { ...settings };
    // The key identifies the start of the loop; kind, sensors and exponentials are not among the values.
    const design = ["controller.kind", "device.sensing", "run.kernel_tolerance"];
    const { reference = null, device = null, volts = null } = scenario;
    const started = [design.map((name) => first[name]), sensing, valuesOf(first), reference, device, volts];
    const key = utf8(`fracgyro ${this.version} loop 2 ${checksum(utf8(JSON.stringify(started))).toString(16)}\n`);
    const saved = () => {
      if (law) {
        throw new RangeError("state cannot be saved or set: the memory of a law of your own is not in it");
      }
      return core.bytes(core.loop_saved(), core.loop_saved_size());
    };
    const checked = (before, changes) => this.#checked(before, changes);
    const isFixed = (name) => this.fields[name].fixed;
    // Returns true if a running loop accepts these settings.
    const takes = (wanted) => {
      const values = valuesOf(wanted);
      core.doubles(core.setting_values(), values.length).set(values);
      const can = core.loop_set();
      if (can) {
        Object.assign(settings, wanted);
      }
      return can;
    };
    return {
      columns: loop.columns,
      get time() {
        return loop.samples * step;
      },
      get diverged() {
        return loop.diverged ? loop.samples * step : null;
      },
      run(samples, every = 1) {
        for (const [name, value] of Object.entries({ samples, every })) {
          if (!Number.isSafeInteger(value) || value < 1 || value > 1e9) {
            throw new RangeError(`${name} is ${value}: it must be a whole number from 1 to 1000000000`);
          }
        }
        const ahead = Math.ceil((loop.samples + samples) / every) - Math.ceil(loop.samples / every);
        const rows = roomFor(ahead * loop.columns.length, () => {
          return `samples is ${samples}: it must be smaller, as ${ahead} rows do not fit into memory`;
        });
        return rows.subarray(0, loop.runInto(rows, samples, every) * loop.columns.length);
      },
      set(changes) {
        checked(settings, changes);
        const kept = Object.keys(changes).find(isFixed);
        if (kept) {
          throw new RangeError(`${kept} cannot be set while the loop runs: it acts only at the start`);
        }
        if (!takes({ ...settings, ...changes })) {
          const names = Object.keys(changes).join(", ");
          throw new RangeError(`${names} cannot be set while the loop runs: the controller would be another one`);
        }
      },
      kick(velocity) {
        if (velocity.length !== 2 || !velocity.every(Number.isFinite)) {
          throw new RangeError(`velocity is ${velocity}: it must be two finite numbers`);
        }
        core.loop_kick(...velocity);
      },
      get state() {
        saved(); // refuses a law
        core.loop_save();
        const content = joined(utf8(`${JSON.stringify(settings, toJson)}\n`), saved());
        return joined(key, bytesOf(checksum(content)), content);
      },
      set state(bytes) {
        const own = ownPart(bytes, key, "by a loop of another scenario");
        const content = own.subarray(4);
        const damaged = () => new RangeError("state is damaged: it is not as it was saved");
        if (!bytesOf(checksum(content)).every((byte, i) => own[i] === byte)) {
          throw damaged();
        }
        const end = content.indexOf(10);
        const wanted = checked(first, JSON.parse(new TextDecoder().decode(content.subarray(0, end))));
        const before = { ...settings };
        if (content.length - (end + 1) !== saved().length || !takes(wanted)) {
          throw damaged();
        }
        saved().set(content.subarray(end + 1));
        if (!core.loop_restore()) {
          takes(before);
          throw damaged();
        }
        loop.diverged = false;
      },
    };
  }

  // The controller by itself. Call `step` once every run.step.
  async controller(scenario, changes = {}) {
    if (scenario.volts?.refusal) {
      throw new RangeError(scenario.volts.refusal);
    }
    const { core, reported, observed } = await this.#prepare(scenario, changes);
    const lasting = reported.filter((column) => !this.#data.momentary.includes(channelOf(column)));
    core.controller_start();
    const number = this.single ? "float" : "double";
    const key = utf8(`fracgyro ${this.version} controller 2 ${core.controller_key() >>> 0} ${number}\n`);
    const saved = () => core.bytes(core.controller_saved(), core.controller_saved_size());
    return {
      step(position, velocity) {
        const motion = [...position, ...(observed ? [0, 0] : velocity)];
        if (motion.length !== 4 || !motion.every((each) => typeof each === "number")) {
          const given = observed ? `position is ${position}: it` : `position and velocity are ${motion}: each`;
          throw new RangeError(`${given} must be two numbers`);
        }
        return [...core.doubles(core.controller_step(...motion), 2)];
      },
      get status() {
        return STATUSES[core.controller_status()];
      },
      get report() {
        const numbers = core.doubles(core.controller_report(), lasting.length);
        const found = {};
        lasting.forEach((column, i) => {
          const channel = channelOf(column);
          found[channel] = channel === column ? numbers[i] : [...(found[channel] ?? []), numbers[i]];
        });
        return found;
      },
      get state() {
        core.controller_save();
        return joined(key, saved());
      },
      set state(bytes) {
        const own = ownPart(bytes, key, "by a controller of another scenario or precision");
        if (own.length === saved().length) {
          saved().set(own);
        }
        if (own.length !== saved().length || !core.controller_restore()) {
          throw new RangeError("state is damaged: it is not as it was saved");
        }
      },
    };
  }

  // A loop, in an instance of its own, that writes rows of its columns. `given`: a law of the caller's, or undefined.
  async #started(scenario, changes, given) {
    if (this.single) {
      throw new Error("fracgyro-single.wasm has no loop: load fracgyro.wasm for runs and loops");
    }
    const law = given && new Law(given, this.#data);
    const prepared = await this.#prepare(scenario, changes, law);
    const { core, settings, observed } = prepared;
    const reported = law ? law.columns : prepared.reported;
    const without = { filter: "none", ...Object.fromEntries([...TRIGGER, COMPENSATION].map((name) => [name, 0])) };
    for (const [name, off] of law ? Object.entries(without) : []) {
      const value = settings[`controller.${name}`];
      if (value !== off) {
        throw new RangeError(`controller.${name} is ${value}: with a law of your own it is ${off}`);
      }
    }
    const around = prepared.sensing.some((number) => number !== 0);
    const device = observed || around || "device" in scenario;
    const voltages = scenario.volts?.electrodes ? this.#data.volts : [];
    const ofDevice = device ? [...this.#data.device, ...voltages] : [];
    const columns = [...this.#data.loop, ...reported, ...ofDevice];
    const width = columns.length;
    const buffer = core.room_for(BUFFERED * width) >>> 0;
    if (law) {
      core.loop_start_law(law.columns.length, law.columns.indexOf("rate_estimate"));
    } else {
      core.loop_start();
    }
    const loop = {
      columns,
      diverged: false,
      get samples() {
        return core.loop_step(); // so far
      },
      // How many rows there are: of the coming samples those that `every` divides.
      runInto(rows, samples, every) {
        const end = this.samples + samples;
        let length = 0;
        while (this.samples < end && !this.diverged) {
          const asked = Math.min(end - this.samples, BUFFERED * every, 1e9);
          const before = Math.ceil(this.samples / every);
          this.diverged = core.loop_run(asked, every, buffer, ofDevice.length) < asked;
          const more = Math.ceil(this.samples / every) - before;
          rows.set(core.doubles(buffer, more * width), length * width);
          length += more;
        }
        return length;
      },
    };
    return { ...prepared, loop };
  }

  // An instance of its own for each loop and each controller: whatever it holds goes with it.
  async #prepare(scenario, changes, law) {
    const settings = this.#checked(scenario.settings, changes);
    const called = (input, output) => {
      law.step(core.doubles(input, INPUTS), core.doubles(output, 2 + law.columns.length));
    };
    const core = new Core(await WebAssembly.instantiate(this.#module, { caller: { law: called } }));
    const steps = stepsOf(settings);
    const { device, disturbance, volts } = scenario;
    if ((device || disturbance) && settings["run.step"] !== scenario.settings["run.step"]) {
      const of = device ? "noise and times of its device" : "times of its disturbance";
      const why = `it must be ${scenario.settings["run.step"]}, which the ${of} are for`;
      throw new RangeError(`run.step is ${settings["run.step"]}: ${why}`);
    }
    if (!(settings["run.duration"] >= settings["run.step"] && steps <= 1e9)) {
      throw new RangeError(`run.duration is ${settings["run.duration"]}: it must be 1 to 1000000000 times run.step`);
    }
    const kind = settings["controller.kind"];
    const { numbers, reported } = this.#data.kinds[kind];
    // In the core's order; a number stands for one that the module finds itself.
    const valuesOf = (wanted) =>
      numbers.map((name) => {
        if (typeof name === "number") {
          return name;
        }
        if (name === "run.steps") {
          return steps;
        }
        const { choices } = this.fields[name];
        return choices ? choices.indexOf(wanted[name]) : (wanted[name] ?? Infinity) / (scenario.scales[name] ?? 1);
      });
    const values = valuesOf(settings);
    core.doubles(core.setting_values(), values.length).set(values);
    const place = this.fields["controller.kind"].choices.indexOf(kind);
    const observed = settings["device.sensing"] === "position";
    const filter = settings["controller.filter"];
    const bandwidth = settings["controller.observer_bandwidth"];
    const assumed = FILTERED.map((name) => settings[`datasheet.${name}`] ?? scenario.assumed?.[name] ?? 0);
    const filters = filter === "kalman" ? [bandwidth, ...assumed] : [0, 0, 0, 0, 0];
    const trigger = TRIGGER.map((name) => settings[`controller.${name}`]);
    const pickoffs = PICKOFFS.map((name) => settings[`datasheet.${name}`]);
    const compensation = settings[`controller.${COMPENSATION}`];
    const sensing = [observed ? bandwidth : 0, ...filters, ...trigger, ...pickoffs, compensation];
    const placed = (numbers) => {
      const at = core.room_for(Math.max(numbers.length, 1)) >>> 0;
      core.doubles(at, numbers.length).set(numbers);
      return at;
    };
    if (disturbance) {
      const terms = disturbance.flatMap((term) => this.#term(term));
      core.disturbance_terms(terms.length, placed(terms));
    }
    const at = device ? placed(this.#numbers(device.numbers, this.#data.device_numbers)) : 0;
    if (device) {
      const { rate, temperature, transverse } = device;
      const points = [rate, temperature].flatMap((both) => [both[0].length, placed(both.flat())]);
      core.device_points(...points, transverse.length, placed(transverse));
    }
    if (volts && !this.single) {
      const list = volts.numbers.map((number) => number ?? Infinity);
      core.device_in_volts(list.length, placed(list));
    }
    const { terms, rows } = scenario.reference ?? { terms: [], rows: [] };
    core.reference_lists(terms.length, placed(terms), rows.length, placed(rows));
    const between = placed(sensing);
    if (!core.setup_done(place, between, settings["run.duration"], settings["run.kernel_tolerance"], at)) {
      throw new RangeError(`run.step is ${settings["run.step"]}: it must lie between 1e-200 and 1e200`);
    }
    if (!core.filter_fits()) {
      throw new RangeError(`controller.filter is ${filter}: ${kind} filters the measurements itself; it must be none`);
    }
    return { core, settings, sensing, reported: reported[core.chosen_type()], observed, valuesOf };
  }

  // A term of the disturbance as a list: its numbers, how many rows it has, and their columns.
  #term({ numbers, rows }) {
    const [{ length }] = rows;
    if (rows.some((column) => column.length !== length || !column.every(Number.isFinite))) {
      throw new RangeError("disturbance has rows of different lengths, or with numbers that are not finite");
    }
    return [...this.#numbers(numbers, this.#data.term_numbers), length, ...rows.flat()];
  }

  // In the core's order.
  #numbers(named, fields) {
    return Object.entries(fields).map(([name, field]) => {
      if (!Object.hasOwn(named, name)) {
        throw new RangeError(`${name} is missing: it must be given`);
      }
      const problem = wrong(named[name], field);
      if (problem) {
        throw new RangeError(`${name} is ${named[name]}: it must be ${problem}`);
      }
      return named[name] ?? Infinity;
    });
  }

  // The settings of the controller's kind, without a scenario's settings for other kinds.
  #checked(stated, changes) {
    const all = { ...stated, ...changes };
    const kind = all["controller.kind"];
    this.#check("controller.kind", kind);
    const { kinds } = this.#data;
    const foreign = new Set(Object.values(kinds).flatMap(({ numbers }) => numbers));
    kinds[kind].numbers.forEach((name) => foreign.delete(name));
    const misplaced = Object.keys(changes).find((name) => foreign.has(name));
    if (misplaced) {
      throw new RangeError(`${misplaced} is not a setting of the controller ${kind}`);
    }
    const names = new Set([...Object.keys(this.fields), ...Object.keys(all)].filter((name) => !foreign.has(name)));
    names.forEach((name) => this.#check(name, all[name]));
    const matrix = (name) => ["xx", "xy", "yy"].map((entry) => all[`${name}.${entry}`]);
    const deviation = matrix("plant.stiffness_deviation");
    const sum = matrix("plant.stiffness").map((number, i) => number + deviation[i]);
    definite("plant.damping", matrix("plant.damping"), true);
    definite("plant.stiffness", matrix("plant.stiffness"), false);
    definite("plant.stiffness plus plant.stiffness_deviation", sum, false);
    return all;
  }

  #check(name, value) {
    if (!Object.hasOwn(this.fields, name)) {
      throw new RangeError(`${name} is not a known setting; see fracgyro.fields`);
    }
    if (value === undefined) {
      throw new RangeError(`${name} is missing: it must be given`);
    }
    const problem = wrong(value, this.fields[name]);
    if (problem) {
      throw new RangeError(`${name} is ${value}: it must be ${problem}`);
    }
  }
}

// A law returned something that is not a force, or is not a law.
export class LawError extends RangeError {}

// A law of the caller's, a function or { force, report }, as the core calls it.
class Law {
  #given;
  #reports = []; // [name, whether it is a pair]

  constructor(given, { loop }) {
    this.#given = typeof given === "function" ? { force: given } : given;
    if (typeof this.#given.force !== "function") {
      throw new LawError("the law must be a function, or have a function force");
    }
    const report = this.#given.report?.() ?? {};
    const taken = Object.keys(report).find((name) => loop.some((column) => channelOf(column) === name));
    if (taken) {
      throw new LawError(`report() of the law has ${taken}, which the loop itself records: choose another name`);
    }
    this.#reports = Object.entries(report).map(([name, value]) => [name, isPair(value)]);
    this.columns = this.#reports.flatMap(([name, pair]) => (pair ? [`${name}.x`, `${name}.y`] : [name]));
    this.#reported();
  }

  #reported() {
    const report = this.#reports.length ? this.#given.report() : {};
    return this.#reports.flatMap(([name, pair]) => {
      const value = report?.[name];
      if (pair ? !isPair(value) : typeof value !== "number") {
        const wanted = pair ? "two numbers" : "a number, or two at every sample";
        throw new LawError(`report() of the law has ${name} ${listed(value)}: it must be ${wanted}`);
      }
      return value;
    });
  }

  // From the numbers of a sample, the force and the reports into `out`.
  step([time, x, y, vx, vy, rx, ry, drx, dry, ax, ay], out) {
    const force = this.#given.force({
      time,
      position: [x, y],
      velocity: [vx, vy],
      reference: [rx, ry],
      reference_velocity: [drx, dry],
      reference_acceleration: [ax, ay],
      error: [x - rx, y - ry],
      error_rate: [vx - drx, vy - dry],
    });
    if (!isPair(force) || !Array.from(force).every(Number.isFinite)) {
      const at = Number(time.toPrecision(9));
      throw new LawError(`the law returned ${listed(force)} at t = ${at}: it must return two finite numbers`);
    }
    out.set(force);
    out.set(this.#reported(), 2);
  }
}

const isPair = (value) =>
  value !== null && typeof value === "object" && value.length === 2 && Array.from(value).every(isNumber);
const isNumber = (value) => typeof value === "number";
const listed = (value) => (value?.length >= 0 && typeof value === "object" ? `[${Array.from(value)}]` : String(value));

// The exports of one instance, and views of its memory.
class Core {
  constructor(instance) {
    Object.assign(this, instance.exports);
  }
  // Valid until the memory grows.
  doubles(at, count) {
    return new Float64Array(this.memory.buffer, at, count);
  }
  bytes(at, count) {
    return new Uint8Array(this.memory.buffer, at, count);
  }
}

// The rule of a scenario, rounding aside.
function definite(name, [xx, xy, yy], semi) {
  const least = xx / 2 + yy / 2 - Math.hypot(xx / 2 - yy / 2, xy);
  const zero = 1e-12 * Math.max(Math.abs(xx), Math.abs(xy), Math.abs(yy));
  if (!(semi ? least >= -zero : least > zero)) {
    throw new RangeError(`${name} is ${[xx, xy, yy]}: it must be positive ${semi ? "semidefinite" : "definite"}`);
  }
}

function wrong(value, field) {
  if (field.choices) {
    return field.choices.includes(value) ? "" : `one of ${field.choices.join(", ")}`;
  }
  if (field.infinite && (value === null || value === Infinity)) {
    return "";
  }
  if (!Number.isFinite(value)) {
    return "a finite number";
  }
  if (field.whole && !Number.isSafeInteger(value)) {
    return "a whole number below 2^53";
  }
  const { minimum, maximum, exclusiveMinimum, exclusiveMaximum } = field;
  const rules = [
    [value < minimum, `at least ${minimum}`],
    [value > maximum, `at most ${maximum}`],
    [value <= exclusiveMinimum, `greater than ${exclusiveMinimum}`],
    [value >= exclusiveMaximum, `less than ${exclusiveMaximum}`],
  ];
  return rules.find(([broken]) => broken)?.[1] ?? "";
}

const stepsOf = (settings) => roundHalfToEven(settings["run.duration"] / settings["run.step"]);

// Throws RangeError with the sentence if `numbers` numbers do not fit in memory.
function roomFor(numbers, sentence) {
  try {
    if (8 * numbers <= LARGEST_RECORD) {
      return new Float64Array(numbers);
    }
  } catch {
    // an allocation that fails throws, too
  }
  throw new RangeError(sentence());
}

const utf8 = (text) => new TextEncoder().encode(text);
const bytesOf = (sum) => new Uint8Array(Uint32Array.of(sum).buffer);
// JSON has no infinity: null is none.
const toJson = (_, value) => (value === Infinity ? null : value);

function joined(...parts) {
  const all = new Uint8Array(parts.reduce((length, part) => length + part.length, 0));
  let end = 0;
  for (const part of parts) {
    all.set(part, end);
    end += part.length;
  }
  return all;
}

// The part of a saved state that follows the key.
function ownPart(bytes, key, other) {
  if (!(bytes instanceof Uint8Array)) {
    throw new TypeError("state must be a Uint8Array, as it was saved");
  }
  if (bytes.length <= key.length || !key.every((byte, i) => bytes[i] === byte)) {
    throw new RangeError(`state was saved by another version, or ${other}`);
  }
  return bytes.subarray(key.length);
}

// CRC-32, as in saved.hpp.
function checksum(bytes) {
  let sum = ~0;
  for (const byte of bytes) {
    sum ^= byte;
    for (let bit = 0; bit < 8; ++bit) {
      sum = (sum >>> 1) ^ (sum & 1 ? 0xedb88320 : 0);
    }
  }
  return ~sum >>> 0;
}

// Rounds halves to even, like Python.
function roundHalfToEven(value) {
  const below = Math.floor(value);
  return value - below === 0.5 ? below + (below % 2) : Math.round(value);
}
