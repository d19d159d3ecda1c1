"""The result of an identification, and the files that it writes."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from ..files import whole_file, whole_folder
from ..scenario import Scenario
from ..scenario.schema import Plant
from .advice import Advice, advice
from .prediction import Prediction, predict
from .results import Results
from .to_scenario import Axes, scenario_of, toml_of


@dataclass(frozen=True)
class Found(Results):
    """The identified device: `found["kxy"]` is a `Quantity`, `found.scenario()` a scenario.

    `conditions`: one for each bias and temperature, of which the first is that of the quantities and the scenario;
    `tests`: of the model; `notes`: what was assumed and found in the records; `trends`: over bias and temperature;
    `known`: the numbers that were given; `files`: by name, the SHA-256 of each record.
    """

    @property
    def plant(self) -> Plant:
        """The identified plant, in SI, or with mass 1 kg if no mass was given."""
        return self.scenario().plant

    @cached_property
    def advice(self) -> tuple[Advice, ...]:
        """Further records, and how much each would narrow the intervals; from the bound, without a run."""
        return advice(self)

    @cached_property
    def prediction(self) -> Prediction | None:
        """Errors of a rate sensor that has the numbers of this device; None if the pick-off ratio is not determined.

        Runs the scenario a few times, which takes a second.
        """
        return predict(self.scenario(), self.get("pickoff_ratio"))

    def plain(self) -> dict[str, Any]:
        """The content of identify.json; `schema` describes it."""
        more = None if self.prediction is None else self.prediction.plain()
        return super().plain() | {"record_next": [each.plain() for each in self.advice], "prediction": more}

    def scenario(self, axes: Axes = "pickoffs") -> Scenario:
        """The identified device with the controller of the shipped scenario that is most like it.

        `axes`: those of the plant. "pickoffs": x is the direction of the x pick-off; "principal": those of the
        stiffness, with device.pickoff_misalignment. Raises ValueError for others.
        """
        return scenario_of(self, axes)

    def to_toml(self, axes: Axes = "pickoffs") -> str:
        """The scenario as TOML, with the interval and the source of each identified number as comments."""
        return toml_of(self, axes)

    def save(self, path: str | os.PathLike[str], axes: Axes = "pickoffs") -> None:
        """Writes device.toml, identify.json and report.html into a new folder; or, to a path that ends in .toml, only
        the scenario.

        Raises ValueError if it cannot be written.
        """
        toml = self.to_toml(axes)
        if Path(path).suffix == ".toml":
            with whole_file(path) as scratch:
                scratch.write_text(toml, encoding="utf-8", newline="\n")
            return
        from .report import write_report

        with whole_folder(path) as folder:
            (folder / "device.toml").write_text(toml, encoding="utf-8", newline="\n")
            text = json.dumps(self.plain(), indent=1, ensure_ascii=False, allow_nan=False)
            (folder / "identify.json").write_text(text + "\n", encoding="utf-8")
            write_report(folder / "report.html", self, toml, self.advice, self.prediction)
