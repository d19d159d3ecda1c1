"""Runs in lanes equal single runs, whatever the other lanes contain, with any number of lanes and threads."""

import math
from collections.abc import Callable
from pathlib import Path

import fracgyro as fg
import numpy as np
import pytest
import xarray as xr
from fracgyro import _core
from fracgyro.analysis.metric_names import COLUMNS
from fracgyro.scenario.kinds import kinds_with, numbers, plants_with
from fracgyro.scenario.to_core import core_setup

PAPER = fg.Scenario.paper().replace({"run.duration": 3.0})
LANES = [1, *_core.lane_counts()]  # 1: every run by itself


def measure(
    scenarios: list[fg.Scenario], lanes: int, threads: int = 1, single: bool = False, transient: float = 1.0
) -> np.ndarray:
    params = _core.MetricsParams()
    params.transient = transient
    return _core.measure_runs([core_setup(s) for s in scenarios], params, threads, lanes, single)


# Numbers that are common to a block, and numbers that may differ between its lanes.
SWITCHES = [
    {},
    {"controller.kind": "fast_terminal", "adaptation.leakage": 0.1, "disturbance.kind": "none"},
    {"controller.rate_law": "printed", "controller.force_limit": 1e3, "disturbance.hold": 5e-3},
    {"controller.switching_limit": 0.02, "disturbance.hold": 2e-3},
    {"controller.terminal_exponent": 0.7, "adaptation.dead_zone": 0.02, "run.duration": 1.5},
    {"controller.kind": "fractional", "adaptation.projection": 0.5, "run.step": 5e-4, "disturbance.hold": None},
    {"adaptation.kind": "composite", "adaptation.forgetting": 0.01},
    {"adaptation.kind": "joint", "adaptation.forgetting": 0.01, "adaptation.covariance_steps": 3},
]


def varied(groups: int, together: int) -> list[fg.Scenario]:
    """In each group as many runs as stand side by side, which differ in every way that the lanes of a block can."""
    random = np.random.default_rng(7)
    return [
        PAPER.replace(
            {
                **switches,
                "controller.order": float(random.uniform(0.05, 0.95)),
                "controller.fractional_gain": tuple(random.uniform(5, 15, 2).tolist()),
                "controller.layer": str(random.choice(["linear", "quadratic"])),
                "controller.derivative": str(random.choice(["caputo", "riemann_liouville"])),
                "reference.frequency": tuple(random.uniform(1, 3, 2).tolist()),
                "plant.angular_rate": float(random.uniform(50, 150)),
                "disturbance.seed": 8 * group + i,
            }
        )
        for group, switches in enumerate(SWITCHES[:groups])
        for i in range(together)
    ]


@pytest.fixture(scope="module")
def singles() -> list[tuple[fg.Scenario, xr.Dataset]]:
    return [(scenario, fg.metrics.summary(fg.simulate(scenario), transient=1.0)) for scenario in varied(7, 5)]


@pytest.mark.parametrize("lanes", LANES)
def test_runs_in_lanes_equal_single_runs_to_rounding(lanes: int, singles: list[tuple[fg.Scenario, xr.Dataset]]) -> None:
    found = measure([scenario for scenario, _ in singles], lanes)
    names = COLUMNS
    for (_, full), row in zip(singles, found, strict=True):
        for i, axis in enumerate("xy"):
            for window in ("whole", "transient", "steady"):
                single = full["rmse"].sel(window=window).values[i]
                np.testing.assert_allclose(row[names.index(f"rmse_{window}_{axis}")], single, rtol=1e-9)
            np.testing.assert_allclose(row[names.index(f"effort_{axis}")], full["effort"].values[i], rtol=1e-9)
        for name in ("rate_error", "rate_error_peak", "damping_error", "stiffness_error", "bound_0_halfway"):
            np.testing.assert_allclose(row[names.index(name)], full[name].values, rtol=1e-8, atol=1e-12, err_msg=name)


@pytest.mark.parametrize("lanes", LANES)
def test_the_number_of_threads_changes_no_bit(lanes: int) -> None:
    scenarios = varied(3, 9)
    np.testing.assert_array_equal(measure(scenarios, lanes, threads=1), measure(scenarios, lanes, threads=3))


