"""The scenarios that come with the package: devices from the literature, each number with its source."""

from __future__ import annotations

from importlib.resources import files

from .scenario import Scenario, ScenarioError

# Name: what it is.
SHIPPED = {
    "paper_thermal": "the paper's gyroscope and reference, with thermal noise alone",
    "paper_resonance": "the paper's gyroscope driven at its resonances, with a realistic force limit",
    "dual_mass": "a dual-mass gyroscope in vacuum, 3925 and 3978 Hz",
    "tuned_in_air": "a gyroscope tuned to near-equal modes, in air",
    "disc": "a mode-matched disc with a quality factor of 2e6",
}


def shipped_text(name: str) -> str:
    """The TOML of a shipped scenario, with its sources. Raises ScenarioError when there is none of this name."""
    if name not in SHIPPED:
        raise ScenarioError(f"scenario is {name}: it must be one of {', '.join(SHIPPED)}")
    return (files(__package__) / "scenarios" / f"{name}.toml").read_text(encoding="utf-8")


def shipped(name: str) -> Scenario:
    """A shipped scenario. Raises ScenarioError when there is none of this name."""
    return Scenario.from_toml(shipped_text(name), source=name)
