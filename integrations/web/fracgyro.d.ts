// Types of fracgyro.mjs. Settings bear the names of a scenario's fields; `Fracgyro.fields` has unit, meaning and range.
// `make web` writes the types of the settings at the end, from the core's own lists.

/**
 * Loads the module and its data, by default from the folder of fracgyro.mjs. Node cannot fetch files: pass both.
 * `single`: fracgyro-single.wasm, whose controllers compute in single precision, and which has no loop.
 */
export function load(files?: { wasm?: BufferSource; data?: object; single?: boolean }): Promise<Fracgyro>;

export interface Fracgyro {
  readonly version: string;
  /** True if controllers compute in single precision. Then it has no loops. */
  readonly single: boolean;
  /** Meaning, unit and range of each setting, enough to build a form. */
  readonly fields: Readonly<Record<SettingName, Field>>;
  /** The paper's study, eqs (47)-(53), corrected and as printed. */
  readonly paper: { readonly corrected: Scenario; readonly printed: Scenario };
  /**
   * The closed loop from t = 0 to run.duration. With a scenario's own settings it equals Python's fracgyro.simulate,
   * bit for bit. Throws RangeError, in one sentence, for a setting that is unknown or out of range.
   */
  simulate(scenario: Scenario, changes?: Partial<Settings>, options?: { law?: Law }): Promise<Run>;
  /** The closed loop in parts, tuned while it runs. Without changes its rows are those of `simulate`, bit for bit. */
  loop(scenario: Scenario, changes?: Partial<Settings>, options?: { law?: Law }): Promise<Loop>;
  /** The controller without a loop, for a loop of your own. */
  controller(scenario: Scenario, changes?: Partial<Settings>): Promise<Controller>;
}

/**
 * A controller of your own in place of the scenario's, like a callable in Python: a function of the sample that returns
 * the force [x, y], or an object with such a function `force`, and `report`. Whatever it throws ends the run; a force
 * that is not two finite numbers throws LawError, a RangeError.
 */
export type Law = Force | { force: Force; report?: () => Record<string, number | [number, number]> };
export type Force = (sample: Sample) => ArrayLike<number>;

export class LawError extends RangeError {}

/** Input of a law at one sample, nondimensional; pairs are [x, y]. */
export interface Sample {
  time: number;
  /** Measured; the velocity is the observer's with device.sensing = "position". */
  position: [number, number];
  velocity: [number, number];
  reference: [number, number];
  reference_velocity: [number, number];
  reference_acceleration: [number, number];
  /** position - reference, and velocity - reference_velocity. */
  error: [number, number];
  error_rate: [number, number];
}

/** A scenario, as `fracgyro export web my.toml --out my.json` writes it. */
export interface Scenario {
  readonly settings: Settings;
  /** Scales of the settings in SI units: setting / scale is nondimensional. */
  readonly scales: Partial<Record<SettingName, number>>;
  /** Noise and delay, nondimensional, that controller.filter assumes where the settings have no datasheet. */
  readonly assumed?: Readonly<Record<"force_noise" | "position_noise" | "velocity_noise" | "delay", number>>;
  /** Lists of the reference: of each term of sines amplitude, frequency and phase, each x, y; of each row of a table
   * time, position, velocity and acceleration, each x, y. */
  readonly reference?: { readonly terms: readonly number[]; readonly rows: readonly number[] };
  /** A dynamic rate and a real device, nondimensional, for the run.step of the settings. */
  readonly device?: Device;
  /** Electrodes, electronics and trim of the device, for the run.step of the settings. */
  readonly volts?: Volts;
  /** Terms added to the disturbance of the settings, nondimensional, for the run.step of the settings. */
  readonly disturbance?: readonly Term[];
}

export interface Volts {
  /** How many electrodes there are. */
  readonly electrodes: number;
  /** All numbers, as the core takes them; null is infinity. */
  readonly numbers: readonly (number | null)[];
  /** Why the controller cannot be used without the loop; left out if it can. */
  readonly refusal?: string;
}

