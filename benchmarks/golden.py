"""Golden runs: hashes of short runs and figures of rate sensors, which show whether the core's numbers have changed.

    python benchmarks/golden.py     writes golden.json, which a test compares with the installed module

A log of simulated numbers depends on golden.json instead of the text of what makes them (docs/decisions/0032). A run is
named after the controllers and adaptations it needs, by their headers; "core" are those that every log depends on,
"rate" those of logs that use fracgyro.rate. New runs go to the end, because a log names the number of runs that there
were when it was made. Figures of rate sensors come from fits and libraries, whose last digits depend on the processor:
they are the same if they agree to SAME.
"""

from __future__ import annotations

import hashlib
import json
import math
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import fracgyro as fg
import numpy as np
from fracgyro import _core
from fracgyro.scenario import ScenarioError
from fracgyro.scenario.kinds import VOLTS_CHANNELS
from fracgyro.scenario.named import NAMES, named
from sources import GOLDEN, ROOT, tokens

Changes = dict[str, Any]
Golden = str | list[float]
SAME = 1e-3  # relative
SHIPPED = ROOT / "python/fracgyro/scenario/shipped"
HEADERS = {
    **dict.fromkeys(("fractional_fast_terminal", "fractional", "fast_terminal", "linear"), "sliding_mode"),
    **dict.fromkeys(("open_loop", "force_rebalance"), "conventional"),
    "virtual_rotation": "whole_angle",
}
SURFACES = ("fractional_fast_terminal", "fractional", "fast_terminal", "linear")
ADAPTATIONS: dict[str, Changes] = {
    "gradient": {},
    "composite": {"adaptation.rate_forgetting": 2.0, "adaptation.forgetting": 0.1},
    "joint": {"adaptation.rate_forgetting": 2.0, "adaptation.forgetting": 0.1},
}
POSITIONS: Changes = {"device.sensing": "position", "device.position_noise_density": 1e-14}
CONDITIONS: dict[str, Changes] = {
    "exact": {},
    "noise": {"device.position_noise_density": 1e-13, "device.velocity_noise": 1e-7},
    "positions": POSITIONS,
    "filter": {**POSITIONS, "controller.filter": "kalman"},
    "late": {"device.delay": 1},
    "late, known": {"device.delay": 2, "datasheet.delay": 2},
    "limited": {"controller.force_limit": 500.0},
}
DEVICES: dict[str, Changes] = {
    "electronics": {
        "device.position_noise_density": 1e-14,
        "device.position_noise_corner": 1e3,
        "device.velocity_noise": 1e-9,
        "device.velocity_noise_corner": 2e4,
        "device.position_range": (2e-6, 1.5e-6),
        "device.position_bits": 18,
        "device.velocity_range": (0.1, 0.1),
        "device.velocity_bits": 20,
        "device.pickoff_gain_error": (1e-3, -2e-3),
        "device.pickoff_misalignment": 3e-3,
        "device.force_gain_error": (1e-2, 3e-2),
        "device.force_misalignment": -2e-3,
    },
    "known pick-offs": {
        "device.pickoff_gain_error": (1e-3, -2e-3),
        "device.pickoff_misalignment": 3e-3,
        "datasheet.pickoff_gain_error": (1e-3, -2e-3),
        "datasheet.pickoff_misalignment": 3e-3,
    },
    "drift": {
        "device.stiffness_drift": -60.0,
        "device.damping_drift": 3e3,
        "device.temperature_ramp": 1e4,
        "device.bias_instability": 0.3,
        "device.rate_random_walk": 20.0,
    },
    "springs": {"device.cubic_stiffness": (1e10, 2e10)},
    "springs of the plant": {
        "plant.kind": "duffing",
        "plant.cubic_stiffness": (1e10, 2e10),
        "plant.cubic_coupling": 1e9,
    },
    "general plant": {
        "plant.kind": "general",
        "plant.mass_ratio": 1.1,
        "plant.stiffness_asymmetry": 1.0,
        "plant.damping_asymmetry": 1e-8,
    },
    "moving rate": {"rate.kind": "noise", "rate.amplitude": 10.0, "rate.frequency": 300.0},
}
DISTURBANCES: dict[str, Changes] = {
    "none": {"disturbance.kind": "none", "disturbance.standard_deviation": None},
    "sine": {
        "disturbance.kind": "sine",
        "disturbance.standard_deviation": None,
        "disturbance.amplitude": (3.0, 7.0),
        "disturbance.frequency": (2.3, 0.1),
    },
    "density": {"disturbance.standard_deviation": None, "disturbance.density": 1.7e-3},
}
REFERENCES: dict[str, Changes] = {
    "step": {"reference.kind": "step", "reference.start": 0.3, "reference.smoothing": 0.05},
    "chirp": {"reference.kind": "chirp", "reference.final_frequency": (20.0, 30.0), "reference.end": 1.2},
    "rest": {"reference.kind": "rest"},
}
OPTIONS: dict[str, Changes] = {
    "caputo": {"controller.derivative": "caputo"},
    "quadratic layer": {"controller.layer": "quadratic"},
    "held feedforward": {"controller.feedforward": "held"},
    "switching limit": {"controller.switching_limit": 0.5},
    "terms of the surface": {
        "controller.coupling": 2.0,
        "controller.error_integral": 1.0,
        "controller.start_rate": 3.0,
        "controller.surface_filter": 0.01,
    },
}
SETTINGS: dict[str, dict[str, Changes]] = {
    "network": {
        "fuzzy rules": {"controller.normalized": True, "controller.node_width": 0.7},
        "loops and a gate": {"controller.inner_loop": 0.5, "controller.outer_loop": 0.5, "controller.gate": 0.5},
        "moving sets": {
            "controller.basis": "membership",
            "controller.center_rate": 20.0,
            "controller.width_rate": 10.0,
        },
    },
    "prescribed": {"funnel": {"controller.barrier_shape": "funnel", "controller.adaptive": False}},
}
TRIM: Changes = {
    "controller.kind": "force_rebalance",
    "run.initial_position": (0.0, 0.0),
    "trim": {"tuning": "split", "quadrature": "null", "modulation": 5.0},
    "run.duration": 1000.0,  # two intervals
}
# Everything of a device in volts that is off in the shipped ones.
VOLTS: Changes = {
    "controller.kind": "force_rebalance",
    "plant.centrifugal": True,
    "rate.transverse_points": [[0.0, 100.0, -50.0], [0.01, -200.0, 300.0]],
    "disturbance": {"kind": "sine", "quantity": "acceleration", "amplitude": (0.01, 0.02), "frequency": (0.3, 0.2)},
    "device.acceleration_share": (0.0, 1e-3),
    "device.common_mode_frequency": (9e3, 12e3),
    "electronics.carrier_frequency": 1e6,
    "electronics.carrier_voltage": 5.0,
    "electronics.carrier_flicker": 1e-6,
    "electronics.feedthrough_lag": 0.4,
    "run.duration": 300.0,
}
TRANSIMPEDANCE: Changes = {"controller.kind": "force_rebalance", "electronics.amplifier": "transimpedance"}
FAULTS = ("lost", "frozen", "inverted", "doubled", "exchanged")
DURATION = 1.5  # 1/omega0, 1,500 steps
SHIPPED_STEPS = 6_000


