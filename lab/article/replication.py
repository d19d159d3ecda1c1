"""The paper's study, run again: values for the text and the table of claims."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import logs
import numpy as np
import xarray as xr
from fracgyro import fractional
from fracgyro.analysis import metrics
from fracgyro.scenario import bounded
from fracgyro.simulation.simulate import DivergedError, simulate
from fracgyro_lab.paper.claims import Claim, judge
from fracgyro_lab.paper.errata import ERRATA
from fracgyro_lab.paper.runs import ORDERS, PAPER_ORDER, VARIANTS, Runs, Study, record_all, scenario, study
from fracgyro_lab.paper.step_cost import StepCost
from fracgyro_lab.paper.table import farther_off, order_ranges
from words import short, spelled, uncertain

LONG, LIMIT = 5000.0, 0.5  # long runs: their length, and the switching limit of one of them
LAYERS = ("quadratic", "linear")
EACH = 1000  # samples to a unit of time
RATE = scenario("corrected", "proposed").plant.nondimensional()[2]  # the true one
Values = dict[str, Any]


@dataclass(frozen=True)
class Replication:
    runs: Runs
    study: Study
    claims: list[Claim]
    long: xr.Dataset  # the proposed controller run on until it diverges
    limited: xr.Dataset


def replicate(seeds: int) -> Replication:
    runs, results = record_all(), study(seeds)
    base = scenario("corrected", "proposed").replace({"run.duration": LONG, "run.record_every": EACH})
    try:
        long = simulate(base)
    except DivergedError as error:
        long = error.run
    limited = simulate(base.replace({"controller.switching_limit": LIMIT}))
    return Replication(runs, results, judge(runs, results, step_costs()), long, limited)


def step_costs() -> dict[str, StepCost]:
    """Step costs from the committed log: a copy of the article measures no time."""
    found = {}
    for variant in VARIANTS:
        evidence = logs.row("reproduction", **{"": "i", "variant": variant})["evidence"]
        ratio, nanoseconds, exponentials = logs.numbers(
            re.sub(r"^.*?takes (\S+) times.*?, (\S+) ns against.*? (\d+) exponentials.*", r"\1 \2 \3", evidence)
        )
        found[variant] = StepCost((ratio,), (1e-9 * nanoseconds,), int(exponentials))
    return found


def values(r: Replication) -> Values:
    return {
        "setup": _setup(),
        "claims": _claims(r),
        "errata": [{"where": e.where, "printed": e.printed, "correct": e.correct, "why": e.why} for e in ERRATA],
        "seen": _seen(r),
        "end": _end(r),
    }


def _setup() -> Values:
    """The paper's numbers, from its scenario."""
    s = scenario("corrected", "proposed")
    damping, stiffness, rate, _, _ = s.plant.nondimensional()
    c, a = s.controller, s.adaptation
    kernel = fractional.kernel.design(c.order, s.run.step, s.run.duration, s.run.kernel_tolerance)
    return {
        "damping": [f"{d:g}" for d in damping],
        "stiffness": [f"{k:.4g}" for k in stiffness],
        "rate": f"{rate:g}",
        "order": f"{c.order:g}",
        "fractional_gain": f"{c.fractional_gain[0]:g}",
        "terminal_gain": f"{c.terminal_gain[0]:g}",
        "exponent": f"{c.terminal_exponent:g}",
        "layer": f"{c.layer_thickness:g}",
        "gain": f"{a.rate_gain:g}",
        "bound_gain": [f"{x:g}" for x in a.bound_gain],
        "bound": [f"{b:g}" for b in a.initial_bound],
        "ratio": f"{a.initial_ratio:g}",
        "step": f"{s.run.step:g}",
        "duration": f"{s.run.duration:g}",
        "floor": short(c.singularity_floor),
        "tolerance": short(s.run.kernel_tolerance),
        "exponentials": str(kernel.count),
        "certified": short(kernel.error),
    }


def _claims(r: Replication) -> Values:
    held = {
        variant: [c for c in r.claims if c.variant == variant and c.verdict == "reproduced"] for variant in VARIANTS
    }
    pairs: dict[str, dict[str, Claim]] = {}
    for claim in r.claims:
        pairs.setdefault(claim.id, {})[claim.variant] = claim
    seeds = r.study["printed", "proposed", PAPER_ORDER].sizes["run"]
    return {
        "seeds": str(seeds),
        "total": spelled(len(pairs)),
        "held": {variant: spelled(len(found)) for variant, found in held.items()},
        "names": {variant: [c.id for c in found] for variant, found in held.items()},
        "rows": [
            {
                "id": identifier,
                "claim": pair["printed"].claim,
                "criterion": pair["printed"].criterion,
                **{v: {"held": pair[v].verdict == "reproduced", "seen": _short(pair[v], r)} for v in VARIANTS},
            }
            for identifier, pair in pairs.items()
        ],
    }


