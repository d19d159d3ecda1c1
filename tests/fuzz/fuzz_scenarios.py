"""Scenario files: each is simulated, sampled and exported, or refused in one sentence."""

from __future__ import annotations

import copy
import random
import tomllib
import zlib
from collections.abc import Callable
from functools import cache
from pathlib import Path

import fracgyro as fg
import harness
import mutate
from fracgyro.export import web
from fracgyro.export.firmware import coefficients_header
from fracgyro.scenario.messages import paths
from fracgyro.scenario.shipped import SHIPPED, shipped_text

STEPS = 100  # steps of a run: more would take longer without other paths


@cache
def bases() -> list[mutate.Tree]:
    texts = [fg.Scenario.paper().to_toml(), fg.Scenario.paper("printed").to_toml(), *map(shipped_text, SHIPPED)]
    extra = """
        [rate]
        kind = "table"
        points = [[0.0, 1.0], [0.001, 2.0], [0.002, -1.0]]
        [device]
        sensing = "position"
        position_noise_density = 1e-12
        position_range = 1e-5
        position_bits = 12
        actuator_limit = 1e-3
        delay = 2
        cubic_stiffness = [1e10, 1e10]
        stiffness_drift = 30.0
        temperature_points = [[0.0, 0.0], [0.1, 10.0]]
        [controller]
        observer_bandwidth = 60.0
        """
    return [tomllib.loads(text) for text in [*texts, *texts[:1] * 2, extra]]


def make(rng: random.Random) -> bytes:
    base = rng.choice(bases())
    kept = rng.sample(list(base), min(rng.choice([1, 2, 2, 3, 8]), len(base)))
    tree = copy.deepcopy({name: base[name] for name in kept})
    names = [name.rpartition(".")[2] for name in paths(fg.Scenario)]
    for _ in range(rng.choice([0, 1, 1, 1, 2, 2, 3, 6])):
        mutate.change(rng, tree, names)
    data = mutate.toml(tree).encode()
    return mutate.damage(rng, data) if rng.random() < 0.2 else data


def check(case: bytes, folder: Path) -> str:
    path = folder / "scenario.toml"
    path.write_bytes(case)
    with harness.quiet():
        try:
            scenario = fg.Scenario.load(path)
        except Exception as error:
            return harness.refused(error)
        text = scenario.to_toml()
        assert fg.Scenario.from_toml(text).to_toml() == text
        if scenario.run.steps > STEPS:
            scenario = scenario.replace({"run.duration": scenario.run.step * STEPS})
        use = USES[zlib.crc32(case) % len(USES)]  # only one: the time is better spent on more inputs
        try:
            use(scenario)
        except Exception as error:
            harness.refused(error)
    return "worked"


def _step(scenario: fg.Scenario) -> None:
    controller = fg.Controller(scenario)
    for step in range(3):
        controller.step(step * scenario.run.step, [0.5, 0.5], [0.0, 0.0])


USES: tuple[Callable[[fg.Scenario], object], ...] = (
    fg.simulate,
    lambda scenario: fg.metrics.summary(fg.simulate(scenario.replace({"run.record_every": 1}))),
    lambda scenario: fg.measure_many([scenario], seeds=[0, 1]),
    _step,
    lambda scenario: coefficients_header(scenario, "float"),
    lambda scenario: web(scenario, "scenario.json"),
)


if __name__ == "__main__":
    harness.main(harness.Face(make, check))
