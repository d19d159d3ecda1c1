"""The paper's claims a to i, each against a numeric criterion, for both variants."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import xarray as xr
from fracgyro.analysis import metrics
from fracgyro.analysis.confidence import mean_interval
from fracgyro.scenario import Scenario
from fracgyro.simulation.simulate import simulate
from numpy.typing import NDArray

from ..verdicts import MIN_SHARE, Claim, Criteria, Judged, share, verdicts
from .runs import ORDERS, PAPER_ORDER, VARIANTS, Runs, Study, scenario
from .step_cost import SHORT, StepCost

__all__ = ["CLAIMS", "Claim", "Material", "judge"]

ERROR_BOUND = 0.01  # 1 % of the reference's amplitude, the smallest visible error on the paper's axes


@dataclass(frozen=True)
class Material:
    """Data for the verdict on a claim."""

    variant: str
    runs: Runs
    study: Study
    cost: StepCost = field(default_factory=StepCost)

    def metric(self, name: str, controller: str = "proposed", order: float = PAPER_ORDER) -> xr.DataArray:
        return self.study[self.variant, controller, order][name]

    def recorded(self, controller: str = "proposed") -> xr.Dataset:
        return self.runs[self.variant, controller]


def judge(runs: Runs, study: Study, costs: Mapping[str, StepCost]) -> list[Claim]:
    """Every claim for both variants, in the paper's order."""
    return verdicts(CLAIMS, {variant: Material(variant, runs, study, costs[variant]) for variant in VARIANTS})


def _times(values: xr.DataArray) -> str:
    """Median and range of settling times, of which NaN means never."""
    settled = values.values[np.isfinite(values.values)]
    if settled.size == 0:
        return f"never in any of {values.size} seeds"
    never = f", never in {values.size - settled.size}" if settled.size < values.size else ""
    spread = f"{np.median(settled):.2f} (range {settled.min():.2f} to {settled.max():.2f})"
    return f"{spread} over {settled.size} seeds{never}"


def error_settles(m: Material) -> Judged:
    times = m.metric("error_settling_time")
    run = m.recorded()
    others = ", ".join(f"{b:g}: {float(metrics.settling_time(run, b)):.2f}" for b in (0.05, 0.02, 0.005, 0.001))
    settled = share(times < 5)
    return settled >= MIN_SHARE, (
        f"‖e‖ stays below {ERROR_BOUND:g} from t = {_times(times)}; before t = 5 in {settled:.0%} of them. "
        f"For other bounds (seed 0) {others}. In the run's 80 time units the error never becomes zero: noise keeps "
        f"its steady RMS at {mean_interval(m.metric('rmse').sel(window='steady', axis='x')):.2g} on x."
    )


def fractional_is_slower(m: Material) -> Judged:
    mine, theirs = m.metric("error_settling_time"), m.metric("error_settling_time", "fractional")
    median, slower = float(theirs.median()), share(theirs > mine)
    return 7.5 <= median <= 12.5 and slower >= MIN_SHARE, (
        f"fractional SMC settles at {_times(theirs)}, the proposed controller at {_times(mine)}; "
        f"fractional SMC is the slower of the two in {slower:.0%} of seeds."
    )


def more_accurate_than_conventional(m: Material) -> Judged:
    difference = m.metric("rmse", "conventional") - m.metric("rmse")
    parts, held = [], True
    for window in ("transient", "steady"):
        for axis in ("x", "y"):
            gain = mean_interval(difference.sel(window=window, axis=axis))
            base = float(m.metric("rmse", "conventional").sel(window=window, axis=axis).mean())
            held &= gain.low > 0
            parts.append(f"{window} {axis} {gain.mean / base:+.1%} [{gain.low / base:+.1%}, {gain.high / base:+.1%}]")
    return held, (
        "RMSE saved against conventional fast terminal SMC (negative: lost), paired by seed, with 95 % confidence "
        "interval: " + "; ".join(parts) + "."
    )


