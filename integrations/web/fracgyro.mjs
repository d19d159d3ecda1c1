// fracgyro in a browser or in node: the simulator, and the controller by itself, one sample at a time.
//
//     import { load } from "./fracgyro.mjs";
//     const fracgyro = await load();
//     const run = await fracgyro.simulate(fracgyro.paper.corrected, { "controller.order": 0.8, "run.duration": 20 });
//     run.time, run.column("error.x");
//
// Settings bear the names and units of a scenario's fields, with [0], .x or .xx for parts; `fracgyro.fields` has
// their meanings and ranges. `fracgyro export web my.toml --out my.json` makes a scenario of your own. Types are in
// fracgyro.d.ts.

// The module and its data, by default from beside this file. In node, which fetches no files, hand both over.
export async function load({ wasm, data } = {}) {
  const fetched = async (name) => {
    const response = await fetch(new URL(name, import.meta.url));
    if (!response.ok) {
      throw new Error(`${name} cannot be loaded: the server says ${response.status}`);
    }
    return response;
  };
  data ??= await (await fetched("fracgyro.json")).json();
  wasm ??= await (await fetched("fracgyro.wasm")).arrayBuffer();
  return new Fracgyro(await WebAssembly.compile(wasm), data);
}

const LARGEST_RECORD = 2e9; // bytes
// What the guard thinks of a sample, by number; 5 is a saved state refused.
const STATUSES = ["ok", "saturated", "not_finite", "out_of_range", "restarted", "", "implausible", "lost"];

const channelOf = (column) => column.split(/[.[]/)[0];

class Fracgyro {
  #module;
  #data;

  constructor(module, data) {
    this.#module = module;
    this.#data = data;
    this.version = data.version;
    this.fields = data.fields;
    this.paper = data.paper;
  }

  // The closed loop from t = 0 to run.duration.
  async simulate(scenario, changes = {}) {
    const { core, settings, steps, reported, observed } = await this.#prepare(scenario, changes);
    const every = settings["run.record_every"];
    const device = observed || "device" in scenario;
    const columns = [...this.#data.loop, ...reported, ...(device ? this.#data.device : [])];
    const samples = Math.floor(steps / every) + 1;
    const fits = 8 * columns.length * samples <= LARGEST_RECORD;
    const room = fits && core.room_for(columns.length * samples) >>> 0;
    if (!room) {
      const why = `as ${samples} samples do not fit into memory`;
      throw new RangeError(`run.record_every is ${every}: it must be larger, ${why}`);
    }
    const lasted = core.simulate(every, room, device);
    const rows = core.doubles(room, columns.length * samples);
    const length = Math.ceil(lasted / every);
    const time = Float64Array.from({ length }, (_, i) => i * (settings["run.step"] * every));
    const column = (name) => {
      const at = columns.indexOf(name);
      if (at < 0) {
        throw new RangeError(`${name} is no column; known are ${columns.join(", ")}`);
      }
      return Float64Array.from({ length }, (_, i) => rows[i * columns.length + at]);
    };
    const diverged = lasted <= steps ? lasted * settings["run.step"] : null;
    return { time, columns, column, diverged, rows: rows.subarray(0, length * columns.length) };
  }

  // The controller by itself, in double or in single precision. Call `step` once every run.step.
  async controller(scenario, changes = {}, { single = false } = {}) {
    const { core, reported, observed } = await this.#prepare(scenario, changes);
    const lasting = reported.filter((column) => !this.#data.momentary.includes(channelOf(column)));
    core.controller_start(single);
    const number = single ? "float" : "double";
    const key = new TextEncoder().encode(`fracgyro ${this.version} ${core.controller_key() >>> 0} ${number}\n`);
    const saved = () => new Uint8Array(core.memory.buffer, core.controller_saved(), core.controller_saved_size());
    return {
      step(position, velocity) {
        const motion = [...position, ...(observed ? [0, 0] : velocity)];
        if (motion.length !== 4 || !motion.every(Number.isFinite)) {
          const given = observed ? `position is ${position}: it` : `position and velocity are ${motion}: each`;
          throw new RangeError(`${given} must be two finite numbers`);
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
        return Uint8Array.of(...key, ...saved());
      },
      set state(bytes) {
        if (!(bytes instanceof Uint8Array)) {
          throw new TypeError("state must be a Uint8Array, as it was saved");
        }
        if (bytes.length <= key.length || !key.every((byte, i) => bytes[i] === byte)) {
          const other = "another version, or by a controller of another scenario or precision";
          throw new RangeError(`state was saved by ${other}`);
        }
        const own = bytes.subarray(key.length);
        if (own.length === saved().length) {
          saved().set(own);
        }
        if (own.length !== saved().length || !core.controller_restore()) {
          throw new RangeError("state is damaged: it is not as it was saved");
        }
      },
    };
  }

  // An instance of its own for each run and each controller: whatever it holds goes with it.
  async #prepare(scenario, changes) {
    const settings = this.#checked(scenario.settings, changes);
    const core = new Core(await WebAssembly.instantiate(this.#module));
    const steps = roundHalfToEven(settings["run.duration"] / settings["run.step"]);
    const { device } = scenario;
    if (device && settings["run.step"] !== scenario.settings["run.step"]) {
      const why = `it must be ${scenario.settings["run.step"]}, which the noise and times of its device are for`;
      throw new RangeError(`run.step is ${settings["run.step"]}: ${why}`);
    }
    if (!(settings["run.duration"] >= settings["run.step"] && steps <= 1e9)) {
      throw new RangeError(`run.duration is ${settings["run.duration"]}: it must be 1 to 1000000000 times run.step`);
    }
    const kind = settings["controller.kind"];
    const { numbers, reported } = this.#data.kinds[kind];
    // A number stands for one that the module finds itself.
    const values = numbers.map((name) => {
      if (typeof name === "number") {
        return name;
      }
      if (name === "run.steps") {
        return steps;
      }
      const { choices } = this.fields[name];
      return choices ? choices.indexOf(settings[name]) : (settings[name] ?? Infinity) / (scenario.scales[name] ?? 1);
    });
    core.doubles(core.setting_values(), values.length).set(values);
    const place = this.fields["controller.kind"].choices.indexOf(kind);
    const observed = settings["device.sensing"] === "position";
    const bandwidth = observed ? settings["controller.observer_bandwidth"] : 0;
    const at = device ? core.room_for(device.length) : 0;
    if (device) {
      core.doubles(at, device.length).set(device.map((number) => number ?? Infinity));
    }
    if (!core.setup_done(place, bandwidth, settings["run.duration"], settings["run.kernel_tolerance"], at)) {
      throw new RangeError(`run.step is ${settings["run.step"]}: it must lie between 1e-200 and 1e200`);
    }
    return { core, settings, steps, reported: reported[core.chosen_type()], observed };
  }

  // The settings of the kind. What a scenario says of another one's is left out.
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

// The exports of one instance, and views of its memory.
class Core {
  constructor(instance) {
    Object.assign(this, instance.exports);
  }
  doubles(at, count) {
    return new Float64Array(this.memory.buffer, at, count);
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

// As Python rounds.
function roundHalfToEven(value) {
  const below = Math.floor(value);
  return value - below === 0.5 ? below + (below % 2) : Math.round(value);
}
