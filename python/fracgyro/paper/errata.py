"""The paper's errata: what is printed, what is right, and what the runs show of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import xarray as xr

from .. import fractional
from ..analysis import metrics
from ..scenario import Scenario, bounded
from ..simulation.simulate import DivergedError, simulate
from .runs import PAPER_ORDER, Runs, scenario


@dataclass(frozen=True)
class Erratum:
    """One row. `switch` names the scenario field that chooses the reading, where there is a choice to make."""

    where: str
    printed: str
    correct: str
    why: str
    switch: str = ""
    seen: str = ""  # in the runs of this reproduction


def _proposed(runs: Runs, variant: str) -> xr.Dataset:
    return runs[variant, "proposed"]


def rate_law_seen(runs: Runs) -> str:
    moved = {v: float(abs(_proposed(runs, v)["rate_estimate"] - 0.095).max()) for v in ("printed", "corrected")}
    printed = metrics.cut(_proposed(runs, "printed"), (40.0, None))
    symmetric = float(abs(_proposed(runs, "printed")["rate_symmetric_estimate"]).max())
    entry = printed["rate_estimate"] + printed["rate_symmetric_estimate"].sel(entry="xy")
    return (
        f"As printed, Ω̂z moves by {moved['printed']:.1g} in 80 units of time while a symmetric part, which Ω has not, "
        f"grows to {symmetric:.1f}; corrected, Ω̂z moves by up to {moved['corrected']:.1f}. The matrix entry Ω̂21, "
        "both parts together, does come near Ωz = 0.1 as printed "
        f"({float(entry.mean()):.3f} ± {float(entry.std()):.3f} after t = 40), which may be what figures 16 to 18 of "
        "the paper show; it is not an estimate of a rotation."
    )


def derivative_seen(runs: Runs) -> str:
    """ds/dt as recorded against the derivative the control law cancels, early, where the two readings differ."""
    run = _proposed(runs, "corrected").isel(time=slice(0, 2001))
    time = run["time"].values
    step = float(time[1])
    e, rate = run["error"].values, run["error_rate"].values
    integral = fractional.integral(e, rate, step, 1.0 - PAPER_ORDER)
    slope = (integral[2:] - integral[:-2]) / (2 * step)  # second-order accurate away from t = 0
    readings = {
        "Caputo": fractional.caputo(e, rate, step, PAPER_ORDER)[1:-1],
        "Riemann-Liouville": fractional.riemann_liouville(e, rate, step, PAPER_ORDER)[1:-1],
    }
    late = slice(99, None)  # from t = 0.1 on
    off = {name: np.sqrt(np.mean((slope[late] - d[late]) ** 2)) for name, d in readings.items()}
    scale = np.sqrt(np.mean(slope[late] ** 2))
    return (
        "On the recorded error, 0.1 < t < 2, the slope of D^(α-1) e differs from "
        + " and from ".join(f"the {name} derivative by {100 * value / scale:.2g} %" for name, value in off.items())
        + " (RMS)."
    )


def layer_seen(runs: Runs) -> str:
    sizes = {}
    for variant in ("printed", "corrected"):
        late = metrics.cut(_proposed(runs, variant), metrics.STEADY)["surface"]
        sizes[variant] = float(np.sqrt((late**2).sum("axis").mean("time")))
    return (
        f"After t = 10 the RMS of ‖s‖ is {sizes['printed']:.2g} with the printed layer and {sizes['corrected']:.2g} "
        "with the linear one, under the same noise."
    )


def bound_seen(runs: Runs) -> str:
    b = _proposed(runs, "corrected")["bound_estimate"].sel(bound=0)
    ends = ", ".join(f"{float(b.sel(time=t, method='nearest')):.3f} at t = {t}" for t in (20, 40, 60, 80))
    return f"b̂0 = {ends}: it never stops."


def end_seen(_: Runs) -> str:
    """The proposed controller run on, as it is and with a limit."""
    long = scenario("corrected", "proposed").replace({"run.duration": 5000.0, "run.record_every": 1000})
    limited = simulate(long.replace({"controller.switching_limit": 0.5}))
    size = float(np.sqrt((limited["error"][-1000:] ** 2).sum("axis").mean()))
    try:
        run, end = simulate(long), "it lasts to t = 5000"
    except DivergedError as error:
        run = error.run
        last = float(run["time"][-1])
        end = f"it diverges at t = {last:.0f}, after {last / 1000:.1f} s of the device"
    gains = []
    for t in range(0, int(run["time"][-1]), 500):
        at = run.sel(time=float(t), method="nearest")
        position, speed = (float(np.hypot(*at[name].values)) for name in ("position", "velocity"))
        gains.append(f"{bounded.gain(long, at['bound_estimate'].values, position, speed):.2f}")
    return (
        f"At t = 0, 500, … ρh/δ is {', '.join(gains)}; {end}. With a limit of 0.5 on it the RMS of ‖e‖ over the last "
        f"1000 of 5000 units is {size:.1e}."
    )


def gaussian_seen(runs: Runs) -> str:
    run = _proposed(runs, "corrected")
    force = np.sqrt((run["disturbance"] ** 2).sum("axis"))
    above = float((force > run["bound_estimate"].sel(bound=0)).mean())
    return (
        f"The largest ‖d‖ of the run is {float(force.max()):.1f}, and would be larger in a longer one; it exceeds the "
        f"estimate b̂0 of its bound in {above:.0%} of the samples."
    )


def finite_time_seen(runs: Runs) -> str:
    e = metrics.cut(_proposed(runs, "corrected"), (60.0, None))["error"]
    return f"After t = 60 the RMS of ‖e‖ is still {float(np.sqrt((e**2).sum('axis').mean('time'))):.1e}."


def tail_seen(_: Runs) -> str:
    """The best case: parameters known, no disturbance, no layer."""
    sizes = {}
    for controller in ("proposed", "fractional", "conventional"):
        run = simulate(
            scenario("corrected", controller).replace(
                {
                    "controller.adaptive": False,
                    "controller.layer_thickness": 0.0,
                    "disturbance.kind": "none",
                    "run.duration": 40.0,
                }
            )
        )
        size = metrics.cut(run, (20.0, None))["error"]
        sizes[controller] = float(((size**2).sum("axis") ** 0.5).max())
    return (
        "With known parameters, no disturbance and pure switching, the largest ‖e‖ after t = 20 is "
        + ", ".join(f"{size:.1g} ({controller})" for controller, size in sizes.items())
        + "."
    )


def symmetry_seen(runs: Runs) -> str:
    run = _proposed(runs, "corrected").isel(time=1000)
    v, s = run["velocity"].values, run["surface"].values
    law = -0.5 * np.diag([150.0, 75.0]) @ (np.outer(v, s) + np.outer(s, v))
    return (
        f"With M = diag(150, 75) the law (44) at t = 1 would drive D̂xy at {law[1, 0]:.3g} and D̂yx at {law[0, 1]:.3g}."
    )


Evidence = Callable[[Runs], str]
TABLE: list[tuple[Erratum, Evidence | None]] = [
    (
        Erratum(
            "(42), (44)",
            "dΩ̂ᵀ/dt = −P (v sᵀ + s vᵀ)",
            "dΩ̂ᵀ/dt = −P (v sᵀ − s vᵀ), that is dΩ̂z/dt = P (s₁v₂ − s₂v₁)",
            "Ω̃ is skew, so tr{Ω̃ (v sᵀ + s vᵀ)} ≡ 0: the printed law moves only a symmetric part and leaves Ω̂z at "
            "0.95 Ωz forever.",
            "controller.rate_law",
        ),
        rate_law_seen,
    ),
    (
        Erratum(
            "(16) → (17)",
            "d/dt D^(α−1) e = D^α e, with the Caputo derivative (7)",
            "d/dt D^(α−1) e is the Riemann-Liouville derivative; it exceeds Caputo's by e(0) t^(−α)/Γ(1−α)",
            "Differentiate the integral. With the Riemann-Liouville derivative the equivalent control cancels exactly.",
            "controller.derivative",
        ),
        derivative_seen,
    ),
    (
        Erratum(
            "(33), (46)",
            "inside the layer −(s/δ²) ‖s‖ ρ",
            "−(s/δ) ρ, the usual layer",
            "The printed one has no gain at s = 0, where s then wanders.",
            "controller.layer",
        ),
        layer_seen,
    ),
    (
        Erratum("(11)", "|K| ≤ b₁, |D| ≤ b₂", "‖ΔK‖ ≤ b₁, ‖ΔD‖ ≤ b₂", "Only so does (12) follow from (10)."),
        None,
    ),
    (Erratum("(40)", "K q in the second line", "K̃ q", "Insert (38)."), None),
    (
        Erratum(
            "Remark 2, (26)–(32)",
            "on the fractional surface the error reaches zero at a finite time",
            "on a fractional surface it decays like a power of t; only the integer-order one is finite-time",
            "If e were zero from some t on, D^(α−1) e would still keep a tail of the past, so s could not stay "
            "zero. The proof bounds that tail by the present error.",
        ),
        tail_seen,
    ),
    (
        Erratum(
            "Remark 4",
            "tracking error and surface converge to zero in finite time",
            "V̇ ≤ 0 and Barbalat's lemma give asymptotic convergence, and with a layer an ultimate bound",
            "(45) bounds ∫‖s‖ dt and no reaching time, since ε vanishes with the margin of b̂.",
        ),
        finite_time_seen,
    ),
    (
        Erratum(
            "(44)",
            "M, N any positive definite matrices",
            "multiples of the identity",
            "Transpose (44): otherwise D̂ and K̂ lose their symmetry. The scenario therefore takes numbers.",
        ),
        symmetry_seen,
    ),
    (
        Erratum(
            "(44), figure 19",
            "b̂ shows stable convergence",
            "b̂ grows without bound under noise",
            "‖s‖ ≥ 0 is integrated forever. Fixed by adaptation.leakage, .dead_zone or .projection, all off in both "
            "variants, since the paper has none.",
            "adaptation.leakage, dead_zone, projection",
        ),
        bound_seen,
    ),
    (
        Erratum(
            "(44), (46), sampled",
            "the closed loop is stable",
            "with a step h and the usual layer it is unstable from ρh/δ = 2 − λ₁h on, which b̂ reaches in noise",
            "A held force takes ρh/δ of s back in one step. No switch fixes the law (44) in either variant; "
            "controller.switching_limit, a field of ours, bounds ρh/δ.",
        ),
        end_seen,
    ),
    (
        Erratum("(8)", "∫ e⁻ᵗ t^(c−1) dt", "the same; c is the argument of Γ", "Not the exponent c of (16)."),
        None,
    ),
    (
        Erratum("(1)", "second line begins with m ẍ", "m ÿ; the cross term is m ΩxΩy", "Dimensions."),
        None,
    ),
    (
        Erratum(
            "(11)–(12), section 5",
            "a bounded disturbance, f = randn",
            "white noise of density S held for h has variance S/h, and no bound",
            "A Gaussian exceeds every bound; its power depends on the hold time, which the paper does not state.",
            "disturbance.hold, disturbance.density",
        ),
        gaussian_seen,
    ),
]


def with_evidence(runs: Runs) -> list[Erratum]:
    """Every row, with what the runs show where a run can show it."""
    return [Erratum(e.where, e.printed, e.correct, e.why, e.switch, seen(runs) if seen else "") for e, seen in TABLE]


def switches() -> dict[str, tuple[object, object]]:
    """{field: (printed, corrected)} wherever the two presets differ."""
    printed, corrected = (Scenario.paper(v).model_dump() for v in ("printed", "corrected"))
    return {
        f"{table}.{field}": (value, corrected[table][field])
        for table, fields in printed.items()
        for field, value in fields.items()
        if value != corrected[table][field]
    }
