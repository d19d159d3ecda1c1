// The channels shown of a run at every sample, computed from the columns of its rows.

export const CHANNELS = [
  "rate",
  "rate_estimate",
  "rate_deviation",
  "rate_error",
  "error.x",
  "error.y",
  "control.x",
  "control.y",
  "stiffness_error",
  "damping_error",
  "position.x",
  "position.y",
  "reference.x",
  "reference.y",
];
export const PER_CHANNEL = 5; // numbers of a bin, see history.mjs
export const place = Object.fromEntries(CHANNELS.map((name, i) => [name, i]));

const sizeOf = (xx, xy, yy) => Math.sqrt(xx * xx + 2 * xy * xy + yy * yy);

// Returns a function of the rows and the index at which one starts: the relative error of an estimate.
function relative(scenario, columns, name) {
  const first = columns.indexOf(`${name}_estimate.xx`);
  const of = (path) => scenario.settings[path] / (scenario.scales[path] ?? 1);
  const [xx, xy, yy] = ["xx", "xy", "yy"].map(
    (part) => of(`plant.${name}.${part}`) + of(`plant.${name}_deviation.${part}`),
  );
  const whole = sizeOf(xx, xy, yy);
  return (rows, from) => {
    const at = from + first;
    return first < 0 ? NaN : sizeOf(rows[at] - xx, rows[at + 1] - xy, rows[at + 2] - yy) / whole;
  };
}

export const PER_RADIAN = 180 / Math.PI; // degrees

// Returns a function that writes the channels of the row that starts at `from` to `out`. Rates are in rad/s, or in
// deg/s if the scenario states `degrees`; errors in µm; what a run does not have is NaN.
export function channelsOf(scenario, columns) {
  const shown = scenario.degrees ? PER_RADIAN : 1;
  const scale = shown * (scenario.scales["plant.angular_rate"] ?? 1);
  const rate = shown * scenario.settings["plant.angular_rate"];
  const moving = columns.indexOf("angular_rate");
  const stiffness = relative(scenario, columns, "stiffness");
  const damping = relative(scenario, columns, "damping");
  const length = scenario.length ?? 1; // the unit of length, µm
  const copied = CHANNELS.map((name, to) => [to, columns.indexOf(name)]).filter(([, at]) => at >= 0);
  return (rows, from, out) => {
    out.fill(NaN);
    for (const [to, at] of copied) {
      out[to] = rows[from + at];
    }
    out[place.rate] = moving < 0 ? rate : rows[from + moving] * scale;
    out[place.rate_estimate] *= scale;
    out[place.rate_deviation] *= scale;
    out[place.rate_error] = out[place.rate_estimate] - out[place.rate];
    out[place["error.x"]] = length * Math.abs(out[place["error.x"]]);
    out[place["error.y"]] = length * Math.abs(out[place["error.y"]]);
    out[place.stiffness_error] = stiffness(rows, from);
    out[place.damping_error] = damping(rows, from);
  };
}