def surface_converges(m: Material) -> Judged:
    times = m.metric("surface_settling_time")
    settled = share(times < 10)
    late = metrics.cut(m.recorded(), metrics.STEADY)["surface"]
    rms = ((late**2).mean("time") ** 0.5).values
    rises = [_lyapunov_rise(m.variant, step) for step in (1e-3, 5e-4, 2.5e-4)]
    falls = all(finer <= 0.5 * coarser for coarser, finer in pairwise(rises))
    return settled >= MIN_SHARE and falls, (
        f"‖s‖ stays within the layer δ = 0.06 from t = {_times(times)}; conventional: "
        f"{_times(m.metric('surface_settling_time', 'conventional'))}. After t = 10 the RMS of s is "
        f"{rms[0]:.2g}, {rms[1]:.2g} (seed 0): an ultimate bound set by the noise, not zero in finite time. "
        "Without noise and layer V rises above its lowest value so far by up to "
        + ", ".join(f"{rise:.2g}" for rise in rises)
        + " of V(0) at h = 1e-3 and its half and quarter: "
        + ("V never rises in the limit h -> 0 only." if falls else "(45) does not hold for these equations.")
    )


def _lyapunov_rise(variant: str, step: float) -> float:
    """The largest rise of V, eq. (39), above its running minimum, over V(0)."""
    run = simulate(
        scenario(variant, "proposed").replace(
            {
                "controller.layer_thickness": 0.0,
                "disturbance.kind": "none",
                "run.duration": 10.0,
                "run.step": step,
            }
        )
    )
    # Without a disturbance (45) holds for any bounds; with the initial ones their errors start at zero.
    bounds = Scenario.from_toml(run.attrs["scenario"]).adaptation.initial_bound
    return _largest_rise(metrics.lyapunov(run, bounds).values)


def _largest_rise(v: NDArray[np.float64]) -> float:
    """Largest rise above the running minimum, relative to the first value."""
    return float((v - np.minimum.accumulate(v)).max() / v[0])


def no_chattering(m: Material) -> Judged:
    worst = float(m.metric("chattering").max())
    base = scenario(m.variant, "proposed")
    switching = simulate(base.replace({"controller.layer_thickness": 0.0}))
    without = float(metrics.chattering(switching).max())
    return worst < 0.01, (
        f"largest chattering index over seeds and axes {worst:.2g}; the same controller without a layer (δ = 0): "
        f"{without:.2g}; a force that flips at every sample would have 4, the smooth force only "
        f"{(np.pi * base.run.step) ** 2:.0e}. The largest |u| is {float(m.metric('largest_force').max()):.0f}, "
        f"against {float(m.metric('effort').mean()):.0f} RMS."
    )


def estimates_converge(m: Material) -> Judged:
    truth = 0.1
    errors = {
        "Ω̂z": abs(m.metric("rate_error")) / truth,
        "D̂": m.metric("damping_error"),
        "K̂": m.metric("stiffness_error"),
    }
    shares = {name: share(e <= 0.05) for name, e in errors.items()}
    texts = [
        f"{name} off by {float(e.median()):.2g} of the true value (median; {shares[name]:.0%} of seeds within 5 %)"
        for name, e in errors.items()
    ]
    peaks = {
        c: float(m.metric("rate_error_peak", c).median()) / truth for c in ("proposed", "fractional", "conventional")
    }
    settled = {c: share(m.metric("rate_settling_time", c) < 79) for c in peaks}
    rank = (
        "Peak error of Ω̂z, and share of seeds in which Ω̂z has settled within 10 % of the true value before the last "
        "unit of time: "
    )
    rank += "; ".join(f"{c} {peaks[c]:.3g} × Ωz, {settled[c]:.0%}" for c in peaks) + "."
    base = scenario(m.variant, "proposed")
    held = 0.5 * base.run.step * base.plant.nondimensional()[1]
    sampling = (
        f" Holding the force for a step h makes the plant look as if damped by K h/2 = {held[0]:.2f}, {held[1]:.2f}, "
        f"{held[2]:.2f} (xx, xy, yy) more, many times the true damping."
    )
    if m.variant == "printed":
        rank = "The skew part of Ω̂ never moves from 0.95 Ωz, under any of the three controllers."
    return all(each >= MIN_SHARE for each in shares.values()), (f"at t = 80: {'; '.join(texts)}.{sampling} {rank}")


