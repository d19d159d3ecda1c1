// The presets of the page: two controllers, settings, and one sentence, which tests/python/test_live.py checks on runs.
// #key is the preset's address. `gyroscope`: another than the paper's. `shared`: settings of both runs; `own`: settings
// of one. `figure`: the drawn reference. `plot`: the large one. `reverses`: when the page reverses the rate by itself,
// and how often, ms, until the visitor moves it.
import { FIGURES } from "./figure.mjs";

export const presets = [
  {
    key: "follow",
    title: "Follow the rate",
    sentence:
      "The rate reverses by itself until you move it: the law as printed (A) never learns it; with least squares (B) " +
      "the estimate follows and shows how sure it is.",
    a: "printed",
    b: "least_squares",
    reverses: { first: 5, every: 10 },
  },
  {
    key: "dual-mass",
    title: "300 deg/s",
    sentence:
      "A silicon gyroscope at 300 deg/s, from noisy positions: after 10 ms a Kalman filter (A) has the rate to " +
      "0.2 deg/s, the paper's adaptation laws (B) only to hundreds; a reversal throws both off.",
    gyroscope: "dual_mass",
    a: "own",
    b: "gradient",
    speed: 14.2,
    window: 1000,
    reverses: { first: 25, every: 40 },
  },
  {
    key: "thrown",
    title: "Thrown by the start",
    sentence:
      "With the sign of its law corrected, the estimate (A) does learn, but the start throws it off by more " +
      "than 200 times the rate, and 20 ms later it is still off by half.",
    a: "corrected",
    speed: 0.7,
    window: 2,
    peaks: true,
  },
  {
    key: "first",
    title: "Least squares: 1 ms",
    sentence:
      "Least squares that assume a constant rate know it to 10 % after 1 ms and to 2 % after 20 ms; the band is" +
      " one standard deviation.",
    a: "least_squares",
    own: { a: { "adaptation.rate_forgetting": 0 } },
  },
  {
    key: "moving",
    title: "A rate that moves",
    sentence:
      "An estimator that expects a slow rate lags behind a fast one, and its band grows by the lag; forgetting four " +
      "times as fast (B) more than halves the error.",
    a: "least_squares",
    b: "least_squares",
    rate: "sine",
    own: { b: { "adaptation.rate_forgetting": 2 } },
  },
  {
    key: "sensors",
    title: "Real sensors",
    sentence:
      "With noisy positions and no velocities, least squares (A) have a standard deviation of 75 rad/s, a " +
      "Kalman filter that knows the noise (B) has 5 rad/s after 16 s, in which it learns D and K.",
    a: "least_squares",
    b: "joint",
    sensors: "positions",
  },
  {
    key: "quiet",
    title: "Without noise",
    sentence:
      "Without noise, least squares (B) have the rate at once, while the corrected law (A) takes as long as " +
      "with noise: noise is not its problem.",
    a: "corrected",
    b: "least_squares",
    shared: { "disturbance.standard_deviation": 0 },
  },
  {
    key: "order",
    title: "Fractional or not",
    sentence: "The fractional order 0.9 (A) starts with less error, the ordinary order 1 (B) ends with less error.",
    a: "corrected",
    b: "corrected",
    own: { b: { "controller.order": 1 } },
    plot: "error",
  },
  {
    key: "draw",
    title: "Draw the motion",
    sentence:
      "The mass follows any closed figure, a heart here: from it, least squares (A) know the rate to 10 rad/s after " +
      "10 ms, and the corrected law (B) not to 100 after 30. Draw another one below the gyroscope.",
    a: "least_squares",
    b: "corrected",
    figure: FIGURES.heart,
  },
  {
    key: "your-own",
    title: "Your own function",
    sentence:
      "A dozen lines of JavaScript (B) know the rate to 20 rad/s after 10 ms; the corrected law (A) is off by 200 " +
      "for 10 more. Change them under Settings, and run them.",
    a: "corrected",
    b: "yours",
  },
  {
    key: "allan",
    title: "Allan deviation",
    sentence:
      "From noisy positions, least squares (B) swing with the motion: 40 rad/s at 1 to 2 ms of averaging. A Kalman " +
      "filter (A), once it has learned D and K, stays below 4 rad/s at any time of averaging.",
    a: "joint",
    b: "least_squares",
    sensors: "positions",
    plot: "allan",
    speed: 27,
    window: 80,
  },
  {
    key: "lqg",
    title: "Another controller",
    sentence:
      "Linear-quadratic feedback on a Kalman filter (B) has less than a third of the corrected controller's " +
      "error (A), from the start on.",
    a: "corrected",
    b: "lqg",
    plot: "error",
  },
  {
    key: "long-step",
    title: "Too long a step",
    sentence:
      "With 6 µs between samples instead of 1 µs, the corrected controller (A) diverges after 1 ms; a PID with " +
      "the same model of the plant (B) does not.",
    a: "corrected",
    b: "pid",
    speed: 1.7,
    window: 5,
    plot: "error",
    shared: { "run.step": 0.006 },
  },
];
