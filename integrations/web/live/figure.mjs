// A figure that a visitor draws, as a reference: points of a closed line, and its Fourier series.

const HARMONICS = 8;
const SAMPLES = 256; // points at equal distances along the line
const FARTHEST = 2; // coordinate of a point, q0
const MOST = 200; // points
const KEPT = 40; // points of a drawn line

const numbersOf = (points) => points.map((point) => point.join(" ")).join(", ");
const circle = (of, count) => numbersOf(Array.from({ length: count }, (_, i) => of((2 * Math.PI * i) / count)));
const rounded = ([x, y]) => [x, y].map((a) => Number(a.toFixed(2)) || 0);

// Ready ones, by name.
export const FIGURES = {
  circle: circle((a) => rounded([Math.cos(a), Math.sin(a)]), 24),
  square: "1 1, -1 1, -1 -1, 1 -1",
  star: circle((a) => rounded([-Math.sin(a), Math.cos(a)].map((c) => c * (Math.cos(5 * a) > 0 ? 1 : 0.45))), 10),
  heart: circle(
    (a) =>
      rounded([
        Math.sin(a) ** 3,
        (13 * Math.cos(a) - 5 * Math.cos(2 * a) - 2 * Math.cos(3 * a) - Math.cos(4 * a) + 3) / 16,
      ]),
    24,
  ),
};

// The points [x, y] of a text such as "1 0, 0 1, -1 0". Throws RangeError, in one sentence.
export function pointsOf(text) {
  const refuse = (what) => {
    throw new RangeError(`figure ${what}, such as 1 0, 0 1, -1 0`);
  };
  const points = text.split(",").map((point) => {
    const words = point.trim().split(/\s+/);
    const numbers = words.map(Number);
    if (words.length !== 2 || !numbers.every((number) => Math.abs(number) <= FARTHEST)) {
      refuse(`has the point ${point.trim() || "of nothing"}: it must be x and y from −${FARTHEST} to ${FARTHEST}`);
    }
    return numbers;
  });
  if (points.length < 3 || points.length > MOST) {
    refuse(`has ${points.length} points: it must have 3 to ${MOST}`);
  }
  if (lengthsOf(points).at(-1) === 0) {
    refuse("has no length: its points must differ");
  }
  return points;
}

// The text of a line that was drawn; "" if it is too short for a figure.
export function textOf(line) {
  return line.length < 3 || lengthsOf(line).at(-1) < 0.5 ? "" : numbersOf(alongside(line, KEPT).map(rounded));
}

// The sums of sines that follow the closed line through these points at a constant speed, nearly, once a period of the
// frequency: the mean [x, y] and, of each sine, amplitude, frequency and phase, each x, y.
export function seriesOf(points, frequency) {
  const samples = alongside(points, SAMPLES);
  const short = (number) => Number(number.toFixed(6)) || 0;
  const axes = [0, 1].map((axis) => samples.map((sample) => sample[axis]));
  const mean = axes.map((samples) => short(samples.reduce((sum, a) => sum + a, 0) / SAMPLES));
  const terms = [];
  for (let n = 1; n <= HARMONICS; ++n) {
    const [x, y] = axes.map((samples) => {
      const share = (wave) => samples.reduce((sum, a, i) => sum + a * wave((2 * Math.PI * n * i) / SAMPLES), 0);
      const [cosine, sine] = [share(Math.cos), share(Math.sin)];
      const amplitude = short((2 / SAMPLES) * Math.hypot(cosine, sine));
      return [amplitude, amplitude && short(Math.atan2(cosine, sine))];
    });
    if (x[0] || y[0]) {
      terms.push(x[0], y[0], n * frequency, n * frequency, x[1], y[1]);
    }
  }
  return { mean, terms };
}

// How far it is from the first point along the closed line to each, and back to the first.
function lengthsOf(points) {
  let length = 0;
  return points.map(([x, y], i) => {
    const [nextX, nextY] = points[(i + 1) % points.length];
    return (length += Math.hypot(nextX - x, nextY - y));
  });
}

// `count` points at equal distances along the closed line, from its first point on.
function alongside(points, count) {
  const ends = lengthsOf(points);
  const whole = ends.at(-1);
  let side = 0;
  return Array.from({ length: count }, (_, i) => {
    const at = (whole * i) / count;
    while (ends[side] <= at) {
      ++side;
    }
    const begin = side ? ends[side - 1] : 0;
    const part = (at - begin) / (ends[side] - begin);
    const [one, next] = [points[side], points[(side + 1) % points.length]];
    return [0, 1].map((axis) => one[axis] + part * (next[axis] - one[axis]));
  });
}