def bounds_settle(m: Material) -> Judged:
    end, half = m.metric("bound_final").sel(bound=0), m.metric("bound_0_halfway")
    growth = (end - half) / half
    return bool((growth < 0.01).all()), (
        f"b̂0 grows from {float(half.mean()):.3f} at t = 40 to {float(end.mean()):.3f} at t = 80, by "
        f"{mean_interval(growth * 100):.2g} %, {float((end - half).mean()) / 40:.1e} per unit of time. "
        "‖s‖ ≥ 0 under (44), so under noise b̂ can only grow."
    )


def order_is_best(m: Material) -> Judged:
    held, parts = True, []
    for window in ("whole", "transient", "steady"):
        for axis in ("x", "y"):
            by_order = {o: m.metric("rmse", order=o).sel(window=window, axis=axis) for o in ORDERS}
            best = min(by_order, key=lambda o: float(by_order[o].mean()))
            rival = min((o for o in ORDERS if o != PAPER_ORDER), key=lambda o: float(by_order[o].mean()))
            gap = mean_interval(by_order[rival] - by_order[PAPER_ORDER])
            if window == "whole":
                held &= best == PAPER_ORDER and gap.low > 0
            parts.append(
                f"{window} {axis}: α = {best:g} ({float(by_order[best].mean()):.3g}; at 0.9 "
                f"{float(by_order[PAPER_ORDER].mean()):.3g})"
            )
    return held, "order of least mean RMSE: " + "; ".join(parts) + "."


def costs_more(m: Material) -> Judged:
    ratios, seconds = m.cost.ratios, float(np.median(m.cost.seconds))
    ratio = float(np.median(ratios))
    return ratio > 1, (
        f"a step of the proposed controller takes {ratio:.2f} times one of the conventional (range "
        f"{min(ratios):.2f} to {max(ratios):.2f} over {len(ratios)} paired timings), {seconds * 1e9:.0f} ns against "
        f"{seconds / ratio * 1e9:.0f} ns, with its {m.cost.exponentials} exponentials for {SHORT:g} units of time. "
        "With the whole history summed at every step, as usual, the cost would grow with the run."
    )


CLAIMS: Criteria[Material] = {
    "a": (
        "Under the proposed controller the tracking error is zero in less than 5 s.",
        f"‖e‖ stays below {ERROR_BOUND:g} from before t = 5 on, in {MIN_SHARE:.0%} of seeds",
        error_settles,
    ),
    "b": (
        "Fractional sliding mode control needs about 10 s for that, longer than the proposed controller.",
        f"median time after which ‖e‖ stays below {ERROR_BOUND:g} between 7.5 and 12.5, "
        f"and later than the proposed controller's in {MIN_SHARE:.0%} of seeds",
        fractional_is_slower,
    ),
    "c": (
        "The proposed controller tracks more accurately than conventional fast terminal sliding mode control.",
        "mean RMSE lower on both axes, before and after t = 10, 95 % confidence interval of the paired difference "
        "excluding zero",
        more_accurate_than_conventional,
    ),
    "d": (
        "The sliding surface converges, and the Lyapunov function V of (39) never rises.",
        f"‖s‖ stays within the boundary layer, 0.06, from before t = 10 on, in {MIN_SHARE:.0%} of seeds; without noise "
        "and layer the largest rise of V at least halves each time the step is halved",
        surface_converges,
    ),
    "e": (
        "The control force does not chatter.",
        "RMS of the second difference of u between samples below 1 % of the RMS of u after t = 10, on both axes, "
        "in every seed",
        no_chattering,
    ),
    "f": (
        "The estimates of D, K and Ωz converge to their true values, fastest under the proposed controller.",
        f"at t = 80 each of the three is within 5 % of its true value in {MIN_SHARE:.0%} of seeds",
        estimates_converge,
    ),
    "g": ("The bound estimates b̂ settle.", "b̂0 grows by less than 1 % from t = 40 to t = 80", bounds_settle),
    "h": (
        "The RMSE is least at α = 0.9.",
        "least mean RMSE over the whole run at α = 0.9 on both axes among 0.1, 0.2, …, 1.0, 95 % confidence interval "
        "of the paired difference to the runner-up excluding zero",
        order_is_best,
    ),
    "i": (
        "The fractional order costs more computation than the integer one.",
        "time of a step, proposed over conventional, above 1 in the median of paired timings",
        costs_more,
    ),
}
