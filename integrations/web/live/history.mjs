// History of the runs: for each bin of samples the minimum, maximum, last value, mean and mean square of every channel.
import { CHANNELS, PER_CHANNEL } from "./channels.mjs";

const WIDTH = PER_CHANNEL * CHANNELS.length;
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

  #number(run, channel, i, which) {
    return this.#bins[run].numbers[(i % CAPACITY) * WIDTH + PER_CHANNEL * channel + which];
  }
  least(run, channel, i) {
    return this.#number(run, channel, i, 0);
  }
  largest(run, channel, i) {
    return this.#number(run, channel, i, 1);
  }
  // At the bin's last sample.
  last(run, channel, i) {
    return this.#number(run, channel, i, 2);
  }
  mean(run, channel, i) {
    return this.#number(run, channel, i, 3);
  }
  // Root mean square over all samples of the bins from one time to another; NaN without such bins.
  rms(run, channel, from, to) {
    const end = Math.min(this.count(run), this.at(to) + 1);
    let [sum, count] = [0, 0];
    for (let i = Math.max(this.first(run), this.at(from)); i < end; ++i) {
      sum += this.#number(run, channel, i, 4);
      ++count;
    }
    return Math.sqrt(sum / count);
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
