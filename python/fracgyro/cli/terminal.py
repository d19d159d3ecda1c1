"""Progress bars and tables in the terminal."""

from __future__ import annotations

import json
import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

MAX_WIDTH = 10_000  # columns of a table; a narrow terminal breaks lines, but no text is cut off


def print_table(titles: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Prints a table."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, header_style="bold", pad_edge=False)
    for title in titles:
        table.add_column(Text(title))
    for row in rows:
        table.add_row(*map(Text, row))  # rich takes [device] in a string for a style
    Console(soft_wrap=True, width=MAX_WIDTH).print(table)


def json_text(content: Any) -> str:
    """The content as JSON, which has no NaN and no infinity: they become null. Paths become text."""
    return json.dumps(_finite(content), default=str, allow_nan=False)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _finite(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(inner) for inner in value]
    return None if isinstance(value, float) and not -float("inf") < value < float("inf") else value


@contextmanager
def progress(doing: str, rate: str = "") -> Iterator[Callable[..., None]]:
    """Context manager: a progress bar, updated by (done, total, description); `rate`: unit of the speed per second."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, ProgressColumn, Task, TaskProgressColumn, TextColumn
    from rich.progress import TimeRemainingColumn as Remaining
    from rich.text import Text

    class Rate(ProgressColumn):
        def render(self, task: Task) -> Text:
            speed = task.finished_speed or task.speed
            return Text(f"{speed:.0f} {rate}" if speed and rate else "")

    # The bar goes to standard error: standard output holds only results.
    columns = (TextColumn("{task.description:<22}"), BarColumn(), TaskProgressColumn())
    bar = Progress(*columns, Remaining(elapsed_when_finished=True), Rate(), console=Console(stderr=True))
    task = bar.add_task(doing, start=False)

    interrupts: list[int] = []

    def interrupt(number: int, _: object) -> None:
        # A callback may swallow KeyboardInterrupt; raised from `show` it is not lost.
        interrupts.append(number)
        if len(interrupts) > 1:
            raise KeyboardInterrupt

    def show(done: float, total: float, doing: str | None = None) -> None:
        if interrupts:
            raise KeyboardInterrupt
        if not bar.live.is_started:  # start only after the input was validated
            bar.start()
            bar.reset(task, completed=int(done))  # excludes resumed work from the speed
        bar.update(task, completed=done, total=total, description=doing)

    before = signal.signal(signal.SIGINT, interrupt)
    try:
        yield show
    finally:
        signal.signal(signal.SIGINT, before)
        if bar.live.is_started:  # stopping it unstarted would print it
            with suppress(OSError):  # a closed terminal must not stop the work
                bar.stop()
