"""What commands show while they work, and tables."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress

MAX_WIDTH = 10_000  # columns of a table, whatever the terminal's: it may break lines, but nothing is cut off


def print_table(titles: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Prints a table."""
    from rich.console import Console
    from rich.table import Table

    table = Table(*titles, box=None, header_style="bold", pad_edge=False)
    for row in rows:
        table.add_row(*row)
    Console(soft_wrap=True, width=MAX_WIDTH).print(table)


@contextmanager
def progress(doing: str, rate: str = "") -> Iterator[Callable[..., None]]:
    """A bar, given (done, total, what is being done); with `rate`, the unit of what is done per second."""
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
        # Raised anywhere, KeyboardInterrupt may be swallowed by a callback; raised from `show` it arrives.
        interrupts.append(number)
        if len(interrupts) > 1:
            raise KeyboardInterrupt

    def show(done: float, total: float, doing: str | None = None) -> None:
        if interrupts:
            raise KeyboardInterrupt
        if not bar.live.is_started:  # now that the input has been found good
            bar.start()
            bar.reset(task, completed=int(done))  # what was done before counts for no speed
        bar.update(task, completed=done, total=total, description=doing)

    before = signal.signal(signal.SIGINT, interrupt)
    try:
        yield show
    finally:
        signal.signal(signal.SIGINT, before)
        if bar.live.is_started:  # stopped unstarted, it would print itself
            with suppress(OSError):  # no work is lost because nobody can see the bar
                bar.stop()
