"""Stability limit of the sampled loop, and the cost of a limit on rho h/delta.

Writes benchmarks/results/boundedness.md.
"""

from __future__ import annotations

import math

import fracgyro as fg
import numpy as np
from fracgyro.scenario.bounded import gain
from fracgyro.scenario.named import exactly_sensed
from fracgyro_lab.paper import runs as paper
from machine import command, machine, write

DEPENDS_ON = ["sliding_mode", "composite"]

PAPER = fg.Scenario.paper()
SEEDS = range(24)
READ_ON, READ_SEEDS = 20_000.0, 8
LIMITS = [0.05, 0.1, 0.25, 0.5, 0.75, 1.0]

# Known parameters, frozen bounds, no noise; the start is almost on the reference.
STILL = {
    "controller.adaptive": False,
    "disturbance.kind": "none",
    "run.initial_position": (1e-6, 1.0),
    "run.initial_velocity": (math.pi, 0.0),
    "run.duration": 20.0,
}
RESONANT = exactly_sensed("paper_resonance").replace(
    {
        "controller.adaptive": False,
        "controller.force_limit": math.inf,
        "controller.switching_limit": math.inf,
        "disturbance.kind": "none",
        "run.duration": 400.0,
    }
)
# Its s = 0 is stable, so it must start outside the layer.
QUADRATIC = {"controller.layer": "quadratic", "run.initial_velocity": (math.pi + 1.0, 0.0)}
KINDS = ["linear", "fractional", "fast_terminal", "fractional_fast_terminal"]
OF_KIND = {kind: {"controller.kind": kind} for kind in KINDS}
THRESHOLDS: list[tuple[str, fg.Scenario]] = [
    ("linear", PAPER.replace({**STILL, **OF_KIND["linear"]})),
    ("linear, δ = 0.006", PAPER.replace({**STILL, **OF_KIND["linear"], "controller.layer_thickness": 0.006})),
    *(
        (f"linear, h = {h:g}", PAPER.replace({**STILL, **OF_KIND["linear"], "run.step": h, "disturbance.hold": None}))
        for h in (2.5e-4, 2e-3, 5e-3)
    ),
    ("linear, λ1 = 100", PAPER.replace({**STILL, **OF_KIND["linear"], "controller.fractional_gain": 100.0})),
    ("linear, at resonance, h = 0.05", RESONANT.replace(OF_KIND["linear"])),
    ("fractional, α = 0.9", PAPER.replace({**STILL, **OF_KIND["fractional"]})),
    *(
        (
            f"fractional, α = {order:g}, λ1 = 200",
            PAPER.replace(
                {
                    **STILL,
                    **OF_KIND["fractional"],
                    "controller.order": order,
                    "controller.fractional_gain": 200.0,
                    "controller.derivative": derivative,
                }
            ),
        )
        for order, derivative in ((0.9, "riemann_liouville"), (0.7, "riemann_liouville"))
    ),
    (
        "fractional, α = 0.9, λ1 = 200, Caputo",
        PAPER.replace(
            {
                **STILL,
                **OF_KIND["fractional"],
                "controller.fractional_gain": 200.0,
                "controller.derivative": "caputo",
            }
        ),
    ),
    ("fast terminal", PAPER.replace({**STILL, **OF_KIND["fast_terminal"]})),
    (
        "fast terminal, ε = 1e-4",
        PAPER.replace({**STILL, **OF_KIND["fast_terminal"], "controller.singularity_floor": 1e-4}),
    ),
    ("fractional fast terminal (paper)", PAPER.replace(STILL)),
    ("linear, quadratic layer", PAPER.replace({**STILL, **OF_KIND["linear"], **QUADRATIC})),
]


def nyquist(order: float, step: float) -> tuple[float, float]:
    """D^order and D^(order-1) of the error at the samples, for a rate that alternates between +1 and -1."""
    odd = np.arange(1.0, 20001.0, 2.0)
    scale = 8 / math.pi**2 * (step / math.pi) ** (1 - order)
    derivative = scale * math.sin(0.5 * math.pi * order) * np.sum(odd ** (order - 3))
    integral = -scale * step / math.pi * math.cos(0.5 * math.pi * order) * np.sum(odd ** (order - 4))
    return float(derivative), float(integral)


def predicted(scenario: fg.Scenario) -> float:
    """rho h/delta at which s alternates permanently around e = 0."""
    c, h = scenario.controller, scenario.run.step
    order = c.order if c.kind.startswith("fractional") else 1.0
    derivative, integral = nyquist(order, h) if order < 1 else (1.0, 0.0)
    damping, stiffness, *_ = scenario.plant.nondimensional()
    top = 2 - max(stiffness[0], stiffness[2]) * h * h / 6 + min(damping[0], damping[2]) * h
    lambda1 = max(c.fractional_gain)
    steep = max(c.terminal_gain) * c.terminal_exponent * c.singularity_floor ** (c.terminal_exponent - 1)
    steep = steep if c.kind.endswith("fast_terminal") else 0.0
    return float((top - h * (lambda1 * derivative + steep)) / (1 + lambda1 * integral))


