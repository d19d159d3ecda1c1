"""entry.json: its fields, and their JSON Schema."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Literal

from fracgyro.files import read_input, reason
from fracgyro.scenario import ScenarioError
from pydantic import BaseModel, ConfigDict, Field, ValidationError

Seed = Annotated[int, Field(ge=0, le=2**63 - 1)]
Positive = Annotated[float, Field(gt=0)]
Share = Annotated[float, Field(ge=0)]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)


class Interval(_Part):
    """A mean over seeds with its 95 % interval; null if a run diverged."""

    value: Positive | None
    low: Positive | None
    high: Positive | None


class Change(Interval):
    """The error with a change, over that of the same seeds without it."""

    lost: int = Field(ge=0, description="Runs that diverged, or whose error is as large as the reference.")
    seeds: int = Field(ge=1)


class OverLimit(_Part):
    """The errors over the least of any controller with the same chattering."""

    steady: Positive
    error: Positive | None


class Row(_Part):
    """A law with one set of gains, on the seeds for judging."""

    gains: dict[str, float | list[float]]
    error: Interval = Field(description="Geometric mean of the four RMS errors, in q0.")
    steady: Positive | None = Field(description="Geometric mean of the steady RMS errors on x and y, in q0.")
    chattering: Share | None = Field(description="The chattering index of the larger axis.")
    kept: bool = Field(description="True if no run diverged and the chattering is at most the ceiling.")
    diverged: int = Field(ge=0, description="Number of runs that diverged.")
    over_limit: OverLimit | None


class Rows(_Part):
    """With the gains that the law comes with, and with those that the search found."""

    as_given: Row | None
    tuned: Row | None


class Setting(_Part):
    """The task; the same for all entries of a class."""

    task: Literal["track"]
    scenario: str
    information: Literal["F", "P"] = Field(description="F: positions and velocities are measured; P: positions only.")
    noise: Share = Field(description="Density of the noise of the measured position, m/sqrt(Hz).")
    ceiling: Positive = Field(description="Largest chattering of the tuned row.")
    trials: int = Field(ge=0, description="Number of different trials of the search.")


class Seeds(_Part):
    """Noise seeds, which follow from `sha256`, `law` and `information`."""

    training: list[Seed]
    judging: list[Seed]


class Versions(_Part):
    fracgyro: str
    python: str
    numpy: str


class Trace(_Part):
    """The largest error in equal parts of a run with the first seed for judging, in q0; null after a divergence."""

    until: Positive = Field(description="The end of the run, in 1/omega0.")
    error: list[Share | None]


class Entry(_Part):
    """A law on the board."""

    format: Literal[1]
    law: str = Field(description="FILE.py:NAME, or the name of a compiled law.", pattern=r"^[\w.+-]+(:\w+)?$")
    words: str = Field(max_length=200)
    author: str = Field(max_length=100)
    sha256: str = Field(description="Of the file, or of the compiled law's list of gains.", pattern="^[0-9a-f]{64}$")
    versions: Versions
    setting: Setting
    seeds: Seeds
    rows: Rows
    robustness: dict[str, Change] = Field(description="By change, for the tuned row, or the other if there is none.")
    step_over_pid: Positive = Field(description="Time of a step of the closed loop, over that with PID.")
    state_bytes: int | None = Field(ge=0, description="Memory that changes while running; null for a Python law.")
    front: list[list[float]] = Field(description="[chattering, error] of the trials that no other beats in both.")
    trace: Trace
    own_network: bool = Field(description="True if the law ran in a network namespace without a device.")

    @property
    def best(self) -> Row:
        """The tuned row; the one as given for a law without gains."""
        row = self.rows.tuned or self.rows.as_given
        assert row is not None
        return row

    def to_json(self) -> str:
        """The text of the file: a line for each field."""
        found = self.model_dump()
        lines = [f"{json.dumps(name)}: {json.dumps(value, ensure_ascii=False)}" for name, value in found.items()]
        return "{\n" + ",\n".join(lines) + "\n}\n"


def schema() -> dict[str, Any]:
    """JSON Schema of entry.json."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **Entry.model_json_schema()}


def read(path: Path) -> Entry:
    """The entry of a file. Raises ScenarioError for another file."""
    try:
        entry = Entry.model_validate_json(read_input(path))
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"])) or "it"
        raise ScenarioError(f"{path} is not an entry of the board: {place}: {first['msg']}") from None
    except OSError as error:
        raise ScenarioError(f"{path} cannot be read: {reason(error)}") from None
    if entry.rows.tuned is None and entry.rows.as_given is None:
        raise ScenarioError(f"{path} is not an entry of the board: rows: both are null")
    return entry