@pytest.mark.parametrize("lanes", LANES)
def test_a_run_is_not_disturbed_by_those_beside_it(lanes: int) -> None:
    calm = [PAPER.replace({"disturbance.seed": seed}) for seed in range(lanes - 1)]
    wild = PAPER.replace({"controller.fractional_gain": 3000.0})
    separate = measure(calm, lanes)
    beside = measure([wild, *calm], lanes)
    assert np.isfinite(beside[0, -1])  # diverged
    assert 0 < beside[0, -1] < 3.0
    np.testing.assert_array_equal(beside[1:], separate)


@pytest.mark.parametrize("lanes", LANES)
def test_noise_drawn_once_for_many_runs_changes_no_bit(lanes: int) -> None:
    scenarios = [
        PAPER.replace({"controller.order": order, "disturbance.seed": seed})
        for order in np.linspace(0.1, 1.0, 11).tolist()
        for seed in range(3)
    ]
    separate = [measure([scenario], lanes)[0] for scenario in scenarios]
    np.testing.assert_array_equal(measure(scenarios, lanes, threads=2), separate)


def test_all_widths_agree() -> None:
    results = [measure(varied(4, 8), lanes) for lanes in LANES]
    for other in results[1:]:
        np.testing.assert_allclose(other, results[0], rtol=1e-7, atol=1e-12)


# -- Whatever two runs differ in, neither gets anything of the other -----------------------------------------

SHORT = PAPER.replace({"run.duration": 0.2})
SINE = {"disturbance.kind": "sine", "disturbance.amplitude": (50.0, 70.0), "disturbance.frequency": (30.0, 40.0)}
PULSE = {"disturbance.kind": "pulse", "disturbance.amplitude": (50.0, 70.0), "disturbance.width": 0.1}
VIBRATION = {"disturbance.kind": "vibration", "disturbance.psd": [[5.0, 1.0], [50.0, 1.0]]}
PULLED = [[0, 50, 60], [1, 70, 80]]
COMPOSITE, JOINT = {"adaptation.kind": "composite"}, {"adaptation.kind": "joint"}
SMOOTHED = {"reference.kind": "step", "reference.smoothing": 0.02}
TERMS = [{"frequency": (1.0, 2.0), "amplitude": (0.5, 0.5)}]
LAYERED: dict[str, object] = {"controller.kind": "nonsingular_terminal"}
LAYERED |= {"controller.switching_gain": 0.1, "controller.reaching_exponent": 0.0}
LAYERED |= {"controller.nonsingular_layer": 10.0}
# At resonance, for controllers that answer within cycles, of 2 pi each, and more slowly. Ideal devices run in lanes.
IDEAL = {"device.sensing": "full", "device.position_noise_density": 0.0}
DISC = Path(__file__).resolve().parents[2] / "examples/scenarios/disc_whole_angle.toml"
DUAL = fg.Scenario.shipped("dual_mass").replace({"run.duration": 20.0})


def on_disc(changes: dict[str, object]) -> Callable[[], fg.Scenario]:
    """Made when it is used: CONTRIBUTING's example has a core without whole angle."""
    return lambda: fg.Scenario.load(DISC).replace({**IDEAL, "run.duration": 60.0}).replace(changes)


TURNING, DAMPED = on_disc({}), on_disc({"controller.damping_compensation": 1e-3})
TURNED = on_disc(
    {"controller.kind": "virtual_rotation", "controller.virtual_rate": 0.1, "controller.reversal_turns": 0.05}
)
REVERSED = on_disc(
    {"controller.kind": "mode_reversal", "controller.reversal_interval": 20.0, "controller.settling_time": 5.0}
)


def locked() -> fg.Scenario:
    return DUAL.replace({**IDEAL, "controller.kind": "lock_in", "run.duration": 40.0})  # five spans


COMB = {"kind": "comb", "count": 200, "gap": 2e-6, "overlap": 2e-5, "thickness": 6e-5, "bias": 5.0}
PLATE = {"kind": "plate", "count": 150, "gap": 4e-6, "area": 1.2e-8, "bias": 2.0}


def electrodes(drive: dict[str, object]) -> list[dict[str, object]]:
    """For each axis such a drive, and combs as its pick-off."""
    each = {"force": drive, "pickoff": COMB}
    return [{"role": role, "angle": angle, **own} for role, own in each.items() for angle in (0.0, math.pi / 2)]