def _short(claim: Claim, r: Replication) -> str:
    """The evidence in a few words; claims.py has it in full."""

    def of(name: str, controller: str = "proposed") -> xr.DataArray:
        return r.study[claim.variant, controller, PAPER_ORDER][name]

    def middle(values: xr.DataArray) -> float:
        return float(values.median())

    if claim.id == "a":
        finer = re.search(r"0\.001: ([\d.]+)", claim.evidence)
        assert finer is not None, claim.evidence
        return f"below 1 % from t = {short(middle(of('error_settling_time')), 3)}, below 0.1 % from {finer[1]}"
    if claim.id == "b":
        theirs, mine = of("error_settling_time", "fractional"), of("error_settling_time")
        share = float((theirs > mine).mean())
        return f"from t = {short(middle(theirs), 3)}; the slower one in {100 * share:.0f} % of seeds"
    if claim.id == "c":
        ratio = of("rmse").mean("run") / of("rmse", "conventional").mean("run")
        x, y = (float(ratio.sel(window="steady", axis=axis)) for axis in "xy")
        return f"steady error {short(x)} and {short(y)} times the conventional one's on x and y"
    if claim.id == "d":
        rises = re.search(r"rises above its lowest value so far by up to (.*?) of V\(0\)", claim.evidence)
        assert rises is not None, claim.evidence
        t = short(middle(of("surface_settling_time")), 3)
        return f"s within the layer from t = {t}; V rises by {rises[1]} of V(0) at h, h/2, h/4"
    if claim.id == "e":
        return f"chattering index at most {short(float(of('chattering').max()))}"
    if claim.id == "f":
        rate = middle(abs(of("rate_error"))) / RATE
        d, k = middle(of("damping_error")), middle(of("stiffness_error"))
        return f"at t = 80 off by {short(rate)} (Ω̂z), {short(d)} (D̂), {short(k)} (K̂) of the true values"
    if claim.id == "g":
        end, half = of("bound_final").sel(bound=0), of("bound_0_halfway")
        return f"b̂₀ grows by {short(100 * float(((end - half) / half).mean()))} % from t = 40 to 80"
    if claim.id == "h":
        best = [order for order in _best_orders(r.study, claim.variant).values() if order == PAPER_ORDER]
        return f"least at α = 0.9 in {len(best)} of 6 columns"
    evidence = logs.row("reproduction", **{"": claim.id, "variant": claim.variant})["evidence"]
    found = re.search(r"range (\S+) to (\S+) over (\d+) paired timings", evidence)
    assert found is not None, evidence
    ratio = float(np.median(step_costs()[claim.variant].ratios))
    return f"{short(ratio, 3)} times the time of a step ({found[1]} to {found[2]} in {found[3]} timings)"


def _best_orders(results: Study, variant: str) -> dict[tuple[str, str], float]:
    """By window and axis."""
    best = {}
    for window in ("whole", "transient", "steady"):
        for axis in ("x", "y"):
            means = {
                o: float(results[variant, "proposed", o]["rmse"].sel(window=window, axis=axis).mean()) for o in ORDERS
            }
            best[window, axis] = min(means, key=lambda order: means[order])
    return best


