// Curves over time on a canvas: bands, logarithmic scales, a cursor. Only as much as this page needs.

const LEFT = 60;
const [RIGHT, TOP, BOTTOM] = [8, 8, 6];
const AXIS = 22; // below the plot that has the times
const SMALLEST = 1e-12; // least value of a logarithmic scale
const DECADES = 9; // maximum length of one
const RARE = 0.03; // share of the columns that a scale without peaks leaves out at either end
export const FONT = "12px system-ui, sans-serif";

// The canvas with as many dots as the screen has, and its size in CSS pixels.
export function fitted(canvas) {
  const { clientWidth: width, clientHeight: height } = canvas;
  const ratio = window.devicePixelRatio || 1;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}

// A step of 1, 2 or 5 times a power of ten, with about `count` steps in the span.
export function niceStep(span, count) {
  const rough = span / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  return power * [1, 2, 5, 10].find((factor) => factor * power >= rough * 0.999);
}

// A curve as columns of pixels: the position of each column, the minimum, the maximum and the last value of the
// channel, and the last value of the band around it.
class Columns {
  count = 0;
  #room = 0;

  take(history, view, x, { run, channel, band }) {
    const begin = Math.max(history.first(run), history.at(view.from));
    const end = Math.min(history.count(run), history.at(view.to) + 2);
    this.#enlarge(Math.max(0, end - begin));
    this.count = 0;
    let column = NaN;
    for (let i = begin; i < end; ++i) {
      const last = history.last(run, channel, i);
      if (Number.isNaN(last)) {
        continue;
      }
      const at = Math.round(x(history.time(i)));
      if (at !== column) {
        column = at;
        this.at[this.count] = at;
        this.least[this.count] = Infinity;
        this.largest[this.count++] = -Infinity;
      }
      const k = this.count - 1;
      this.least[k] = Math.min(this.least[k], history.least(run, channel, i));
      this.largest[k] = Math.max(this.largest[k], history.largest(run, channel, i));
      this.last[k] = last;
      this.around[k] = band === undefined ? 0 : history.last(run, band, i) || 0; // NaN: there is none
    }
  }
  #enlarge(count) {
    if (this.#room < count) {
      this.#room = 2 * count;
      for (const name of ["at", "least", "largest", "last", "around"]) {
        this[name] = new Float64Array(this.#room);
      }
    }
  }

  // From the minimum to the maximum, without the peaks in a share of the columns.
  extent(log, share) {
    const lows = log ? this.largest : this.least;
    if (share > 0 && this.count > 0) {
      const sorted = (edge) => Float64Array.from({ length: this.count }, (_, k) => edge(k)).sort();
      const leftOut = Math.floor(share * this.count);
      const low = sorted((k) => lows[k] - this.around[k])[leftOut];
      return [low, sorted((k) => this.largest[k] + this.around[k])[this.count - 1 - leftOut]];
    }
    let [low, high] = [Infinity, -Infinity];
    for (let k = 0; k < this.count; ++k) {
      low = Math.min(low, lows[k] - this.around[k]);
      high = Math.max(high, this.largest[k] + this.around[k]);
    }
    return [low, high];
  }
}

export class Plot {
  #columns = [];

  // times: whether the axis of time is below it. least: the smallest span of a linear scale.
  constructor(canvas, { log = false, times = false, least = 0 }) {
    this.canvas = canvas;
    this.log = log;
    this.times = times;
    this.least = least;
    this.curves = []; // { run, channel, color, dash, wide, rare, band }, `band` a channel of standard deviations
    this.lines = []; // { value, color }
  }

  // Time at this distance from the canvas's left edge.
  timeAt(x, { from, to }) {
    const part = (x - LEFT) / Math.max(1, this.canvas.clientWidth - LEFT - RIGHT);
    return from + Math.min(1, Math.max(0, part)) * (to - from);
  }

