// Two views of the error of the estimated rate: its power spectrum and its Allan deviation, from means of equal bins.

const SEGMENTS = 8; // at least; each overlaps the next by half, and the spectrum is their average
const LONGEST = 2048; // maximum number of bins in a segment
const FEWEST = 32; // bins; with less there is no view

// The means of a run's bins from one time to another, without those that have no estimate.
export function errorsOf(history, run, channel, from, to) {
  const end = Math.min(history.count(run), history.at(to) + 1);
  const found = [];
  for (let i = Math.max(history.first(run), history.at(from)); i < end; ++i) {
    const mean = history.mean(run, channel, i);
    if (Number.isFinite(mean)) {
      found.push(mean);
    }
  }
  return found;
}

// Points [frequency, amplitude density] of numbers that are `apart` seconds: the root of the one-sided power density,
// in their unit over root Hz, by Welch's method with a Hann window. Empty for too few numbers.
export function spectrum(numbers, apart) {
  const most = Math.min(LONGEST, (2 * numbers.length) / (SEGMENTS + 1));
  const length = 2 ** Math.floor(Math.log2(most));
  if (!(length >= FEWEST)) {
    return [];
  }
  const hann = Float64Array.from({ length }, (_, i) => Math.sin((Math.PI * (i + 0.5)) / length) ** 2);
  const energy = hann.reduce((sum, weight) => sum + weight * weight, 0);
  const power = new Float64Array(length / 2 + 1);
  let segments = 0;
  for (let begin = 0; begin + length <= numbers.length; begin += length / 2) {
    const part = numbers.slice(begin, begin + length);
    const mean = part.reduce((sum, number) => sum + number, 0) / length;
    const re = Float64Array.from(part, (number, i) => hann[i] * (number - mean));
    const im = new Float64Array(length);
    transform(re, im);
    power.forEach((_, k) => (power[k] += re[k] * re[k] + im[k] * im[k]));
    ++segments;
  }
  const density = (2 * apart) / energy / segments;
  // The window spreads the mean, which was removed, over the first two.
  return Array.from(power, (sum, k) => [k / (length * apart), Math.sqrt(density * sum)]).slice(2, -1);
}

// Fourier transform in place, of a power of two of numbers.
function transform(re, im) {
  const length = re.length;
  for (let i = 1, j = 0; i < length; ++i) {
    let bit = length >> 1;
    for (; j & bit; bit >>= 1) {
      j ^= bit;
    }
    j ^= bit;
    if (i < j) {
      [re[i], re[j]] = [re[j], re[i]];
      [im[i], im[j]] = [im[j], im[i]];
    }
  }
  for (let size = 2; size <= length; size *= 2) {
    for (let k = 0; k < size / 2; ++k) {
      const [cosine, sine] = [Math.cos((2 * Math.PI * k) / size), -Math.sin((2 * Math.PI * k) / size)];
      for (let i = k; i < length; i += size) {
        const j = i + size / 2;
        const [x, y] = [re[j] * cosine - im[j] * sine, re[j] * sine + im[j] * cosine];
        [re[j], im[j]] = [re[i] - x, im[i] - y];
        [re[i], im[i]] = [re[i] + x, im[i] + y];
      }
    }
  }
}

// Points [averaging time, deviation] of numbers that are means over `apart` seconds: the overlapping Allan deviation,
// in their unit, at averaging times that grow by the root of 2 up to a fifth of the record. Empty for too few numbers.
export function allan(numbers, apart) {
  if (numbers.length < FEWEST) {
    return [];
  }
  const sums = new Float64Array(numbers.length + 1);
  numbers.forEach((number, i) => (sums[i + 1] = sums[i] + number));
  const found = [];
  for (let k = 0, size = 1; 5 * size <= numbers.length; size = Math.max(size + 1, Math.round(2 ** (++k / 2)))) {
    let squares = 0;
    const count = numbers.length - 2 * size + 1;
    for (let i = 0; i < count; ++i) {
      const difference = sums[i + 2 * size] - 2 * sums[i + size] + sums[i];
      squares += difference * difference;
    }
    found.push([size * apart, Math.sqrt(squares / count / 2) / size]);
  }
  return found;
}
