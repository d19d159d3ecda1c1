// The gyroscope from above: the frame, which turns with the chip, its combs and springs, the proof mass, where it was
// and where it should be, the force, and the angular rate as an arc.
import { fitted } from "./plot.mjs";
import { place } from "./channels.mjs";

const REACH = 1.75; // from the middle to the frame, in units of q0
const FASTEST = 0.6; // the frame's turning on the screen, rad/s
const HALF = 0.4; // side of the mass, halved
const FINGER = 0.22; // length of the combs' fingers
const PITCH = 0.16; // from one finger to the next
const ARC = 2.42; // radius of the arc of the rate
const LONGEST_ARC = 2.4; // rad
const TRAIL = 2; // units of time
const PATH = 2000; // bins of a reference that is not a figure
const FAR = 1.25; // the reference stays within this distance on each axis, q0 or more

export class Scene {
  #angle = 0;
  #strongest = 1;
  #weakest = 1;
  #zoom = 1;
  #trail = TRAIL;

  constructor(canvas) {
    this.canvas = canvas;
  }

  // Turns the frame: `rate` in rad per unit of time, for `units` units of time, which took `seconds`.
  turn(rate, units, seconds) {
    const most = FASTEST * seconds;
    this.#angle += Math.max(-most, Math.min(most, rate * units));
  }
  // weakest: the force that is drawn as long as the frame if no stronger one acts. unit: a unit of time, as in the
  // history.
  restart(weakest, unit) {
    this.#trail = TRAIL * unit;
    this.#angle = 0;
    this.#weakest = weakest;
    this.#strongest = weakest;
    this.#zoom = 1;
  }

