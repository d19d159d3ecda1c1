"""Quality of the rate estimate: values from the committed logs, and two sets of short runs for a figure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import fracgyro as fg
import logs
import numpy as np
from fracgyro.rate.bound import bound_angle_random_walk
from fracgyro.rate.units import DEG_PER_ROOT_H
from fracgyro_lab.paper.runs import scenario
from words import interval, short

DEVICES = {
    "dual_mass": "dual mass in vacuum",
    "tuned_in_air": "tuned, in air",
    "paper_resonance": "the paper's, at resonance",
    "disc": "disc, Q = 2·10⁶",
}
NOISES = ("1e-14", "1e-13", "1e-12")  # m/sqrt(Hz)
GRADIENT, LEAST_SQUARES = "gradient laws", "least squares added"
# Scenario and law in the log, and their names in the article.
TABLE = [
    ("paper, its noise, off resonance", "laws (44), the paper's gains", "the paper's, its noise", GRADIENT),
    ("paper, its noise, off resonance", "composite", "the paper's, its noise", LEAST_SQUARES),
    ("paper, thermal noise, off resonance", "laws (44), the paper's gains", "the paper's, thermal noise", GRADIENT),
    ("paper, thermal noise, off resonance", "composite", "the paper's, thermal noise", LEAST_SQUARES),
    ("paper_resonance", "laws (44), gains for resonance", "at resonance", f"{GRADIENT}, other gains"),
    ("paper_resonance", "composite", "at resonance", LEAST_SQUARES),
    ("paper_resonance, positions only, 1e-13 m/√Hz", "joint", "at resonance, real sensors", "joint filter"),
    ("dual_mass", "laws (44), gains for resonance", "dual mass", f"{GRADIENT}, other gains"),
    ("dual_mass", "composite", "dual mass", LEAST_SQUARES),
    ("dual_mass, positions only, 1e-13 m/√Hz", "joint", "dual mass, real sensors", "joint filter"),
]
ARW, SCALE, TURN_ON = "Angle random walk (deg/sqrt(h))", "Scale factor error (ppm)", "Turn-on time (ms)"
BOUND, RATIO = "the bound of ARW, D and K known", "ARW over it"
RMS = "RMS error (deg/h)"
OWN = "the paper's"  # case of the log
Values = dict[str, Any]


@dataclass(frozen=True)
class Errors:
    """RMS error of the rate over the true rate, after t."""

    time: np.ndarray
    gradient: np.ndarray
    composite: np.ndarray
    printed: float
    seeds: int


def errors(seeds: int) -> Errors:
    found = {}
    base = scenario("corrected", "proposed").replace({"run.record_every": 100})
    rate = base.plant.nondimensional()[2]
    for kind in ("gradient", "composite"):
        runs = fg.simulate_many([base.replace({"adaptation.kind": kind})], seeds=range(seeds))
        found[kind] = np.sqrt(((runs["rate_estimate"].values / rate - 1) ** 2).mean(axis=0))
        time = runs["time"].values
    later = time > 0
    return Errors(
        time[later], found["gradient"][later], found["composite"][later], 1 - base.adaptation.initial_ratio, seeds
    )


def bound_of_paper() -> tuple[list[float], list[float]]:
    """(t, 1 sigma over the true rate) of the motion of the paper's runs."""
    found = [row for row in logs.rows("rate_estimation", "case", "bound, 1 σ") if row["case"].startswith(OWN)]
    return [logs.number(row["t"]) for row in found], [logs.number(row["bound, 1 σ"]) for row in found]


def bound_curve(device: str, noises: np.ndarray) -> np.ndarray:
    """In deg/sqrt(h), of a sensor of position, with D and K unknown."""
    base = fg.Scenario.shipped(device)
    bounds = [bound_angle_random_walk(base.replace({"device.position_noise_density": float(n)})) for n in noises]
    return np.array([np.nan if b is None else DEG_PER_ROOT_H.of(b.unknown) for b in bounds])


def measured(device: str) -> list[tuple[float, float, float, float]]:
    """(noise, angle random walk, its lower and upper end) of the joint filter from positions."""
    found = []
    for noise in NOISES:
        row = _joint(device, noise)
        arw, bound = logs.number(row["angle random walk (deg/√h)"]), logs.number(row["the bound"])
        low, high = _ends(row["ratio (95 %)"])
        found.append((float(noise), arw, low * bound, high * bound))
    return found