  draw(history, view, theme) {
    const { context, width, height } = fitted(this.canvas);
    const area = { left: LEFT, right: width - RIGHT, top: TOP, bottom: height - (this.times ? AXIS : BOTTOM) };
    const x = (time) => area.left + ((time - view.from) / (view.to - view.from)) * (area.right - area.left);
    this.curves.forEach((curve, i) => (this.#columns[i] ??= new Columns()).take(history, view, x, curve));
    const [low, high] = this.#range(view);
    const scaled = this.log ? (value) => Math.log10(Math.max(value, SMALLEST)) : (value) => value;
    const y = (value) => area.bottom - ((scaled(value) - low) / (high - low)) * (area.bottom - area.top);
    this.#grid(context, { area, x, y, low, high }, view, theme);
    context.save();
    context.beginPath();
    context.rect(area.left, area.top, area.right - area.left, area.bottom - area.top);
    context.clip();
    for (const { value, color } of this.lines) {
      line(context, [area.left, y(value), area.right, y(value)], theme[color], [8, 4]);
    }
    this.curves.forEach((curve, i) => drawBand(context, this.#columns[i], y, theme[curve.color]));
    const merged = x(history.bin) - x(0) < 1.5; // bins share columns
    this.curves.forEach((curve, i) => this.#curve(context, this.#columns[i], x(0), y, curve, theme, merged));
    context.restore();
    if (view.cursor !== null) {
      line(context, [x(view.cursor), area.top, x(view.cursor), area.bottom], theme.text, []);
    }
  }

  #range(view) {
    let [low, high] = [Infinity, -Infinity];
    this.curves.forEach(({ rare }, i) => {
      const [least, largest] = this.#columns[i].extent(this.log, rare && !view.peaks ? RARE : 0);
      [low, high] = [Math.min(low, least), Math.max(high, largest)];
    });
    if (!(low <= high)) {
      [low, high] = this.log ? [1e-3, 1] : [0, 0];
    }
    if (this.log) {
      const top = Math.ceil(Math.log10(Math.max(high, SMALLEST)) - 1e-9);
      const bottom = Math.floor(Math.log10(Math.max(low, SMALLEST)) + 1e-9);
      return [Math.max(top - DECADES, Math.min(bottom, top - 1)), top];
    }
    const missing = Math.max(0, this.least - (high - low)) / 2;
    const step = niceStep(Math.max(high - low, this.least), 4) / 2;
    return [Math.floor((low - missing) / step - 0.1) * step, Math.ceil((high + missing) / step + 0.1) * step];
  }

  #grid(context, { area, x, y, low, high }, view, theme) {
    context.font = FONT;
    context.fillStyle = theme.text;
    context.textBaseline = "middle";
    context.textAlign = "right";
    const step = this.log ? Math.max(1, Math.ceil((high - low) / 4)) : niceStep(high - low, 4);
    for (let tick = Math.ceil(low / step - 1e-9) * step; tick <= high + 1e-9 * step; tick += step) {
      const at = y(this.log ? 10 ** tick : tick);
      line(context, [area.left, at, area.right, at], theme.grid, []);
      context.fillText(this.log ? power(tick) : short(tick, step), area.left - 6, at);
    }
    context.textAlign = "center";
    const apart = niceStep(view.to - view.from, Math.max(2, (area.right - area.left) / 90));
    for (let time = Math.ceil(view.from / apart - 1e-9) * apart; time <= view.to + 1e-9; time += apart) {
      line(context, [x(time), area.top, x(time), area.bottom], theme.grid, []);
      if (this.times && x(time) < area.right - 14) {
        context.fillText(short(time, apart), x(time), area.bottom + 12);
      }
    }
    if (this.times) {
      context.textAlign = "right";
      context.fillText("ms", area.right, area.bottom + 12);
    }
  }

  // From the least to the largest of every column; on a logarithmic scale, where noise would fill it and gaps of dashes
  // would look like lost data, only the largest, without dashes.
  // Dashes are of columns: those of a context follow every turn of the noise, at many times the cost. So does a line
  // that is wider than a pixel; a wide one is drawn twice.
  #curve(context, columns, origin, y, curve, theme, merged) {
    const drawn = dashes(this.log ? [] : curve.dash);
    const bars = merged && !this.log;
    const heights = this.log ? columns.largest : columns.last;
    context.strokeStyle = theme[curve.color];
    context.lineWidth = 1;
    const path = new Path2D();
    for (let k = 0; k < columns.count; ++k) {
      const at = columns.at[k];
      const height = y(heights[k]);
      if (k === 0 || !drawn(at - Math.round(origin))) {
        path.moveTo(at, height);
        continue;
      }
      if (bars && y(columns.least[k]) - y(columns.largest[k]) > 2) {
        path.lineTo(at, y(columns.least[k]));
        path.lineTo(at, y(columns.largest[k]));
      }
      path.lineTo(at, height);
    }
    context.stroke(path);
    if (curve.wide) {
      context.translate(0.5, 0.8);
      context.stroke(path);
      context.translate(-0.5, -0.8);
    }
  }
}

// Curves of points [x, y] with logarithmic scales: { points, color, wide }. unit: of x.
export function drawLogLog(canvas, curves, unit, theme) {
  const { context, width, height } = fitted(canvas);
  const area = { left: LEFT, right: width - RIGHT, top: TOP, bottom: height - AXIS };
  const all = curves.flatMap(({ points }) => points).filter((point) => point.every((number) => number > 0));
  context.font = FONT;
  context.fillStyle = theme.text;
  if (!all.length) {
    context.fillText("no estimate of the rate for long enough yet", area.left, height / 2);
    return;
  }
  const exponents = [0, 1].map((axis) => all.map((point) => Math.log10(point[axis])));
  const lows = exponents.map((of) => of.reduce((least, each) => Math.min(least, each)));
  const highs = exponents.map((of) => of.reduce((largest, each) => Math.max(largest, each)));
  const [bottom, top] = [Math.floor(lows[1]), Math.max(Math.ceil(highs[1]), Math.floor(lows[1]) + 1)];
  const x = (log) => area.left + ((log - lows[0]) / (highs[0] - lows[0] || 1)) * (area.right - area.left);
  const y = (log) => area.bottom - ((log - bottom) / (top - bottom)) * (area.bottom - area.top);
  context.textBaseline = "middle";
  context.textAlign = "right";
  for (let tick = bottom; tick <= top; tick += Math.max(1, Math.ceil((top - bottom) / 6))) {
    line(context, [area.left, y(tick), area.right, y(tick)], theme.grid, []);
    context.fillText(power(tick), area.left - 6, y(tick));
  }
  context.fillText(unit, area.right, area.bottom + 12);
  context.textAlign = "center";
  for (let tick = Math.ceil(lows[0]); tick <= highs[0]; ++tick) {
    line(context, [x(tick), area.top, x(tick), area.bottom], theme.grid, []);
    if (x(tick) < area.right - 30) {
      context.fillText(power(tick), x(tick), area.bottom + 12);
    }
  }
  for (const { points, color, wide } of curves) {
    context.strokeStyle = theme[color];
    context.lineWidth = wide ? 2 : 1;
    context.beginPath();
    points.forEach((point) => context.lineTo(...[x, y].map((to, axis) => to(Math.log10(point[axis])))));
    context.stroke();
  }
}

function drawBand(context, columns, y, color) {
  context.fillStyle = color;
  context.globalAlpha = 0.25;
  context.beginPath();
  const edge = (k, sign) => {
    if (columns.around[k] > 0) {
      context.lineTo(columns.at[k], y(columns.last[k] + sign * columns.around[k]));
    }
  };
  for (let k = 0; k < columns.count; ++k) {
    edge(k, 1);
  }
  for (let k = columns.count - 1; k >= 0; --k) {
    edge(k, -1);
  }
  context.fill();
  context.globalAlpha = 1;
}

// Returns a function that is true for the columns that the dashes of a pattern draw.
function dashes(pattern) {
  const length = pattern.reduce((sum, part) => sum + part, 0);
  return (column) => {
    let rest = length ? ((column % length) + length) % length : 0;
    const part = pattern.findIndex((size) => (rest -= size) < 0);
    return part % 2 !== 1;
  };
}

function line(context, [fromX, fromY, toX, toY], color, dash) {
  context.strokeStyle = color;
  context.lineWidth = 1;
  context.setLineDash(dash);
  context.beginPath();
  context.moveTo(fromX, fromY);
  context.lineTo(toX, toY);
  context.stroke();
  context.setLineDash([]);
}

const raised = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };
const power = (exponent) => `10${[...String(Math.round(exponent))].map((sign) => raised[sign]).join("")}`;

// A tick's number with as many places as its step needs.
function short(value, step) {
  const places = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const text = Math.abs(value) >= 1e5 ? value.toExponential(1).replace("e+", "e") : value.toFixed(Math.min(places, 6));
  return text.replace("-", "−").replace(/^−(0(\.0*)?)$/, "$1");
}