def run_hash(scenario: fg.Scenario) -> str:
    """Hash of all that a run records, its metrics, and its metrics as one of many, in double and float."""
    try:
        run = fg.simulate(scenario)
    except fg.DivergedError as error:
        run = error.run
    summary = fg.metrics.summary(run, transient=0.3)
    # Voltages follow from the forces unless a trim sets some, and were recorded later than the first hashes.
    left_out = set() if scenario.trim.on else {channel.name for channel in VOLTS_CHANNELS}
    arrays = [run[name].values for name in run.data_vars if name not in left_out]
    arrays += [summary[name].values for name in summary.data_vars]
    for single in (False, True):
        many = fg.measure_many([scenario], seeds=range(3), single_precision=single, transient=0.3)
        arrays += [many[name].values for name in many.data_vars]
    return hashed(arrays)


def hashed(arrays: list[Any]) -> str:
    found = hashlib.sha256()
    for array in arrays:
        found.update(np.asarray(array, dtype=float).tobytes())
    return found.hexdigest()[:16]


def faulty(scenario: fg.Scenario, fault: str, single: bool) -> list[Any]:
    """A controller's answers to a plant that it controls, whose samples are wrong for a while."""
    law, plant, kept = fg.Controller(scenario, single_precision=single), fg.Plant(scenario), []
    held = plant.motion
    for i in range(2_000):
        motion = plant.motion
        (x, y), (vx, vy) = motion.position, motion.velocity
        if i < 700:
            held = motion
        position, velocity = {
            "lost": ((math.nan, y), (vx, vy)),
            "frozen": (held.position, held.velocity),
            "inverted": ((-x, y), (-vx, vy)),
            "doubled": ((2 * x, y), (2 * vx, vy)),
            "exchanged": ((y, x), (vy, vx)),
        }[fault]
        wrong = 700 <= i < 760
        force = law.step(law.time, position if wrong else (x, y), velocity if wrong else (vx, vy))
        kept.append(force)
        try:
            plant.step(force)
        except ValueError:  # diverged
            break
        if i % 10 == 0:
            found = law.estimates
            trust = (getattr(found, name, 0.0) for name in ("rate_deviation", "rate_trusted", "sample_refused"))
            kept.append(np.array([found.rate, *map(float, trust)]))
    return kept


