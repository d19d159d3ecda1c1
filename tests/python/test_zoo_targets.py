"""Every law of the zoo on every target: the same bits; and any sequence of samples."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import fracgyro as fg
import numpy as np
import pytest
from embedded import need
from fracgyro.export.host import Host
from fracgyro.export.targets import answers
from fracgyro_lab.zoo import laws
from fracgyro_lab.zoo.facts import entries
from nightly import nightly_unless

pytestmark = pytest.mark.usefixtures("lanes")
STEPS = 400
NAN, INF = math.nan, math.inf


def scenario_of(name: str) -> fg.Scenario:
    """The law of an entry with the first gains within its ranges, in noise, for a short run."""
    facts = entries()[name]
    base = laws.sensed_base(laws.cell(facts.information, laws.NOISE))
    return laws.contender_of(name, facts).scenario(base).replace({"run.duration": STEPS * base.run.step})


def different() -> dict[str, fg.Scenario]:
    """By entry; entries with the same law once."""
    found: dict[str, fg.Scenario] = {}
    for name in entries():
        scenario = scenario_of(name)
        if scenario not in found.values():
            found[name] = scenario
    # All settings of the network that no entry has together.
    every = {"basis": "membership", "normalized": True, "inner_loop": 0.5, "outer_loop": 0.5, "gate": 0.5}
    every |= {"center_rate": 10.0, "width_rate": 10.0, "prediction_weight": 1.0, "error_leak": 1.0}
    network = next(scenario for scenario in found.values() if scenario.controller.kind == "network")
    found["network, all settings"] = network.replace({f"controller.{field}": value for field, value in every.items()})
    return found


LAWS = different()
# Laws that `make test` compiles for a target, and those of one target that takes longest.
OFTEN = ("2013_funnel", "network, all settings")
ONCE = {"m7": OFTEN[1], "fmu": OFTEN[0]}
QUICK = ("lanes", "wasm")  # one program for all laws
TOOLS = {"wasm": "WebAssembly", "m7": "Cortex-M"}


def compared(target: str, law: str) -> bool:
    return target in QUICK or law == ONCE.get(target) or (target == "host" and law in OFTEN)


def motion_of(scenario: fg.Scenario) -> np.ndarray:
    run = fg.simulate(scenario)
    measured = [run["measured_position"].values, run["measured_velocity"].values]
    return np.nan_to_num(np.hstack(measured))  # without a sensor of the velocity it is not read


def triggered(law: str) -> bool:
    return LAWS[law].controller.event_threshold > 0.0 or LAWS[law].controller.event_share > 0.0


@pytest.mark.parametrize(
    ("target", "law"),
    nightly_unless(
        compared,
        # Lanes have no trigger.
        [
            (target, law)
            for target, law in itertools.product((*QUICK, "host", "m7", "fmu"), LAWS)
            if not (target == "lanes" and triggered(law))
        ],
    ),
)
def test_a_law_of_the_zoo_has_the_same_bits_on_every_target(target: str, law: str) -> None:
    need(TOOLS.get(target, ""))
    scenario = LAWS[law]
    motion = motion_of(scenario)
    expected = answers("python", scenario, "double", motion)
    assert np.isfinite(expected).all()
    np.testing.assert_array_equal(answers(target, scenario, "double", motion), expected)


@pytest.mark.parametrize("law", nightly_unless(lambda law: law in OFTEN, LAWS))
def test_firmware_of_a_law_answers_any_samples_within_the_limit(law: str, tmp_path: Path) -> None:
    scenario = LAWS[law].replace({"guard.checked": True})
    fg.export.firmware(scenario, tmp_path / "out", "float")
    host, random = Host(tmp_path / "out", "float"), np.random.default_rng(7)
    limit = scenario.controller.force_limit
    wild = (0.0, -0.0, 1e-38, 1e-3, 0.5, -2.0, 1e3, -1e9, 1e20, 3e38, NAN, INF, -INF)
    for _ in range(3):
        for _ in range(400):
            x, y, vx, vy = (float(random.choice(wild)) for _ in range(4))
            host.step((x, y), (vx, vy))
            assert all(math.isfinite(force) and abs(force) <= limit for force in host.force)
        for n in range(200):
            host.step((0.5 + 1e-4 * n, 0.3), (0.1, -0.1))
            assert all(math.isfinite(force) and abs(force) <= limit for force in host.force)
