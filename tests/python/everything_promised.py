"""Prints a SHA-256 of everything with promised bits, by name, as JSON. Run by test_bits.py; calls no BLAS."""

from __future__ import annotations

import hashlib
import json
import tempfile
from pathlib import Path

import fracgyro as fg
import numpy as np
from fracgyro.export import web
from fracgyro.export.firmware import coefficients_header
from fracgyro.export.settings import core_kernel, core_numbers, device_numbers
from fracgyro.export.units import base_unit
from fracgyro.study.sweep.design import read_plan

found: dict[str, str] = {}


def keep(name: str, *values: object) -> None:
    digest = hashlib.sha256()
    for value in values:
        digest.update(value.encode() if isinstance(value, str) else np.asarray(value, dtype=float).tobytes())
    found[name] = digest.hexdigest()


SHORT = fg.Scenario.paper().replace({"run.duration": 1.0})
KINDS = {
    "gradient": SHORT,
    "printed, chaotic": fg.Scenario.paper("printed").replace(
        {"run.duration": 1.0, "controller.terminal_exponent": 0.1, "controller.order": 0.35}
    ),
    "fractional": SHORT.replace({"controller.kind": "fractional", "controller.order": 0.012345}),
    "fast terminal": SHORT.replace({"controller.kind": "fast_terminal", "controller.terminal_exponent": 0.3}),
    "linear, sine": SHORT.replace(
        {
            "controller.kind": "linear",
            "disturbance.kind": "sine",
            "disturbance.amplitude": (0.3, 0.7),
            "disturbance.frequency": (2.3, 0.1),
        }
    ),
    "composite": SHORT.replace({"adaptation.kind": "composite", "adaptation.rate_forgetting": 2.0}),
    "joint": SHORT.replace(
        {"adaptation.kind": "joint", "adaptation.rate_forgetting": 2.0, "adaptation.forgetting": 0.1}
    ),
    "joint, positions, divided": SHORT.replace(
        {
            "adaptation.kind": "joint",
            "adaptation.covariance_steps": 3,
            "device.sensing": "position",
            "device.position_noise_density": 1e-14,
            "device.delay": 2,
        }
    ),
    "density": SHORT.replace({"disturbance.standard_deviation": None, "disturbance.density": 1.7e-3}),
    "observer": SHORT.replace({"device.sensing": "position", "device.position_noise_density": 1e-14}),
    "filter": SHORT.replace({"controller.filter": "kalman", "device.position_noise_density": 1e-14}),
    "device": SHORT.replace(
        {
            "device.position_noise_density": 1e-14,
            "device.velocity_noise": 1e-9,
            "device.position_range": 2e-6,
            "device.position_bits": 16,
            "device.delay": 1,
            "device.cubic_stiffness": (1e10, 2e10),
            "rate.kind": "noise",
            "rate.amplitude": 10.0,
            "rate.frequency": 300.0,
        }
    ),
    "electronics": SHORT.replace(
        {
            "device.position_noise_density": 1e-14,
            "device.position_noise_corner": 1e3,
            "device.velocity_noise": 1e-9,
            "device.velocity_noise_corner": 2e4,
            "device.position_range": (2e-6, 1.5e-6),
            "device.position_bits": 18,
            "device.pickoff_gain_error": (1e-3, -2e-3),
            "device.pickoff_misalignment": 3e-3,
            "device.force_gain_error": (1e-2, 3e-2),
            "device.force_misalignment": -2e-3,
            "device.damping_drift": 3e3,
            "device.temperature_ramp": 1e4,
            "device.bias_instability": 0.3,
            "device.rate_random_walk": 20.0,
        }
    ),
}

for order, longest, tolerance in ((0.9, 80.0, 1e-6), (0.1, 1e3, 1e-9), (0.5, 0.01, 1e-3), (0.999, 1e6, 1e-11)):
    kernel = fg.fractional.design(order, 1e-3, longest, tolerance)
    keep(f"design of {order}", kernel.poles, kernel.weights, kernel.error)
    for derivative in (False, True):
        keep(f"sampled, {order}, {derivative}", kernel.sampled(7e-3, derivative=derivative).run(np.arange(99.0)))

for name, scenario in KINDS.items():
    run = fg.simulate(scenario)
    keep(f"run, {name}", run["time"].values, *(run[column].values for column in run.data_vars))
    summary = fg.metrics.summary(run, transient=0.3)
    keep(f"metrics, {name}", *(summary[metric].values for metric in summary.data_vars))
    for number in ("float", "double"):
        keep(f"header, {name}, {number}", coefficients_header(scenario, number))
    keep(f"TOML, {name}", scenario.to_toml(), scenario.content_hash())
    keep(
        f"numbers, {name}",
        list(core_numbers(scenario).values()),
        *core_kernel(scenario),
        [*device_numbers(scenario).values()],
    )

for single in (False, True):
    chosen = [scenario for name, scenario in KINDS.items() if name != "composite"]
    many = fg.measure_many(chosen, seeds=range(5), single_precision=single)
    keep(f"metrics of many, {'float' if single else 'double'}", *(many[name].values for name in many.data_vars))

times = 1e-2 * np.arange(500.0)
for name in ("caputo", "riemann_liouville", "integral"):
    keep(name, getattr(fg.fractional, name)(1.0 + times, np.ones(500), 1e-2, 0.37))

keep("local rates", fg.fractional.local_rates(times * times * times, 1e-2).rates)

keep("units", *(base_unit(unit, SHORT.plant)["factor"] for unit in ("m*omega0^2/q0^2", "q0*omega0", "m*omega0^2")))

with tempfile.TemporaryDirectory() as folder:
    web(KINDS["gradient"], Path(folder) / "own.json", unbounded=True)
    keep("web", (Path(folder) / "own.json").read_text())
    for kind, points in (("grid", "steps = 7"), ("latin_hypercube", ""), ("sobol", ""), ("random", "")):
        study = Path(folder) / "study.toml"
        entry = ", ".join(filter(None, ['low = 0.02, high = 0.7, scale = "log"', points]))
        number = "" if points else "points = 8\n"
        study.write_text(
            f'seeds = 2\n[vary]\n"controller.terminal_exponent" = {{ {entry} }}\n[design]\nkind = "{kind}"\n{number}'
        )
        keep(f"points, {kind}", read_plan(study).points)

print(json.dumps(found))
