"""Pictures of the board as SVG: errors over chattering with the limit, and the trace of an entry.

Colors are those of the page's style, so that one picture serves light and dark.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from html import escape

from .entry import Entry

WIDTH, HEIGHT = 640, 400
LEFT, RIGHT, TOP, BOTTOM = 62, 14, 14, 48
TRACE_WIDTH, TRACE_HEIGHT = 120, 28
Points = Sequence[Sequence[float]]


class _Axis:
    """A logarithmic axis from whole decades to pixels."""

    def __init__(self, values: Sequence[float], begin: float, end: float) -> None:
        self.low = math.floor(math.log10(min(values)) * 2) / 2
        self.high = math.ceil(math.log10(max(values)) * 2) / 2
        self._begin, self._end = begin, end

    def at(self, value: float) -> float:
        share = (math.log10(value) - self.low) / (self.high - self.low)
        return self._begin + share * (self._end - self._begin)

    def ticks(self) -> Iterator[tuple[float, str]]:
        """Place and text of each power of ten."""
        for power in range(math.ceil(self.low), math.floor(self.high) + 1):
            yield self.at(10.0**power), f"{10.0**power:g}" if -3 < power < 3 else f"1e{power}"


def chart(entries: Sequence[tuple[str, Entry]], limit: Points) -> str:
    """Error over chattering of entries, with their names, on the line of the limit and with the fronts of trials.

    `limit`: [chattering, error]. An entry without a chattering or an error is not shown.
    """
    placed = [
        (name, entry, entry.best.chattering, entry.best.error.value)
        for name, entry in entries
        if entry.best.chattering and entry.best.error.value
    ]
    both = [*((x, y) for _, _, x, y in placed), *((x, y) for x, y in limit)]
    across = _Axis([x for x, _ in both], LEFT, WIDTH - RIGHT)
    up = _Axis([y for _, y in both], HEIGHT - BOTTOM, TOP)
    parts = [
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" class="chart">',
        "<title>Error over chattering</title><desc>Each mark is an entry with its best gains; the line is the least "
        "error of any controller.</desc>",
        *_frame(across, up),
        f'<polyline class="limit" points="{_line(limit, across, up)}"/>',
    ]
    for name, entry, x, y in placed:
        inside = [(a, b) for a, b in entry.front if 10**across.low <= a <= 10**across.high and b <= 10**up.high]
        words = escape(f"{entry.law}: error {y:.3g}, chattering {x:.3g}")
        parts += [
            f'<g class="entry" data-entry="{escape(name)}" tabindex="0"><title>{words}</title>',
            f'<polyline class="front" points="{_line(inside, across, up)}"/>' if len(inside) > 1 else "",
            f'<circle cx="{across.at(x):.1f}" cy="{up.at(y):.1f}" r="5"/>',
            f'<text x="{min(across.at(x) + 8, WIDTH - 150):.1f}" y="{up.at(y) - 7:.1f}">{escape(entry.law)}</text></g>',
        ]
    return "".join([*parts, "</svg>"])


def _frame(across: _Axis, up: _Axis) -> Iterator[str]:
    for x, text in across.ticks():
        yield f'<line class="grid" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP}" y2="{HEIGHT - BOTTOM}"/>'
        yield f'<text class="tick" x="{x:.1f}" y="{HEIGHT - BOTTOM + 20}" text-anchor="middle">{text}</text>'
    for y, text in up.ticks():
        yield f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>'
        yield f'<text class="tick" x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{text}</text>'
    middle = (LEFT + WIDTH - RIGHT) / 2
    yield f'<text class="tick" x="{middle:.0f}" y="{HEIGHT - 6}" text-anchor="middle">chattering</text>'
    yield f'<text class="tick" x="{LEFT + 8}" y="{TOP + 16}">error, q0</text>'


def _line(points: Points, across: _Axis, up: _Axis) -> str:
    return " ".join(f"{across.at(x):.1f},{up.at(y):.1f}" for x, y in points)


def trace(errors: Sequence[float | None], low: float, high: float) -> str:
    """The error of a run over time, logarithmic from `low` to `high`; it ends where the run diverged."""
    axis = _Axis([low, high], TRACE_HEIGHT - 1, 1)
    last = len(errors) - 1
    points = [
        (TRACE_WIDTH * place / last, axis.at(min(max(error, low), high))) for place, error in enumerate(errors) if error
    ]
    line = " ".join(f"{x:.0f},{y:.1f}" for x, y in points)
    return (
        f'<svg viewBox="0 0 {TRACE_WIDTH} {TRACE_HEIGHT}" class="trace" role="img" aria-label="error over time, '
        f'{low:.0e} to {high:.0e}, logarithmic"><polyline points="{line}"/></svg>'
    )