def runs() -> Iterator[tuple[str, fg.Scenario, Changes]]:
    """Names of runs, the scenarios they start from, and its changes."""
    paper = fg.Scenario.paper().replace({"run.duration": DURATION})
    yield "sliding_mode: printed", fg.Scenario.paper("printed"), {"run.duration": DURATION}
    for kind in SURFACES:
        for adaptation, changes in ADAPTATIONS.items():
            header = "sliding_mode" if adaptation == "gradient" else f"sliding_mode, {adaptation}"
            base = paper.replace({"controller.kind": kind, "adaptation.kind": adaptation, **changes})
            for condition, more in CONDITIONS.items():
                yield f"{header}: {kind}, {condition}", base, more
    for adaptation, changes in ADAPTATIONS.items():
        header = "sliding_mode" if adaptation == "gradient" else f"sliding_mode, {adaptation}"
        base = paper.replace({"adaptation.kind": adaptation, **changes})
        for name, more in (DEVICES | DISTURBANCES | REFERENCES).items():
            yield f"{header}: {name}", base, more
        yield f"{header}: drift, positions", base, {**DEVICES["drift"], **POSITIONS}
    for kind in ("fractional_fast_terminal", "linear"):
        for name, more in OPTIONS.items():
            yield f"sliding_mode: {kind}, {name}", paper.replace({"controller.kind": kind}), more
    for kind in _core.controller_kinds:
        if kind not in SURFACES:
            base = paper.replace({"controller.kind": kind})
            for condition, more in (CONDITIONS | REFERENCES | {"electronics": DEVICES["electronics"]}).items():
                yield f"{HEADERS.get(kind, kind)}: {kind}, {condition}", base, more
    for kind, settings in SETTINGS.items():
        for name, more in settings.items():
            yield f"{kind}: {kind}, {name}", paper.replace({"controller.kind": kind}), {**CONDITIONS["noise"], **more}
    for name in NAMES:
        base = named(name)
        for adaptation in ("gradient", "joint"):
            changes = {"adaptation.kind": adaptation, "run.duration": SHIPPED_STEPS * base.run.step}
            yield f"sliding_mode, joint: {name}, {adaptation}", base, changes
    base = named("dual_mass_volts")
    yield "conventional: trim", base, TRIM
    yield "conventional: common mode, carrier, leak, rates about x and y", base, VOLTS
    yield "conventional: transimpedance amplifier", base, {**TRANSIMPEDANCE, "run.duration": 300.0}


