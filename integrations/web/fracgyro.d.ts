// Types of fracgyro.mjs. Settings bear the names of a scenario's fields; `Fracgyro.fields` has unit, meaning and range.
// `make web` writes the types of the settings at the end, from the core's own lists.

/** Loads the module and its data, by default from the folder of fracgyro.mjs. Node fetches no files: pass both. */
export function load(files?: { wasm?: BufferSource; data?: object }): Promise<Fracgyro>;

export interface Fracgyro {
  readonly version: string;
  /** What each setting means and may be: enough to build a form from. */
  readonly fields: Readonly<Record<SettingName, Field>>;
  /** The paper's study, eqs (47)-(53), corrected and as printed. */
  readonly paper: { readonly corrected: Scenario; readonly printed: Scenario };
  /**
   * The closed loop from t = 0 to run.duration. With a scenario's own settings it equals Python's fracgyro.simulate to
   * the bit. Throws RangeError, in one sentence, for a setting that is unknown or out of range.
   */
  simulate(scenario: Scenario, changes?: Partial<Settings>): Promise<Run>;
  /** The closed loop in parts, tuned while it runs. Without changes its rows are those of `simulate`, bit for bit. */
  loop(scenario: Scenario, changes?: Partial<Settings>): Promise<Loop>;
  /** The controller without a loop, for a loop of your own; in double precision unless `single`. */
  controller(scenario: Scenario, changes?: Partial<Settings>, options?: { single?: boolean }): Promise<Controller>;
}

/** `fracgyro export web my.toml --out my.json` writes one. */
export interface Scenario {
  readonly settings: Settings;
  /** Nondimensional = setting / scale, for those in SI units. */
  readonly scales: Partial<Record<SettingName, number>>;
  /** A moving rate and a real device, nondimensional, for the run.step of the settings. */
  readonly device?: Device;
}

export interface Device {
  /** By name, such as rate.amplitude and device.position_noise; null is infinity. */
  readonly numbers: Readonly<Record<string, number | null>>;
  /** Times, in steps, and values: of the rate, and of the change of temperature in K. */
  readonly rate: readonly [readonly number[], readonly number[]];
  readonly temperature: readonly [readonly number[], readonly number[]];
}

export interface Field {
  description: string;
  unit?: string;
  choices?: (string | boolean)[];
  /** null or Infinity is allowed, and switches off. */
  infinite?: true;
  whole?: true;
  /** Acts only at the start: a loop that runs does not take it. */
  fixed?: true;
  minimum?: number;
  maximum?: number;
  exclusiveMinimum?: number;
  exclusiveMaximum?: number;
}

/** All of it nondimensional. */
export interface Run {
  /** Of the recorded samples, in units of 1/omega0. */
  time: Float64Array;
  /** position.x, …, bound_estimate[2]: as the variables of Python's Dataset. */
  columns: string[];
  column(name: string): Float64Array;
  /** All columns, sample by sample. */
  rows: Float64Array;
  /** When the motion left all bounds; null if it did not. */
  diverged: number | null;
}

/** As Python's fracgyro.Loop. All of it nondimensional. */
export interface Loop {
  /** As those of a run. */
  readonly columns: string[];
  /** When the coming sample is, in units of 1/omega0. */
  readonly time: number;
  /** When the motion left all bounds; null if it did not. */
  readonly diverged: number | null;
  /**
   * The coming samples: rows of all columns at the samples that `every` divides, fewer where the motion diverges. It
   * may go on beyond run.duration, the longest time that a fractional memory is accurate for.
   */
  run(samples: number, every?: number): Float64Array;
  /**
   * Other settings from the coming sample on; what the controller has learnt stays. Throws RangeError for one that is
   * out of range, acts only at the start, or would make it another controller; then nothing changes.
   */
  set(changes: Partial<Settings>): void;
  /** An impulse on the mass just before the coming sample: what it adds to the velocity. */
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
   * What the controller reports besides the force, by channel, as it stands after the last step: rate_estimate,
   * stiffness_estimate as [xx, xy, yy], and so on. What is known only within a step, as the sliding surface, is none
   * of them.
   */
  readonly report: Readonly<Record<string, number | number[]>>;
  /**
   * All that changes while running: assign it to a controller of the same scenario to resume, bit for bit. Throws
   * RangeError for a state that is damaged, or was saved by another version or a controller of another scenario or
   * precision.
   */
  state: Uint8Array;
}

type NameOf<Each> = Each extends unknown ? keyof Each : never;
export type SettingName = NameOf<Settings>;

