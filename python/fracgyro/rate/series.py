"""One column of a gyroscope's record with its results."""

from __future__ import annotations

from dataclasses import dataclass

from .allan import Allan
from .imu import Noise
from .record import Record
from .results import Result
from .spectrum import Line
from .units import DEG_PER_S


@dataclass(frozen=True)
class Series:
    """One column of a record: values, Allan deviation, events and figures."""

    path: str
    record: Record
    column: int
    found: Allan
    figures: list[Result]

    @property
    def name(self) -> str:
        return self.record.columns[self.column]

    @property
    def notes(self) -> list[str]:
        """Assumptions, and excluded parts."""
        return [*self.record.notes, *map(line_of, self.found.lines)]


def left_out(series: Series) -> str:
    """One sentence on the fitted range and the excluded ranges."""
    found = series.found
    if found.fitted is None:
        return "No averaging range of four octaves fits the noise terms."
    first, last = found.fitted
    words = f"The fit covers averaging times {_seconds(first)} to {_seconds(last)} s"
    out = []
    if first > 1.01 * found.tau[0]:
        out.append(f"shorter ones down to {_seconds(float(found.tau[0]))} s")
    if last < 0.99 * found.tau[-1]:
        out.append(f"longer ones up to {_seconds(float(found.tau[-1]))} s")
    if out:
        return f"{words}; {' and '.join(out)} do not fit and are excluded."
    response = f"; a low-pass response of {found.response_time:.3g} s was divided out" if found.response_time else ""
    return f"{words} (the whole record){response}."


def line_of(line: Line) -> str:
    """A note about an excluded sinusoid."""
    return f"a sinusoid of {line.frequency:.5g} Hz, {DEG_PER_S.of(line.amplitude):.3g} deg/s, is excluded"


def noise_of(series: Series) -> Noise:
    """The noise for a navigation filter."""
    record = series.record
    values = record.values[series.column]
    seconds = len(values) * record.interval
    return Noise(
        series.found,
        record.interval,
        float(values.mean()),
        f"on {series.name} of {series.path}, {_seconds(seconds)} s at rest",
    )


def _seconds(value: float) -> str:
    return f"{value:.3g}" if value < 1000 else f"{value:,.0f}"
