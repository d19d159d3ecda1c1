// History of the runs: for each bin of samples the minimum, the maximum and the last value of every channel.
import { CHANNELS } from "./channels.mjs";

const WIDTH = 3 * CHANNELS.length;
const CAPACITY = 16384; // bins

export class History {
  #bins = [];

  // `bin`: how long one is; `step`: how long a sample.
  constructor(runs, bin, step) {
    this.bin = bin;
    this.step = step;
    this.#bins = Array.from({ length: runs }, () => ({ count: 0, numbers: new Float64Array(CAPACITY * WIDTH) }));
  }

  get runs() {
    return this.#bins.length;
  }
  // Number of bins of a run.
  count(run) {
    return this.#bins[run].count;
  }
  first(run) {
    return Math.max(0, this.#bins[run].count - CAPACITY);
  }

  add(run, numbers) {
    const bins = this.#bins[run];
    for (let from = 0; from < numbers.length; from += WIDTH) {
      bins.numbers.set(numbers.subarray(from, from + WIDTH), (bins.count % CAPACITY) * WIDTH);
      ++bins.count;
    }
  }

  least(run, channel, i) {
    return this.#bins[run].numbers[(i % CAPACITY) * WIDTH + 3 * channel];
  }
  largest(run, channel, i) {
    return this.#bins[run].numbers[(i % CAPACITY) * WIDTH + 3 * channel + 1];
  }
  // At the bin's last sample.
  last(run, channel, i) {
    return this.#bins[run].numbers[(i % CAPACITY) * WIDTH + 3 * channel + 2];
  }
  // When that sample is, of the bin i.
  time(i) {
    return (i + 1) * this.bin - this.step;
  }
  // The bin whose last sample is nearest.
  at(time) {
    return Math.round((time + this.step) / this.bin) - 1;
  }
}