export interface Term {
  /** By name, such as disturbance.start_steps; null is infinity. */
  readonly numbers: Readonly<Record<string, number | null>>;
  /** Columns: steps since the start and force on x and y, or frequencies and one-sided densities of x and y. */
  readonly rows: readonly [readonly number[], readonly number[], readonly number[]];
}

export interface Device {
  /** By name, such as rate.amplitude and device.position_noise; null is infinity. */
  readonly numbers: Readonly<Record<string, number | null>>;
  /** Profiles of the rate, and of the change of temperature in K: times, in steps, and values. */
  readonly rate: readonly [readonly number[], readonly number[]];
  readonly temperature: readonly [readonly number[], readonly number[]];
}

export interface Field {
  description: string;
  unit?: string;
  choices?: (string | boolean)[];
  /** null or Infinity is allowed and switches the effect off. */
  infinite?: true;
  whole?: true;
  /** Acts only at the start: a running loop refuses a change. */
  fixed?: true;
  minimum?: number;
  maximum?: number;
  exclusiveMinimum?: number;
  exclusiveMaximum?: number;
}

/** A finished run. Everything is nondimensional. */
export interface Run {
  /** Times of the recorded samples, in units of 1/omega0. */
  time: Float64Array;
  /** position.x, …, bound_estimate[2]: names of the variables of Python's Dataset, with the part. */
  columns: string[];
  column(name: string): Float64Array;
  /** All columns, sample by sample. */
  rows: Float64Array;
  /** When the motion left all bounds; null if it did not. */
  diverged: number | null;
}

/** A closed loop in parts, like Python's fracgyro.Loop. Everything is nondimensional. */
export interface Loop {
  /** The columns of a run. */
  readonly columns: string[];
  /** Time of the next sample, in units of 1/omega0. */
  readonly time: number;
  /** When the motion left all bounds; null if it did not. */
  readonly diverged: number | null;
  /**
   * The next samples: rows of all columns at the samples that `every` divides, fewer if the motion diverges. The loop
   * may continue beyond run.duration, but the fractional memory is accurate only up to there.
   */
  run(samples: number, every?: number): Float64Array;
  /**
   * Changes settings from the next sample on; the controller keeps its estimates. Throws RangeError for a setting that
   * is out of range, acts only at the start, or would make it another controller; then nothing changes.
   */
  set(changes: Partial<Settings>): void;
  /** An impulse on the mass just before the next sample, as the change of velocity. */
  kick(velocity: [number, number]): void;
  /**
   * Everything that changes during a run, including changed settings: assign it to a loop of the same scenario to
   * resume, bit for bit. Throws RangeError like the state of a controller.
   */
  state: Uint8Array;
}

export interface Controller {
  /**
   * The force [x, y] to hold for the next step, from the present measurement. Call it once every run.step. With
   * device.sensing = "position" the velocity is ignored. NaN marks a missing sample, which `status` reports.
   */
  step(position: [number, number], velocity?: [number, number]): [number, number];
  /** The guard's verdict on the last sample: accepted if ok or saturated. */
  readonly status: "ok" | "saturated" | "not_finite" | "out_of_range" | "restarted" | "implausible" | "lost";
  /**
   * The controller's report after the last step, by channel: rate_estimate, stiffness_estimate as [xx, xy, yy], and so
   * on. Numbers that exist only within a step, such as the sliding surface, are not included.
   */
  readonly report: Readonly<Record<string, number | number[]>>;
  /**
   * Everything that changes during a run: assign it to a controller of the same scenario to resume, bit for bit. Throws
   * RangeError for a state that is damaged, or was saved by another version or a controller of another scenario or
   * precision.
   */
  state: Uint8Array;
}

type NameOf<Each> = Each extends unknown ? keyof Each : never;
export type SettingName = NameOf<Settings>;