SMALL = {"reference.amplitude": (0.1, 0.1), "run.initial_position": (0.0, 0.1), "run.initial_velocity": (0.1, 0.0)}
VOLTS = DUAL.replace({**SMALL, "electrodes": electrodes(PLATE)})
SILENT = VOLTS.replace({"device.position_noise_density": 0.0, "electronics.feedback_capacitance": 1e-12})  # C_f
# Until after the first interval, which ends at 452.
TRIMMED = fg.Scenario.shipped("dual_mass_volts").replace(
    {
        "reference.kind": ["sine", "rest"],
        "run.initial_position": (0.0, 0.0),
        "run.duration": 480.0,
        "trim": {"tuning": "split", "quadrature": "null", "modulation": 5.0},
    }
)
CHARGE = {"electronics.amplifier": "charge", "electronics.feedback_resistance": 1e7, "electronics.voltage_noise": 5e-9}
AMPLIFIED = SILENT.replace(CHARGE)
LEAKING = AMPLIFIED.replace({"electronics.feedback_capacitance": 1e-12, "electronics.feedthrough": (1e-15, 0, 0, 0)})
CARRIER = AMPLIFIED.replace({"electronics.carrier_frequency": 1e6, "electronics.carrier_voltage": 1.0})
# By field: changes of both runs, or the first run, or what makes it; and the value of the second. A field of a
# controller that is not here is derived; any other fails a test.
DIFFERENCES: dict[str, tuple[dict[str, object] | fg.Scenario | Callable[[], fg.Scenario], object]] = {
    "plant.mass": ({}, 2e-7),
    "plant.damping": ({}, {"xx": 1e-4, "xy": 0.0, "yy": 2e-4}),
    "plant.stiffness": ({}, {"xx": 60.0, "xy": 10.0, "yy": 90.0}),
    "plant.damping_deviation": ({}, {"xx": 1e-4, "xy": 0.0, "yy": 2e-4}),
    "plant.stiffness_deviation": ({}, {"xx": 5.0, "xy": 1.0, "yy": 9.0}),
    "plant.angular_rate": ({}, -3000.0),
    "plant.transverse_rate": ({"plant.centrifugal": True}, (1e4, 0.5e4)),
    "plant.centrifugal": ({"plant.transverse_rate": (1e4, 0.5e4)}, True),
    "plant.reference_frequency": ({}, 900.0),
    "run.initial_position": ({}, (0.5, -0.5)),
    "run.initial_velocity": ({}, (0.0, 1.0)),
    "controller.filter": ({"controller.kind": "pid"}, "kalman"),
    "reference.amplitude": ({}, (1.0, 0.8)),
    "reference.frequency": ({}, (3.0, 1.0)),
    "reference.phase": ({}, (0.0, 1.0)),
    "reference.kind": ({}, "rest"),
    "reference.offset": ({}, (0.1, 0.2)),
    "reference.start": (SMOOTHED, 0.1),
    "reference.end": (SMOOTHED, 0.15),
    "reference.smoothing": (SMOOTHED, 0.04),
    "reference.smoothing_order": (SMOOTHED, 2),
    "reference.slope": ({"reference.kind": "ramp", "reference.slope": (1.0, 1.0)}, (2.0, 3.0)),
    "reference.final_frequency": ({"reference.kind": "chirp", "reference.end": 1.0}, (200.0, 300.0)),
    "reference.hold": ({"reference.kind": "staircase", "reference.hold": 0.05, "reference.levels": 3}, 0.1),
    "reference.levels": ({"reference.kind": "staircase", "reference.hold": 0.05}, 3),
    "reference.terms": ({"reference.kind": "sines", "reference.terms": [{"frequency": (1.0, 2.0)}]}, TERMS),
    "reference.points": ({"reference.kind": "table", "reference.points": [[0.0, 0.1, 0.2]]}, [[0.0, 0.3, 0.2]]),
    "controller.kind": ({}, "fast_terminal"),
    "controller.order": ({}, 1.0),
    "controller.fractional_gain": ({}, (10.0, 12.0)),
    "controller.terminal_gain": ({}, (0.5, 0.7)),
    "controller.terminal_exponent": ({}, 0.7),
    "controller.layer_thickness": ({}, 20.0),
    "controller.layer": ({"controller.layer_thickness": 20.0}, "quadratic"),
    "controller.derivative": ({}, "caputo"),
    "controller.rate_law": ({}, "printed"),
    "controller.singularity_floor": ({}, 0.6),
    "controller.adaptive": ({}, False),
    "controller.force_limit": ({}, 200.0),
    "controller.switching_limit": ({}, 0.001),
    "adaptation.kind": ({}, "composite"),
    "adaptation.damping_gain": ({}, 100.0),
    "adaptation.stiffness_gain": ({}, 100.0),
    "adaptation.rate_gain": ({}, 100.0),
    "adaptation.bound_gain": ({}, (1.0, 1.6, 1.7)),
    "adaptation.initial_bound": ({}, (0.1, 0.2, 0.4)),
    "adaptation.initial_ratio": ({}, 0.9),
    "adaptation.leakage": ({}, 0.5),
    "adaptation.dead_zone": ({}, 5.0),
    "adaptation.projection": ({}, 0.1),
    "adaptation.initial_rate": ({}, 0.05),
    "adaptation.forgetting": (COMPOSITE, 1.0),
    "adaptation.rate_forgetting": (COMPOSITE, 1.0),
    "adaptation.covariance_steps": (JOINT, 2),
    "datasheet.force_noise": (JOINT, 2.0),
    "datasheet.position_noise": (JOINT, 1e-4),
    "datasheet.velocity_noise": (JOINT, 1e-4),
    "datasheet.delay": (JOINT, 1),
    "datasheet.pickoff_gain_error": ({}, (0.01, 0.0)),
    "datasheet.pickoff_misalignment": ({}, 0.01),
    "datasheet.stiffness_drift": (JOINT, 1e-3),
    "datasheet.damping_drift": (JOINT, 0.1),
    "controller.reaching_exponent": (LAYERED, 0.5),
    "controller.nonsingular_layer": (LAYERED, 20.0),
    "disturbance.kind": ({}, "none"),
    "disturbance.standard_deviation": ({}, 2.0),
    "disturbance.density": ({"disturbance.standard_deviation": None, "disturbance.density": 1e-3}, 2e-3),
    "disturbance.hold": ({}, 5e-3),
    "disturbance.seed": ({}, 1),
    "disturbance.amplitude": (SINE, (50.0, 60.0)),
    "disturbance.frequency": (SINE, (30.0, 50.0)),
    "disturbance.phase": (SINE, (0.0, 1.0)),
    "disturbance.start": (SINE, 0.1),
    "disturbance.end": (SINE, 0.1),
    "disturbance.band": ({"disturbance.hold": None, "disturbance.band": (10.0, 50.0)}, (20.0, 40.0)),
    "disturbance.width": (PULSE, 0.05),
    "disturbance.psd": (VIBRATION, [[5.0, 2.0], [50.0, 1.0]]),
    "disturbance.weights": (VIBRATION, (1.0, 0.5)),
    "disturbance.points": ({"disturbance.kind": "table", "disturbance.points": [[0, 1, 2], [1, 3, 4]]}, PULLED),
    "disturbance.added": ({}, [{"kind": "step", "amplitude": (50.0, 60.0)}]),
    **{
        f"controller.{name}": ({"controller.kind": "linear"}, value)
        for name, value in (("coupling", 30.0), ("error_integral", 30.0), ("start_rate", 3.0), ("surface_filter", 0.02))
    },
    "controller.event_threshold": ({}, 5.0),
    "controller.event_share": ({}, 0.05),
    "controller.compensation_bandwidth": ({}, 30.0),
    "controller.near_floor": ({"controller.kind": "fixed_time"}, 0.3),
    "controller.switching_layer": ({"controller.kind": "dynamic", "controller.switching_rate": 1e3}, 150.0),
    "controller.surface_layer": ({"controller.kind": "network", "controller.switching_force": 5.0}, 0.1),
    "controller.polynomial_degree": ({"controller.kind": "network", "controller.basis": "chebyshev"}, 3),
    "controller.prediction_rate": ({"controller.kind": "network", "controller.prediction_weight": 1.0}, 7.0),
    **{f"controller.{name}": ({"controller.kind": "network"}, 0.5) for name in ("inner_loop", "outer_loop", "gate")},
    "controller.velocity_bound": ({"controller.kind": "prescribed", "controller.barrier_shape": "funnel"}, 5.0),
    "controller.bandwidth": (locked, 0.0013),
    "controller.span": (locked, 200),
    "controller.quadrature_bandwidth": (TURNING, 0.02),
    "controller.damping_axis": (DAMPED, 1.0),
    "controller.reversal_turns": (TURNED, 0.1),
    "controller.reversal_interval": (REVERSED, 25.0),
    "controller.settling_time": (REVERSED, 10.0),
    "controller.swing_rate": (REVERSED, 0.1),
    "datasheet.lag": (TURNING, 0.1),
    "electrodes.each": (VOLTS, electrodes({**PLATE, "bias": 3.0})),
    "electronics.feedback_resistance": (AMPLIFIED, 2e7),
    "electronics.feedback_capacitance": (AMPLIFIED, 2e-12),
    "electronics.input_capacitance": (AMPLIFIED, 4e-12),
    "electronics.voltage_noise": (AMPLIFIED, 7e-9),
    "electronics.current_noise": (AMPLIFIED, 1e-13),
    "electronics.pole": (VOLTS, (1e5, 2e5)),
    "electronics.carrier_frequency": (CARRIER, 2e6),
    "electronics.carrier_voltage": (CARRIER, 2.0),
    "electronics.carrier_flicker": (CARRIER, 1e-3),
    "electronics.feedthrough": (VOLTS, (1e-15, 0.0, 0.0, 2e-15)),
    "electronics.feedthrough_lag": (LEAKING, 0.3),
    "electronics.linearized": (VOLTS, True),
    **{f"electronics.{name}": (VOLTS, 1e-7) for name in ("sample_delay", "update_delay", "aperture", "jitter")},
    "trim.tuning": (TRIMMED, "fixed"),
    "trim.quadrature": (TRIMMED, "fixed"),
    "trim.interval": (TRIMMED, 0.019),
    "trim.gain": (TRIMMED, 0.5),
    "trim.modulation": (TRIMMED, 6.0),
    "trim.frequency": (TRIMMED, 310.0),
    "trim.target": (TRIMMED, 10.0),
    "run.duration": ({}, 0.15),
    "run.step": ({}, 5e-4),
    "run.kernel_tolerance": ({}, 1e-3),
}
# They change nothing that is measured in an ideal device, in the core's units.
WITHOUT_EFFECT = {
    "plant.reference_length": 2e-6,
    "disturbance.quantity": "acceleration",
    "controller.observer_bandwidth": 200.0,
    "electronics.amplifier": "charge",  # without the fields that need it: its noise, R_f and C_f above
    "run.record_every": 2,
    "run.units": "SI",
    "guard.checked": True,
    "guard.plant_tolerance": 0.2,
    "guard.force_tolerance": 1.0,
    "guard.position_tolerance": 0.01,
    "guard.velocity_tolerance": 0.01,
    "guard.patience": 40,
    "guard.saturation_patience": 40,
}