def measured(scenario: fg.Scenario) -> float:
    """By bisection: the rho h/delta from which s, at the end, is outside the layer."""
    c, h = scenario.controller, scenario.run.step
    low, high = 0.5, 3.0
    while high - low > 5e-4:
        slope = 0.5 * (low + high)
        bound = (slope * c.layer_thickness / h, 0.0, 0.0)
        try:
            run = fg.simulate(scenario.replace({"adaptation.initial_bound": bound}))
            rings = np.hypot(*run["surface"].values[-200:].T).max() > c.layer_thickness
        except fg.DivergedError:
            rings = True
        low, high = (low, slope) if rings else (slope, high)
    return 0.5 * (low + high)


def thresholds() -> list[str]:
    lines = [
        "## The threshold",
        "",
        "Known parameters, only b̂0, frozen, no noise, started 1e-6 off the reference (quadratic layer: outside the "
        "layer). Predicted: the ρ h/δ at which s alternates for ever about e = 0, by EQUATIONS.md. Measured, by "
        "bisection: from where s is outside the layer at the end.",
        "",
        "| surface | predicted | measured |",
        "|---|---|---|",
    ]
    for name, scenario in THRESHOLDS:
        lines.append(f"| {name} | {predicted(scenario):.4f} | {measured(scenario):.4f} |")
        print(lines[-1], flush=True)
    return lines


