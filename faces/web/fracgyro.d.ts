// Types of fracgyro.mjs. Settings bear the names of a scenario's fields; `Fracgyro.fields` has unit, meaning and range.

/** Loads the module and its data, by default from the folder of fracgyro.mjs. Node fetches no files: pass both. */
export function load(files?: { wasm?: BufferSource; data?: object }): Promise<Fracgyro>;

export interface Fracgyro {
  readonly version: string;
  /** What each setting means and may be: enough to build a form from. */
  readonly fields: Readonly<Record<keyof Settings, Field>>;
  /** The paper's study, eqs (47)-(53), corrected and as printed. */
  readonly paper: { readonly corrected: Scenario; readonly printed: Scenario };
  /**
   * The closed loop from t = 0 to run.duration. With a scenario's own settings it equals Python's fracgyro.simulate to
   * the bit. Throws RangeError, in one sentence, for a setting that is unknown or out of range.
   */
  simulate(scenario: Scenario, changes?: Partial<Settings>): Promise<Run>;
  /** The controller alone, for a loop of your own; in double precision unless `single`. */
  controller(scenario: Scenario, changes?: Partial<Settings>, options?: { single?: boolean }): Promise<Controller>;
}

/** `fracgyro export web my.toml --out my.json` writes one. */
export interface Scenario {
  readonly settings: Settings;
  /** Nondimensional = setting / scale, for those in SI units. */
  readonly scales: Partial<Record<keyof Settings, number>>;
}

export interface Field {
  description: string;
  unit?: string;
  choices?: string[];
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

export interface Controller {
  /** The force [x, y] to hold for the coming step, from what is measured now. Call it once every run.step. */
  step(position: [number, number], velocity: [number, number]): [number, number];
  /** What was thought of the last sample; anything but ok and saturated says that it was not believed. */
  readonly status: "ok" | "saturated" | "not_finite" | "out_of_range" | "restarted" | "implausible" | "lost";
  /**
   * After the last step: damping and stiffness as [xx, xy, yy], the angular rate, [b0, b1, b2]. With adaptation.kind
   * composite also the rate's standard deviation, and whether the motion tells it from the other parameters; else 0 and
   * false.
   */
  readonly estimates: {
    damping: number[];
    stiffness: number[];
    rate: number;
    bound: number[];
    rateDeviation: number;
    rateTrusted: boolean;
  };
  /**
   * All that changes while running: assign it to a controller of the same scenario to resume, bit for bit. Throws
   * RangeError for a state that is damaged, or was saved by another version or a controller of another scenario or
   * precision.
   */
  state: Uint8Array;
}

export interface Settings {
  "run.duration": number;
  "run.step": number;
  "run.record_every": number;
  /** Of the exponential modes, which the module designs. */
  "run.mode_tolerance": number;
  "controller.order": number;
  "controller.kind": "fractional_fast_terminal" | "fractional" | "fast_terminal" | "linear";
  "controller.adaptive": boolean;
  "guard.checked": boolean;
  "adaptation.kind": "gradient" | "composite";
  "controller.derivative": "caputo" | "riemann_liouville";
  "controller.layer": "linear" | "quadratic";
  "controller.rate_law": "skew" | "printed";
  "disturbance.kind": "none" | "noise" | "sine";
  "disturbance.hold_steps": number;
  "reference.amplitude.x": number;
  "reference.amplitude.y": number;
  "reference.frequency.x": number;
  "reference.frequency.y": number;
  "reference.phase.x": number;
  "reference.phase.y": number;
  "controller.fractional_gain.x": number;
  "controller.fractional_gain.y": number;
  "controller.terminal_gain.x": number;
  "controller.terminal_gain.y": number;
  "controller.terminal_exponent": number;
  "controller.singularity_floor": number;
  "controller.layer_thickness": number;
  "controller.force_limit": number | null;
  "controller.switching_limit": number | null;
  "adaptation.damping_gain": number;
  "adaptation.stiffness_gain": number;
  "adaptation.rate_gain": number;
  "adaptation.bound_gain[0]": number;
  "adaptation.bound_gain[1]": number;
  "adaptation.bound_gain[2]": number;
  "adaptation.leakage": number;
  "adaptation.dead_zone": number;
  "adaptation.projection": number;
  "adaptation.forgetting": number;
  "adaptation.rate_forgetting": number;
  "adaptation.initial_damping.xx": number;
  "adaptation.initial_damping.xy": number;
  "adaptation.initial_damping.yy": number;
  "adaptation.initial_stiffness.xx": number;
  "adaptation.initial_stiffness.xy": number;
  "adaptation.initial_stiffness.yy": number;
  "adaptation.initial_rate": number;
  "adaptation.initial_bound[0]": number;
  "adaptation.initial_bound[1]": number;
  "adaptation.initial_bound[2]": number;
  "guard.plant_tolerance": number;
  "guard.force_tolerance": number;
  "guard.position_tolerance": number;
  "guard.velocity_tolerance": number;
  "guard.patience": number;
  "guard.saturation_patience": number;
  "plant.damping.xx": number;
  "plant.damping.xy": number;
  "plant.damping.yy": number;
  "plant.stiffness.xx": number;
  "plant.stiffness.xy": number;
  "plant.stiffness.yy": number;
  "plant.damping_deviation.xx": number;
  "plant.damping_deviation.xy": number;
  "plant.damping_deviation.yy": number;
  "plant.stiffness_deviation.xx": number;
  "plant.stiffness_deviation.xy": number;
  "plant.stiffness_deviation.yy": number;
  "plant.angular_rate": number;
  "plant.initial_position.x": number;
  "plant.initial_position.y": number;
  "plant.initial_velocity.x": number;
  "plant.initial_velocity.y": number;
  "disturbance.standard_deviation": number;
  "disturbance.seed": number;
  "disturbance.amplitude.x": number;
  "disturbance.amplitude.y": number;
  "disturbance.frequency.x": number;
  "disturbance.frequency.y": number;
  "disturbance.phase.x": number;
  "disturbance.phase.y": number;
}