def fields() -> set[str]:
    return {
        f"{table}.{name}"
        for table, entry in fg.Scenario.model_fields.items()
        for name in entry.annotation.model_fields
        if table not in ("rate", "device") and name != "file"  # these do not run in lanes; a file becomes points
        if f"{table}.{name}" != "plant.kind" and not (table == "plant" and plants_with(name))  # other plants neither
    }


DERIVED = sorted(
    path
    for path in fields() - DIFFERENCES.keys() - WITHOUT_EFFECT.keys()
    if path.startswith("controller.") and kinds_with(path)
)


def derived(path: str) -> tuple[dict[str, object], object]:
    """A field of a controller: with the first kind that has it, 1.37 times its default within its range, or another."""
    kind = kinds_with(path)[0]
    parts = [number for number in numbers(kind) if number.path == path]
    first = parts[0]
    if first.choices == ("false", "true"):
        return {"controller.kind": kind}, not first.default
    if first.choices:
        return {"controller.kind": kind}, first.choices[1 - int(first.default)]
    value = 1.37 * first.default or 1.0
    value = value if value < first.high else 0.5 * (first.default + first.low)
    value = round(value) if first.whole else value
    return {"controller.kind": kind}, value if len(parts) == 1 else [value] * len(parts)


def first_of(base: dict[str, object] | fg.Scenario | Callable[[], fg.Scenario]) -> fg.Scenario:
    """The first scenario of an entry of DIFFERENCES."""
    made = base() if callable(base) else base
    return made if isinstance(made, fg.Scenario) else SHORT.replace(made)