def values(errors: Errors) -> Values:
    cells = [_joint(device, noise)["ratio (95 %)"] for device in DEVICES for noise in ("0", *NOISES)]
    ratios = [logs.number(cell) for cell in cells]
    ends = [end for cell in cells for end in _ends(cell)]
    nominal = _joint("dual_mass", "1e-13")
    low, high = _ends(nominal["ratio (95 %)"])
    noisy = logs.row("rate_sensor", scenario="dual_mass", effect="sensing noise")
    of_composite = logs.number(noisy["angle random walk (deg/sqrt(h))"])
    same = logs.number(logs.row("rate_sensor", where="dual_mass, positions only, 1e-13 m/√Hz", law="joint")[ARW])
    joint = logs.number(nominal["angle random walk (deg/√h)"])
    return {
        "seeds": str(errors.seeds),
        "table": [_line(*each) for each in TABLE],
        "paper": {t: _of_paper(t) for t in ("10", "80")},
        "gradient": {t: _of_gradient(t) for t in ("10", "80")},
        "joint": {
            "arw": short(joint),
            "bound": short(logs.number(nominal["the bound"])),
            "ratio": nominal["ratio (95 %)"].split()[0],
            "interval": interval(low, high, 3),
            "seeds": nominal["seeds"],
            "lowest": short(min(ratios)),
            "highest": short(max(ratios)),
            "low_end": short(min(ends)),
            "high_end": short(max(ends), 3),
        },
        "composite_noisy": {"arw": short(of_composite), "joint": short(same), "times": short(of_composite / same)},
        "hidden_seeds": _hidden_delay()["seeds"],
        "sensor_seeds": logs.said("rate_sensor", r"part of `make bench`; (\d+) seeds"),
        "drift": {
            "seeds": logs.said("sensing_noise", r"Second half of the run, (\d+) seeds"),
            "mean": short(logs.number(_drift("0")["mean error (deg/h)"]), 2),
            "rms": short(logs.number(_drift("0")[RMS]), 2),
            "forgotten_mean": short(logs.number(_drift("100")["mean error (deg/h)"]), 2),
            "forgotten_rms": short(logs.number(_drift("100")[RMS]), 2),
        },
        "off_model": _off_model(),
        "hidden_delay": short(logs.number(_hidden_delay()["of 300 deg/s (ppm)"]), 2),
        "hidden_delay_moving": short(logs.number(_hidden_delay_moving()), 2),
    }


def _line(where: str, law: str, words: str, by: str) -> Values:
    row = logs.row("rate_sensor", where=where, law=law)
    ratio = row[RATIO].split(" (")
    return {
        "where": words,
        "law": by,
        "arw": _shortened(row[ARW]),
        "bound": _shortened(row[BOUND]),
        "ratio": ratio[0] + (f" ({ratio[1]}" if len(ratio) > 1 else ""),
        "scale": _shortened(row[SCALE]),
        "turn_on": _shortened(row[TURN_ON]),
    }


def _shortened(cell: str) -> str:
    return cell if cell == "–" else short(logs.number(cell), 3)


def _joint(device: str, noise: str) -> logs.Row:
    return logs.row("sensing_noise", **{"device": device, "noise (m/√Hz)": noise, "sensed": "q"})


def _ends(cell: str) -> tuple[float, float]:
    low, high = cell.partition("(")[2].rstrip(")").split(" to ")
    return float(low), float(high)


def _of_paper(t: str) -> Values:
    found = logs.rows("rate_estimation", "case", "claimed σ / error")
    row = next(each for each in found if each["case"].startswith(OWN) and each["t"] == t)
    return {
        "error": _percent(row["RMS error"]),
        "bound": _percent(row["bound, 1 σ"]),
        "ratio": row["error / bound"][:4],
    }


def _of_gradient(t: str) -> Values:
    found = [r for r in logs.rows("rate_estimation", "t", "error / bound") if "case" not in r and r["t"] == t]
    if len(found) != 1:
        raise ValueError(f"benchmarks/results/rate_estimation.md has {len(found)} rows of the gradient law at t = {t}")
    return {"error": short(logs.number(found[0]["RMS error"])), "ratio": found[0]["error / bound"]}


def _percent(cell: str) -> str:
    return short(100 * logs.number(cell))


def _drift(hertz: str) -> logs.Row:
    return logs.row("sensing_noise", **{"D, K forgotten at (Hz)": hertz})


def _off_model() -> Values:
    """Faults of sensors: how often the rate is wrong while it is trusted."""
    found = logs.rows("off_model", "length", "faults", "wrong while trusted, %")
    (faults,) = {row["faults"] for row in found}
    worst = max(logs.number(row["wrong while trusted, %"]) for row in found)
    return {"kinds": str(len(found)), "faults": faults, "worst": short(worst)}


def _hidden_delay() -> logs.Row:
    return logs.row("sensing_noise", **{"dual mass, positions, 10⁻¹³ m/√Hz unless said": "… hidden, 300 deg/s"})


def _hidden_delay_moving() -> str:
    return logs.row("rate_sensor", scenario="dual_mass", effect="… not in the datasheet")["scale factor error (ppm)"]