  // From the screen to the frame's axes, in units of q0.
  inFrame(x, y) {
    const size = Math.min(this.canvas.clientWidth, this.canvas.clientHeight) / 2 / (REACH * 1.45);
    const [cosine, sine] = [Math.cos(this.#angle), Math.sin(this.#angle)];
    return [(x * cosine - y * sine) / size / this.#zoom, -(x * sine + y * cosine) / size / this.#zoom];
  }

  // points: the channels of each run's last sample. figure: points of the reference; null: those of the history.
  // turned: the rate as a share of the slider's range.
  draw(history, points, figure, theme, turned) {
    const { context, width, height } = fitted(this.canvas);
    const size = Math.min(width, height) / 2 / (REACH * 1.45);
    const pixel = 1 / size;
    context.translate(width / 2, height / 2);
    context.scale(size, -size);
    drawRate(context, Math.max(-1, Math.min(1, turned)) * LONGEST_ARC, theme, pixel);
    context.rotate(this.#angle);
    context.lineJoin = "round";
    context.lineWidth = 4 * pixel;
    context.strokeStyle = theme.text;
    context.strokeRect(-REACH, -REACH, 2 * REACH, 2 * REACH);
    context.fillStyle = theme.text;
    context.fillRect(-0.06, REACH, 0.12, 0.14); // so that turning shows
    const combs = sides(REACH, REACH - 2 * PITCH, 0).map(([at, out]) => [at, [at[0] - out[0], at[1] - out[1]]]);
    combs.forEach((finger) => stroke(context, finger, theme.text, 1.5 * pixel, []));
    const goal = [points[0][place["reference.x"]], points[0][place["reference.y"]]];
    const path = [...(figure ?? pathOf(history, 0, "reference", history.count(0) - PATH)), goal];
    const farthest = Math.max(FAR, ...path.flat().map((a) => Math.abs(a) || 0));
    this.#zoom = FAR / farthest;
    const zoomed = (path) => path.map(([x, y]) => [x * this.#zoom, y * this.#zoom]);
    stroke(context, zoomed(figure ?? path), theme.muted, 1.5 * pixel, [4 * pixel, 4 * pixel]);
    points.forEach((_, run) => {
      const begin = history.count(run) - Math.ceil(this.#trail / history.bin);
      const trail = zoomed(pathOf(history, run, "position", begin));
      stroke(context, trail, theme["ab"[run]], 2 * pixel, run ? [7 * pixel, 3 * pixel] : []);
    });
    [...points.entries()].reverse().forEach(([run, point]) => this.#mass(context, run, point, theme, pixel));
  }

  #mass(context, run, point, theme, pixel) {
    const color = theme["ab"[run]];
    const [x, y] = ["x", "y"].map((axis) => bounded(this.#zoom * point[place[`position.${axis}`]]));
    const half = HALF;
    if (run === 0) {
      for (const [i, j] of [[-1, -1], [-1, 1], [1, -1], [1, 1]]) {
        const turns = spring([i * REACH, j * REACH], [x + i * half, y + j * half]);
        stroke(context, turns, theme.muted, 1.5 * pixel, []);
      }
      for (const [[fromX, fromY], [outX, outY]] of sides(half, half, PITCH / 2)) {
        const finger = [[x + fromX, y + fromY], [x + fromX + outX, y + fromY + outY]];
        stroke(context, finger, color, 1.5 * pixel, []);
      }
    }
    context.lineWidth = 2 * pixel;
    context.strokeStyle = color;
    context.fillStyle = theme.surface;
    if (run === 0) {
      context.fillRect(x - half, y - half, 2 * half, 2 * half);
    }
    context.setLineDash(run ? [7 * pixel, 3 * pixel] : []);
    context.strokeRect(x - half, y - half, 2 * half, 2 * half);
    context.setLineDash([]);
    this.#force(context, [x, y], [point[place["control.x"]], point[place["control.y"]]], color, pixel);
  }

  // Draws the force as an arrow. The strongest recent force is as long as the frame.
  #force(context, [x, y], [ux, uy], color, pixel) {
    const strength = Math.hypot(ux, uy);
    if (!Number.isFinite(strength)) {
      return;
    }
    this.#strongest = Math.max(strength, this.#strongest * 0.998, this.#weakest);
    const [dx, dy] = [ux / this.#strongest, uy / this.#strongest];
    stroke(context, [[x, y], [x + dx, y + dy]], color, 3 * pixel, []);
    const length = Math.hypot(dx, dy) || 1;
    const [ex, ey] = [(0.14 * dx) / length, (0.14 * dy) / length];
    context.fillStyle = color;
    context.beginPath();
    context.moveTo(x + dx + ex, y + dy + ey);
    context.lineTo(x + dx - ey * 0.6, y + dy + ex * 0.6);
    context.lineTo(x + dx + ey * 0.6, y + dy - ex * 0.6);
    context.fill();
  }
}

// The roots of fingers on the sides of a square, half its width away from the middle, and how far they reach outward.
// They are on each side up to `end` from its middle, and shifted by `shift`.
function sides(half, end, shift) {
  const found = [];
  for (let along = -end + shift; along <= end + 1e-9; along += PITCH) {
    for (const sign of [-1, 1]) {
      found.push([[along, sign * half], [0, sign * FINGER]], [[sign * half, along], [sign * FINGER, 0]]);
    }
  }
  return found;
}

// An arc of this angle around the frame, from the top, with its head in the direction in which the chip turns.
function drawRate(context, angle, theme, pixel) {
  if (Math.abs(angle) < 0.02) {
    return;
  }
  const way = Math.sign(angle);
  const end = Math.PI / 2 + angle;
  context.strokeStyle = context.fillStyle = theme.accent;
  context.lineWidth = 3 * pixel;
  context.beginPath();
  context.arc(0, 0, ARC, Math.PI / 2, end, angle < 0);
  context.stroke();
  const on = (radius, at) => [radius * Math.cos(at), radius * Math.sin(at)];
  context.beginPath();
  context.moveTo(...on(ARC, end + way * 0.12));
  context.lineTo(...on(ARC + 0.11, end));
  context.lineTo(...on(ARC - 0.11, end));
  context.fill();
  context.save();
  context.translate(-0.2 * way, ARC - 0.2);
  context.scale(pixel, -pixel);
  context.font = "15px system-ui, sans-serif";
  context.textAlign = "center";
  context.fillText("Ω", 0, 0);
  context.restore();
}

// A motion that leaves the frame is drawn at its edge.
const bounded = (a) => Math.max(-REACH, Math.min(REACH, a)) || 0;

function stroke(context, points, color, width, dash) {
  context.strokeStyle = color;
  context.lineWidth = width;
  context.setLineDash(dash);
  context.beginPath();
  points.forEach(([x, y]) => context.lineTo(bounded(x), bounded(y)));
  context.stroke();
  context.setLineDash([]);
}

// Its turns, from one end to the other.
function spring([fromX, fromY], [toX, toY]) {
  const turns = 12;
  const length = Math.hypot(toX - fromX, toY - fromY) || 1;
  const [sideX, sideY] = [(-0.07 * (toY - fromY)) / length, (0.07 * (toX - fromX)) / length];
  const points = [[fromX, fromY]];
  for (let i = 1; i < turns; ++i) {
    const [part, side] = [i / turns, i % 2 ? 1 : -1];
    points.push([fromX + part * (toX - fromX) + side * sideX, fromY + part * (toY - fromY) + side * sideY]);
  }
  return [...points, [toX, toY]];
}

// Positions of a run, or of its reference, from a bin of the history on.
function pathOf(history, run, name, begin) {
  const end = history.count(run);
  const first = Math.max(history.first(run), begin);
  return Array.from({ length: Math.max(0, end - first) }, (_, i) =>
    ["x", "y"].map((axis) => history.last(run, place[`${name}.${axis}`], first + i)),
  );
}

const isOf = (kind, { settings }) => [0, 1].every((axis) => settings[`reference.kind[${axis}]`] === kind);

// The sines of each axis, [amplitude, frequency, phase], of a reference of one sine or of a sum of them; null for any
// other.
function sinesOf(scenario) {
  const { settings, reference } = scenario;
  if (isOf("sines", scenario)) {
    const { terms } = reference;
    const starts = Array.from({ length: terms.length / 6 }, (_, i) => 6 * i);
    return [0, 1].map((axis) => starts.map((at) => [0, 2, 4].map((which) => terms[at + which + axis])));
  }
  const names = ["amplitude", "frequency", "phase"];
  return isOf("sine", scenario)
    ? ["x", "y"].map((axis) => [names.map((name) => settings[`reference.${name}.${axis}`])])
    : null;
}

// The longest period of the axes of a reference of sines, units of time; 1 for any other.
export function periodOf(scenario) {
  const frequencies = (sinesOf(scenario) ?? []).flat().map(([, frequency]) => Math.abs(frequency) || Infinity);
  const slowest = Math.min(...frequencies);
  return Number.isFinite(slowest) ? (2 * Math.PI) / slowest : 1;
}

// A reference of sines from its settings, for as long as a figure takes; null for any other, which has no period.
export function figureOf(scenario) {
  const sines = sinesOf(scenario);
  if (sines === null) {
    return null;
  }
  const at = (time) =>
    sines.map((terms, axis) =>
      terms.reduce(
        (sum, [amplitude, frequency, phase]) => sum + amplitude * Math.sin(frequency * time + phase),
        scenario.settings[`reference.offset.${"xy"[axis]}`],
      ),
    );
  const period = periodOf(scenario);
  return Array.from({ length: 201 }, (_, i) => at((i * period) / 200));
}