def test_every_field_of_a_scenario_is_told_apart_below() -> None:
    assert fields() == DIFFERENCES.keys() | WITHOUT_EFFECT.keys() | set(DERIVED)


@pytest.mark.parametrize("field", [*DIFFERENCES, *DERIVED])
def test_runs_that_differ_in_one_field_share_nothing_that_depends_on_it(field: str) -> None:
    base, value = DIFFERENCES[field] if field in DIFFERENCES else derived(field)
    pair = [first_of(base), first_of(base).replace({field: value})]
    for lanes in LANES:
        separate = [measure([scenario], lanes, transient=0.1)[0] for scenario in pair]
        assert not np.array_equal(*separate, equal_nan=True)  # NaN: not reported
        np.testing.assert_array_equal(measure(pair * lanes, lanes, transient=0.1), separate * lanes)


@pytest.mark.parametrize("field", WITHOUT_EFFECT)
def test_fields_without_effect_on_what_is_measured_have_none(field: str) -> None:
    first = SILENT if field.startswith("electronics.") else SHORT  # an amplifier needs pick-offs
    pair = [first, first.replace({field: WITHOUT_EFFECT[field]})]
    first, second = measure(pair, LANES[-1], transient=0.1)
    np.testing.assert_allclose(second, first, rtol=1e-12)