def rate_figures() -> Iterator[tuple[str, list[float]]]:
    """Figures of merit of two rate sensors, and of the Allan analysis of a record with all terms and faults."""
    noise = fg.simulate(fg.Scenario.paper().replace({"run.duration": 20.0}))["disturbance"].values[:, 0]
    record = noise / noise.std() + 0.02 * np.cumsum(noise) / noise.std()
    found = fg.rate.allan(record, 0.01)
    terms = (found.angle_random_walk, found.bias_instability, found.rate_random_walk, found.quantization)
    numbers = [number for term in terms if term for number in (term.value, term.low, term.high)]
    yield "allan", [*found.deviation, *numbers]
    record[5000:] += 30.0
    record[9000] = 500.0
    yield "inspection", [number for event in fg.rate.inspect(record, 0.01) for number in (event.time, event.size)]
    for adaptation in ("composite", "joint"):
        base = named("hardware").replace({"adaptation.kind": adaptation})
        with tempfile.TemporaryDirectory() as folder:
            figures = fg.rate.characterise(base, Path(folder) / "out", quick=True, rest=0.2)
        for each in figures:
            yield f"{each.key}, {adaptation}", [each.value, each.low, each.high]


def same(committed: Golden | None, found: Golden) -> bool:
    """True if hashes are equal, and figures within SAME."""
    if isinstance(committed, list) and isinstance(found, list):
        return len(committed) == len(found) and np.allclose(committed, found, rtol=SAME, atol=0.0)
    return committed == found


def golden() -> dict[str, Golden]:
    """Hashes or figures of all runs, by name; "refused" where the scenario is."""
    found: dict[str, Golden] = {}
    for order, longest, tolerance in ((0.9, 80.0, 1e-6), (0.1, 1e3, 1e-9), (0.5, 0.01, 1e-3), (0.999, 1e6, 1e-11)):
        kernel = fg.fractional.design(order, 1e-3, longest, tolerance)
        parts = [kernel.poles, kernel.weights, kernel.error]
        parts += [kernel.sampled(7e-3, derivative=derivative).run(np.arange(99.0)) for derivative in (False, True)]
        found[f"core: kernel of {order}"] = hashed(parts)
    times = 1e-2 * np.arange(500.0)
    for name in ("caputo", "riemann_liouville", "integral"):
        found[f"core: {name}"] = hashed([getattr(fg.fractional, name)(1.0 + times, np.ones(500), 1e-2, 0.37)])
    for path in sorted(SHIPPED.glob("*.toml")):
        found[f"core: fields of {path.stem}"] = hashlib.sha256(tokens(path).encode()).hexdigest()[:16]
    for name, base, changes in runs():
        try:
            found[name] = run_hash(base.replace(changes))
        except ScenarioError:
            found[name] = "refused"
    for adaptation, changes in ADAPTATIONS.items():
        header = "sliding_mode" if adaptation == "gradient" else f"sliding_mode, {adaptation}"
        for checked in (False, True):
            base = fg.Scenario.paper().replace(
                {"adaptation.kind": adaptation, **changes, "guard.checked": checked, "guard.patience": 50}
            )
            for fault in FAULTS:
                name = f"{header}: {fault} samples{', checked' if checked else ''}"
                found[name] = hashed([answers for single in (False, True) for answers in faulty(base, fault, single)])
    for name, numbers in rate_figures():
        # JSON has no NaN.
        found[f"rate: {name}"] = [float(f"{n:.6g}") for n in numbers if math.isfinite(n)]
    return found


if __name__ == "__main__":
    path = ROOT / GOLDEN
    before = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    now = golden()
    in_order = {name: now[name] for name in (*(each for each in before if each in now), *now)}
    kept = {name: before[name] if same(before.get(name), value) else value for name, value in in_order.items()}
    lines = ",\n".join(f" {json.dumps(name)}: {json.dumps(value)}" for name, value in kept.items())
    path.write_text(f"{{\n{lines}\n}}\n", encoding="utf-8")
