"""The scenarios that come with the package: devices from the literature, each number with its source.

What hardware needs and the paper has not is common to all of them and stands only in common.toml.
"""

from __future__ import annotations

from importlib.resources import files

from ..messages import ScenarioError
from ..scenario import Scenario

# Name: what it is.
SHIPPED = {
    "hardware": "the paper's with what hardware needs: bounded for good, within a force limit",
    "paper_thermal": "the paper's gyroscope and reference, with only thermal noise",
    "paper_resonance": "the paper's gyroscope driven at its resonances, with a realistic force limit",
    "dual_mass": "a dual-mass gyroscope in vacuum, 3925 and 3978 Hz",
    "tuned_in_air": "a gyroscope tuned to near-equal modes, in air",
    "disc": "a mode-matched disc with a quality factor of 2e6",
}
COMMON = "common"


def shipped_text(name: str) -> str:
    """The TOML of a shipped scenario, with its sources. Raises ScenarioError when there is none of this name."""
    if name not in SHIPPED:
        raise ScenarioError(f"scenario is {name}: it must be one of {', '.join(SHIPPED)}")
    head, *tables = _parts(name)
    added = {part.partition("\n")[0]: part for part in _parts(COMMON)[1:]}
    own = {part.partition("\n")[0]: part for part in tables}
    merged = [own.get(title, title) + added.get(title, title).removeprefix(title) for title in own | added]
    return "\n\n".join([head, *merged]) + "\n"


def shipped(name: str) -> Scenario:
    """A device from the literature, or the paper's with what hardware needs, as `fracgyro scenario --list` names them.

    Raises ScenarioError when there is none of this name.

    >>> from fracgyro.scenario.shipped import shipped
    >>> shipped("dual_mass").device.sensing
    'position'
    """
    return Scenario.from_toml(shipped_text(name), source=name)


def exactly_sensed(name: str) -> Scenario:
    """A shipped scenario with position and velocity known exactly, as the laws suppose, and composite adaptation.

    Those without sensing noise are as shipped. Raises ScenarioError when there is none of this name.
    """
    scenario = shipped(name)
    if scenario.adaptation.kind != "joint":
        return scenario
    exact = {"device.sensing": "full", "device.position_noise_density": 0.0}
    return scenario.replace({**exact, "adaptation.kind": "composite"})


def _parts(name: str) -> list[str]:
    """The head of a file and each of its tables, without the blank lines between them."""
    lines = (files(__package__) / f"{name}.toml").read_text(encoding="utf-8").splitlines()
    starts = [number for number, line in enumerate(lines) if line.startswith("[")]
    return ["\n".join(lines[a:b]).strip() for a, b in zip([0, *starts], [*starts, None], strict=True)]
