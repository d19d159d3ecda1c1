// Runs the loops apart from the page: one or two, sample by sample, on the same noise.
//
// Messages are answered one after another: { is: "load" | "start" | "advance" | "set" | "kick" | "csv", id, … } by the
// same with what was found, or with the sentence of a `problem`, and the `line` of the visitor's function.
import { load } from "../fracgyro.mjs";
import { CHANNELS, PER_CHANNEL, channelsOf } from "./channels.mjs";
import { failureOf, lawOf, plantOf } from "./law.mjs";

const KEPT = 8192; // rows of a run for the CSV file, one of each bin

let fracgyro;
let runs = [];
let binSamples = 1;
let code = ""; // the visitor's function
let failed = false; // it has ended the run: the loop cannot continue

class Run {
  #scenario;
  #loop;
  #write;
  #binned = 0; // samples in the bin that is not full
  #bin = new Float64Array(PER_CHANNEL * CHANNELS.length);
  #point = new Float64Array(CHANNELS.length);
  #kept = []; // [sample, row]

  constructor(scenario, loop) {
    this.#loop = loop;
    this.#known(scenario);
  }
  #known(scenario) {
    this.#scenario = scenario;
    this.#write = channelsOf(scenario, this.columns);
  }

  get columns() {
    return this.#loop.columns;
  }
  get diverged() {
    return this.#loop.diverged;
  }

  // Returns what takes it back.
  set(changes) {
    const before = this.#scenario;
    this.#loop.set(changes);
    this.#known({ ...before, settings: { ...before.settings, ...changes } });
    return () => this.set(Object.fromEntries(Object.keys(changes).map((name) => [name, before.settings[name]])));
  }
  kick(velocity) {
    this.#loop.kick(velocity);
  }

  // The coming samples, of which the first has this number. Returns the bins that became full, as in history.mjs; the
  // channels of the last sample; and all of its row.
  advance(first, samples) {
    const width = this.columns.length;
    const rows = this.#loop.run(samples);
    const count = rows.length / width;
    const bins = new Float64Array(Math.floor((this.#binned + count) / binSamples) * this.#bin.length);
    let end = 0;
    for (let n = 0; n < count; ++n) {
      this.#write(rows, n * width, this.#point);
      this.#add();
      if (this.#binned === binSamples) {
        bins.set(this.#bin, end);
        end += this.#bin.length;
        this.#binned = 0;
        this.#kept.push([first + n, rows.slice(n * width, (n + 1) * width)]);
      }
    }
    if (this.#kept.length > 2 * KEPT) {
      this.#kept = this.#kept.slice(-KEPT);
    }
    return { count, bins, point: this.#point.slice(), row: rows.slice(Math.max(0, count - 1) * width) };
  }
  #add() {
    for (let i = 0; i < CHANNELS.length; ++i) {
      const number = this.#point[i];
      const at = PER_CHANNEL * i;
      if (this.#binned === 0) {
        this.#bin[at] = this.#bin[at + 1] = number;
        this.#bin[at + 3] = this.#bin[at + 4] = 0;
      } else if (number < this.#bin[at]) {
        this.#bin[at] = number;
      } else if (number > this.#bin[at + 1]) {
        this.#bin[at + 1] = number;
      }
      this.#bin[at + 2] = number;
      this.#bin[at + 3] += number / binSamples;
      this.#bin[at + 4] += (number * number) / binSamples;
    }
    ++this.#binned;
  }

  // [sample, row] of each bin that is kept, by sample.
  since(sample) {
    return new Map(this.#kept.filter(([at]) => at >= sample));
  }
}

const answer = {
  async load({ wasm, data }) {
    fracgyro = await load({ wasm, data });
  },

  // step: the one that the numbers of a device are for.
  async start({ scenarios, bin, step, code: text }) {
    code = text;
    failed = false;
    const started = async (scenario) => {
      const { settings, yours, ...rest } = scenario;
      const stated = { ...rest, settings: { ...settings, "run.step": step } };
      const law = yours ? lawOf(code, plantOf(scenario)) : undefined;
      return fracgyro.loop(stated, { "run.step": settings["run.step"] }, { law });
    };
    const loops = await Promise.all(scenarios.map(started));
    runs = loops.map((loop, i) => new Run(scenarios[i], loop));
    binSamples = bin;
    return { columns: runs.map((run) => run.columns) };
  },

  advance({ first, samples }) {
    failed = true; // unless all goes well
    const found = runs.map((run) => run.advance(first, samples));
    failed = false;
    return { samples, found, diverged: runs.map((run) => run.diverged) };
  },

  // Changes of each run: all of them or none.
  set({ changes }) {
    if (failed) {
      return; // the page starts again
    }
    const back = [];
    try {
      runs.forEach((run, i) => back.push(run.set(changes[i])));
    } catch (error) {
      back.forEach((undo) => undo());
      throw error;
    }
  },

  kick({ velocity }) {
    if (!failed) {
      runs.forEach((run) => run.kick(velocity));
    }
  },

  // History from that sample on, one row for each bin.
  csv({ since, step }) {
    const seen = runs.map((run) => run.since(since));
    const prefix = (i) => (runs.length > 1 ? `${"ab"[i]}.` : "");
    const names = runs.flatMap(({ columns }, i) => columns.map((name) => prefix(i) + name));
    const samples = [...new Set(seen.flatMap((rows) => [...rows.keys()]))];
    const lines = samples.map((sample) => {
      const cells = runs.flatMap(({ columns }, i) => [...(seen[i].get(sample) ?? columns.map(() => ""))]);
      return [sample * step, ...cells].join(",");
    });
    return { text: [["time", ...names].join(","), ...lines, ""].join("\n") };
  },
};

let last = Promise.resolve();
onmessage = ({ data: message }) => {
  last = last.then(async () => {
    const { is, id } = message;
    try {
      postMessage({ is, id, ...(await answer[is](message)) });
    } catch (error) {
      postMessage({ is, id, ...(failureOf(error, code) ?? { problem: error.message }) });
    }
  });
};