def _seen(r: Replication) -> Values:
    """Effects of the three errata that the two readings switch, and of the rate."""
    printed, corrected = (r.runs[variant, "proposed"] for variant in ("printed", "corrected"))
    late = metrics.cut(printed, (40.0, None))
    entry = late["rate_estimate"] + late["rate_symmetric_estimate"].sel(entry="xy")
    layers = {}
    for name, run in (("printed", printed), ("corrected", corrected)):
        surface = metrics.cut(run, metrics.STEADY)["surface"]
        layers[name] = short(float(np.sqrt((surface**2).sum("axis").mean("time"))))
    results = {v: r.study[v, "proposed", PAPER_ORDER] for v in VARIANTS}
    orders = _best_orders(r.study, "corrected")
    bound = corrected["bound_estimate"].sel(bound=0)
    return {
        "moved": short(float(abs(printed["rate_estimate"] - printed["rate_estimate"][0]).max())),
        "symmetric": short(float(abs(printed["rate_symmetric_estimate"]).max())),
        "element": uncertain(float(entry.mean()), float(entry.std())),
        "peak": short(float(results["corrected"]["rate_error_peak"].median()) / RATE, 3),
        "late": short(float(abs(results["corrected"]["rate_error"]).median()) / RATE),
        "layer": layers,
        "order_whole": {axis: f"{orders['whole', axis]:g}" for axis in "xy"},
        "order_steady": {axis: f"{orders['steady', axis]:g}" for axis in "xy"},
        "farther": {
            variant: {axis: order_ranges(farther_off(r.study, variant, "whole", axis)) for axis in "xy"}
            for variant in VARIANTS
        },
        "steady": {v: short(float(of["rmse"].sel(window="steady", axis="x").mean())) for v, of in results.items()},
        "largest_force": {v: short(float(of["largest_force"].max()), 3) for v, of in results.items()},
        "bound": [short(float(bound.sel(time=t, method="nearest")), 3) for t in (20, 40, 60, 80)],
    }


def gains_over_time(run: xr.Dataset, limit: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """rho h/delta at every tenth of the recorded samples."""
    changes = {} if limit is None else {"controller.switching_limit": limit}
    of, thin = scenario("corrected", "proposed").replace(changes), run.isel(time=slice(None, None, 10))
    sizes = zip(
        thin["bound_estimate"].values,
        np.hypot(*thin["position"].values.T),
        np.hypot(*thin["velocity"].values.T),
        strict=True,
    )
    return thin["time"].values, np.array([bounded.gain(of, *each) for each in sizes])


def _end(r: Replication) -> Values:
    last = float(r.long["time"][-1])
    late = r.limited["error"][-EACH:]
    paper = logs.row("boundedness", surface="fractional fast terminal (paper)")
    threshold = logs.number(paper["predicted"])
    times, gains = gains_over_time(r.long)
    beyond = times[gains > threshold]
    return {
        "diverged": last < LONG,
        "t": f"{last:.0f}",
        "seconds": short(last / 1000),
        "threshold": paper["predicted"],
        "measured": paper["measured"],
        "crossed": f"{beyond[0]:.0f}" if len(beyond) else "–",
        "largest_gap": _largest_gap(),
        "printed": _printed_end(),
        "layers": _layers(),
        "limit": f"{LIMIT:g}",
        "limited": short(float(np.sqrt((late**2).sum("axis").mean()))),
        "long": f"{LONG:g}",
    }


def _printed_end() -> Values:
    """The printed reading run on, which the log has for longer than this copy runs."""
    row = logs.row("boundedness", reading="as printed", layer="quadratic (its own)")
    diverged, _, seeds = row["diverged"].partition(" of ")
    if diverged != "0":
        raise ValueError("benchmarks/results/boundedness.md: the printed reading diverges, which the text denies")
    return {
        "units": row["run to t"],
        "seconds": short(logs.number(row["run to t"]) / 1000),
        "seeds": seeds,
        "rms": short(logs.number(row["RMS of ‖e‖"])),
        "gain": row["ρ h/δ"],
    }


def _layers() -> Values:
    """Number of the log's runs for each reading and layer; when those diverge that have the linear one, as corrected.

    Raises ValueError if it is not the layer that decides, which the text states.
    """
    rows = logs.rows("boundedness", "reading", "layer", "diverged")

    def of(reading: str, layer: str) -> logs.Row:
        (row,) = (row for row in rows if row["reading"] == f"as {reading}" and row["layer"].startswith(layer))
        return row

    counts = {layer: {v: of(v, layer)["diverged"].partition(" of ")[0] for v in VARIANTS} for layer in LAYERS}
    runs = of("corrected", "linear")["diverged"].partition(" of ")[2]
    if any(count != "0" for count in counts["quadratic"].values()) or set(counts["linear"].values()) != {runs}:
        raise ValueError("benchmarks/results/boundedness.md: it is not the layer that decides, as stated by the text")
    return {"runs": runs, "at": of("corrected", "linear")["at t"]}


def _largest_gap() -> str:
    """Between the predicted threshold and the measured one, in the linear layer."""
    found = [row for row in logs.rows("boundedness", "predicted", "measured") if "quadratic" not in row["surface"]]
    return short(max(abs(logs.number(row["predicted"]) - logs.number(row["measured"])) for row in found), 1)