def readings() -> list[str]:
    """The proposed controller as printed and as corrected, and with the boundary layers exchanged."""
    lines = [
        "## As printed and as corrected, run on",
        "",
        f"The proposed controller in the paper's noise, which ends its figures at t = 80, for {READ_ON:g} units, "
        f"{READ_SEEDS} seeds: when it diverged; if it did not, RMS and largest sample of ‖e‖ over the last 1000 units; "
        "and the largest ρ h/δ of the last 200. The layer decides, and neither of the other two corrections does.",
        "",
        "| reading | layer | run to t | diverged | at t | RMS of ‖e‖ | largest ‖e‖ | ρ h/δ |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for reading in ("printed", "corrected"):
        for layer in ("quadratic", "linear"):
            ended, last, gains = [], [], []
            for seed in range(READ_SEEDS):
                changes = {"controller.layer": layer, "run.duration": READ_ON, "run.record_every": 1000}
                base = paper.scenario(reading, "proposed", seed=seed).replace(changes)
                try:
                    run = fg.simulate(base)
                    last.append(np.hypot(*run["error"].values[-1000:].T))
                except fg.DivergedError as error:
                    run = error.run
                    ended.append(float(run["time"][-1]))
                sizes = (np.hypot(*run[each].values[-200:].T) for each in ("position", "velocity"))
                bound = run["bound_estimate"].values[-1]
                gains.append(max(gain(base, bound, *each) for each in zip(*sizes, strict=True)))
            at = f"{min(ended):.0f} to {max(ended):.0f}" if ended else "–"
            e = np.concatenate(last) if last else None
            errors = "– | –" if e is None else f"{math.sqrt((e**2).mean()):.1e} | {e.max():.1e}"
            own = " (its own)" if layer == paper.scenario(reading, "proposed").controller.layer else ""
            count = f"{len(ended)} of {READ_SEEDS}"
            cells = [f"as {reading}", layer + own, f"{READ_ON:,.0f}", count, at, errors, f"{max(gains):.3g}"]
            lines.append(f"| {' | '.join(cells)} |")
            print(lines[-1], flush=True)
    return lines


def noise_cases() -> list[tuple[str, dict[str, object]]]:
    cases: list[tuple[str, dict[str, object]]] = [
        (f"{kind}, {law}", {**changes, "adaptation.kind": law})
        for kind, changes in OF_KIND.items()
        for law in ("gradient", "composite")
    ]
    linear = OF_KIND["linear"]
    cases += [
        ("linear, σ = 3", {**linear, "disturbance.standard_deviation": 3.0}),
        ("linear, σ = 0.3", {**linear, "disturbance.standard_deviation": 0.3}),
        ("linear, δ = 0.02", {**linear, "controller.layer_thickness": 0.02}),
        ("linear, δ = 0.2", {**linear, "controller.layer_thickness": 0.2}),
        ("linear, h = 5e-4, hold 1e-3", {**linear, "run.step": 5e-4}),
        ("linear, h = 2e-3", {**linear, "run.step": 2e-3, "disturbance.hold": 2e-3}),
        ("linear, force limit 6000", {**linear, "controller.force_limit": 6000.0}),
        ("paper as printed", {"controller.layer": "quadratic", "controller.derivative": "caputo"}),
    ]
    return cases


def ends() -> list[str]:
    lines = [
        "## In noise",
        "",
        "The paper's scenario with bounds that grow three times as fast, over 3000 units: ρ h/δ, largest of 5 units, "
        "when the mean of ‖s‖ over these last was below half of the layer; and the same run with "
        "controller.switching_limit = 0.5, RMS of ‖e‖ over its last 100 units.",
        "",
        "| run | calm until ρ h/δ | at t | diverged at | limited: ‖e‖ |",
        "|---|---|---|---|---|",
    ]
    for name, changes in noise_cases():
        base = PAPER.replace(
            {"adaptation.bound_gain": (3.0, 4.8, 4.8), "run.duration": 3000.0, "run.record_every": 10, **changes}
        )
        end = "not"
        try:
            run = fg.simulate(base)
        except fg.DivergedError as error:
            run = error.run
            end = f"{float(run['time'][-1]):.0f}"
        every = round(5 / float(run["time"][1]))
        s = np.hypot(*run["surface"].values.T)
        blocks = s[: len(s) // every * every].reshape(-1, every).mean(axis=1)
        calm = np.flatnonzero(blocks < 0.5 * base.controller.layer_thickness)
        cells = ["never", "–"]  # the initial transient drives the bounds beyond it
        if calm.size:
            last = slice(calm[-1] * every, (calm[-1] + 1) * every)
            q, v = (np.hypot(*run[each].values[last].T) for each in ("position", "velocity"))
            bound = run["bound_estimate"].values[last][-1]
            slope = max(gain(base, bound, *sizes) for sizes in zip(q, v, strict=True))
            cells = [f"{slope:.2f}", f"{float(run['time'][last.stop - 1]):.0f}"]
        limited = fg.simulate(base.replace({"controller.switching_limit": 0.5}))
        e = limited["error"].values[-round(100 / float(run["time"][1])) :]
        rms = math.sqrt((e**2).sum(axis=1).mean())
        lines.append(f"| {name} | {' | '.join(cells)} | {end} | {rms:.1e} |")
        print(lines[-1], flush=True)
    return lines


def costs() -> list[str]:
    lines = [
        "## What the limit costs",
        "",
        f"{len(SEEDS)} noise seeds, means; in brackets the ratio to the same runs without a limit, which is the "
        "unlimited law while it lasts. Early: over the paper's 80 units, transient t < 10 and steady. Late: t = 900 to "
        "1000.",
        "",
        "| surface, adaptation | limit | transient RMSE x, y | steady RMSE x, y | Ω̂z, RMS error, t > 10 "
        "| late RMSE x, y | late Ω̂z |",
        "|---|---|---|---|---|---|---|",
    ]
    proposed = "fractional_fast_terminal"
    for kind, law in ((proposed, "gradient"), (proposed, "composite"), ("linear", "gradient")):
        base = PAPER.replace({"controller.kind": kind, "adaptation.kind": law})
        limits = [math.inf, *LIMITS]
        cases = [base.replace({"controller.switching_limit": limit}) for limit in limits]
        long = [case.replace({"run.duration": 1000.0}) for case in cases]
        found = []
        for runs, transient in ((cases, 10.0), (long, 900.0)):
            many = fg.measure_many(runs, seeds=SEEDS, transient=transient)
            rmse = many["rmse"].values.reshape(len(limits), len(SEEDS), 3, 2).mean(axis=1)
            rate = many["rate_error_rms"].values.reshape(len(limits), -1).mean(axis=1)
            assert many["diverged_at"].isnull().all()
            found.append((rmse, rate))
        (early, early_rate), (late, late_rate) = found
        for i, limit in enumerate(limits):
            numbers = [*early[i, 1], *early[i, 2], early_rate[i], *late[i, 2], late_rate[i]]
            free = [*early[0, 1], *early[0, 2], early_rate[0], *late[0, 2], late_rate[0]]
            cells = [f"{a:.3g} ({a / b:.3f})" if i else f"{a:.3g}" for a, b in zip(numbers, free, strict=True)]
            pairs = [", ".join(cells[0:2]), ", ".join(cells[2:4]), cells[4], ", ".join(cells[5:7]), cells[7]]
            lines.append(f"| {kind}, {law} | {'none' if i == 0 else limit} | {' | '.join(pairs)} |")
            print(lines[-1], flush=True)
    return lines


def main() -> None:
    head = ["# Bounded for good", "", f"Made by `{command()}`. Machine: {machine()}."]
    text = "\n\n".join("\n".join(part) for part in (head, thresholds(), readings(), ends(), costs()))
    write("boundedness", [text])


if __name__ == "__main__":
    main()
