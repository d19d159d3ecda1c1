"""The numbers of an identification: quantities of each condition, tests, notes and trends."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .diagnostics import Test
from .first_stage import Fitted
from .quantity import Quantity
from .records import State
from .second_stage import Device, Known
from .sweep import SweepFit
from .trends import Trend

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Condition:
    """Results for one bias and temperature: fits of the first stage with their rates, and the device, if both pick-offs
    were recorded."""

    state: State
    fits: tuple[tuple[State, Fitted | SweepFit], ...]
    device: Device | None
    quantities: dict[str, Quantity]


@dataclass(frozen=True)
class Results(Mapping[str, Quantity]):
    """The data of `Found`, by quantity."""

    conditions: tuple[Condition, ...]
    tests: tuple[Test, ...]
    notes: tuple[str, ...]
    known: Known
    files: dict[str, str] = field(default_factory=dict)
    trends: tuple[Trend, ...] = ()

    def __getitem__(self, name: str) -> Quantity:
        """A quantity. Raises KeyError, with the known names, for another name."""
        known = self.conditions[0].quantities
        if name not in known:
            raise KeyError(f"{name} is not among the quantities {', '.join(known)}")
        return known[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.conditions[0].quantities)

    def __len__(self) -> int:
        return len(self.conditions[0].quantities)

    @property
    def groups(self) -> tuple[Fitted | SweepFit, ...]:
        """The fits of the first stage, one for each state of the device and kind of record."""
        return tuple(fit for condition in self.conditions for _, fit in condition.fits)

    @property
    def covariance(self) -> Array:
        """Covariance of the parameters of the second stage, in units of omega0; of the first, with one pick-off."""
        device = self.conditions[0].device
        return self.groups[0].fit.covariance if device is None else device.solution.covariance

    def plain(self) -> dict[str, Any]:
        """The content of identify.json."""
        return {
            "version": version("fracgyro"),
            "files": self.files,
            "known": {"mass": self.known.mass, "pickoff": self.known.pickoff, "pickoff_ratio": self.known.ratio,
                      "assumed": dict(self.known.assumed)},
            "notes": list(self.notes),
            "tests": [each.plain() for each in self.tests],
            "conditions": [_condition(each) for each in self.conditions],
            "trends": [each.plain() for each in self.trends],
        }  # fmt: skip


def _condition(condition: Condition) -> dict[str, Any]:
    """A condition as JSON."""
    device = condition.device
    content: dict[str, Any] = {
        "bias": condition.state.bias,
        "temperature": condition.state.temperature,
        "quantities": {name: each.plain() for name, each in condition.quantities.items()},
        "fits": [{"rate": state.rate, **fit.plain()} for state, fit in condition.fits],
    }
    if device is not None:
        content["device"] = {
            "omega0": device.problem.unit,
            "parameters": dict(zip(device.problem.names, device.solution.parameters.tolist(), strict=True)),
            "covariance": device.solution.covariance.tolist(),
            "chi_squared": device.solution.squares,
        }
    return content