@pytest.mark.parametrize("lanes", LANES)
def test_lanes_notice_a_divergence_on_y_alone_and_keep_the_bound_of_before(lanes: int) -> None:
    """Uncoupled axes, with all known: x neither knows of y nor of its gain."""
    stiffness, damping = {"xx": 63.955, "xy": 0.0, "yy": 95.92}, {"xx": 1.8e-6, "xy": 0.0, "yy": 1.8e-6}
    uncoupled = PAPER.replace(
        {
            "plant.stiffness": stiffness,
            "plant.damping": damping,
            "plant.angular_rate": 0.0,
            "controller.kind": "linear",
            "controller.layer_thickness": 0.0,
            "adaptation.initial_bound": (0.0, 0.0, 0.0),
            "controller.fractional_gain": (10.0, 3000.0),
        }
    )
    scenarios = [uncoupled.replace({"disturbance.seed": seed, "controller.adaptive": seed > 0}) for seed in range(3)]
    found = dict(zip(COLUMNS, measure(scenarios, lanes).T, strict=True))
    for i, scenario in enumerate(scenarios):
        with pytest.raises(fg.DivergedError) as caught:
            fg.simulate(scenario)
        np.testing.assert_allclose(found["diverged_at"][i], len(caught.value.run["time"]) * 1e-3)
        if i == 0:
            assert abs(caught.value.run["position"].values[-1, 0]) < 2.0
    assert (found["diverged_at"] < 1.5).all()  # before half of the run
    np.testing.assert_array_equal(found["bound_0_halfway"], found["bound_final_0"])
    assert (found["bound_final_0"][1:] > 0).all()


def test_runs_that_all_diverge_end_early() -> None:
    wild = [PAPER.replace({"controller.fractional_gain": 3000.0, "disturbance.seed": seed}) for seed in range(5)]
    metrics = fg.measure_many(wild)
    for i, scenario in enumerate(wild):
        with pytest.raises(fg.DivergedError) as caught:
            fg.simulate(scenario)
        np.testing.assert_allclose(metrics["diverged_at"].values[i], len(caught.value.run["time"]) * 1e-3)


def test_a_width_that_the_processor_lacks_is_refused() -> None:
    with pytest.raises(ValueError, match="lanes"):
        measure([PAPER], 3)


@pytest.mark.parametrize("lanes", LANES)
def test_single_precision_has_the_metrics_of_double_precision_to_its_rounding(lanes: int) -> None:
    scenarios = [
        PAPER.replace({"controller.order": order, "controller.terminal_exponent": exponent, "disturbance.seed": seed})
        for order, exponent in ((0.9, 0.5), (0.5, 0.6), (1.0, 0.5))
        for seed in range(6)
    ]
    double, single = (measure(scenarios, lanes, single=s) for s in (False, True))
    names = COLUMNS
    for name, rtol in (("rmse_whole_x", 0.01), ("rmse_transient_y", 0.01), ("effort_x", 1e-3), ("largest_force", 0.01)):
        np.testing.assert_allclose(single[:, names.index(name)], double[:, names.index(name)], rtol=rtol, err_msg=name)
    steady = [names.index(name) for name in ("rmse_steady_x", "rmse_steady_y", "rate_error_rms")]
    np.testing.assert_allclose(single[:, steady], double[:, steady], rtol=0.1)
    assert np.any(single != double)
    np.testing.assert_array_equal(measure(scenarios, lanes, threads=3, single=True), single)
