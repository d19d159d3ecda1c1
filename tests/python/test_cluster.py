"""Tasks on a cluster: several short units of work in one, each with its result; a unit that fails is named."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import pytest
from fracgyro.study.cluster import PER_THREAD, TASK, UnitFailed, measured_there, together

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning:distributed", "ignore::ResourceWarning")


@dataclass(frozen=True)
class Unit:
    number: int
    seconds: float = 0.0
    why: str = ""

    @property
    def name(self) -> str:
        return f"unit {self.number}"

    @property
    def runs(self) -> int:
        return 10

    def measure(self) -> int:
        time.sleep(self.seconds)
        if self.why:
            raise RuntimeError(self.why)
        return self.number**2


@contextmanager
def cluster() -> Iterator[tuple[Any, list[int]]]:
    """A client of workers in this process, and the numbers of units in the tasks that it has submitted."""
    from distributed import Client, LocalCluster

    sizes: list[int] = []
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, processes=False, dashboard_address=None) as workers,
        Client(workers, set_as_default=False) as client,
    ):
        submit = client.submit

        def counted(function: Any, pieces: list[Unit], *words: Any, **named: Any) -> Any:
            sizes.append(len(pieces))
            return submit(function, pieces, *words, **named)

        client.submit = counted
        yield client, sizes


def test_short_units_share_tasks_and_every_one_has_its_result() -> None:
    work = [Unit(number) for number in range(500)]
    done: list[int] = []
    with cluster() as (client, sizes):
        found = {piece.number: result for piece, result in measured_there(client, work, done.append)}
    assert found == {number: number**2 for number in range(500)}
    assert sum(done) == 5000
    assert sum(sizes) == 500
    assert sizes[: 2 * PER_THREAD] == [1] * 2 * PER_THREAD, "until it is known how long one takes"
    assert max(sizes) > 50
    assert len(sizes) < 100


def test_the_unit_that_fails_is_named() -> None:
    work = [Unit(number, why="no such\nnumber" if number == 37 else "") for number in range(60)]
    wanted = r"^unit 37 failed on the cluster: no such number; run again with --resume$"
    with cluster() as (client, _), pytest.raises(ValueError, match=wanted):
        list(measured_there(client, work, lambda _: None))


def test_a_worker_of_another_version_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    versions = iter(["1.0", "1.0", *["2.0"] * 100])
    monkeypatch.setattr("fracgyro.study.cluster.version", lambda _: next(versions))
    with cluster() as (client, _), pytest.raises(ValueError, match=r"the worker has fracgyro 2\.0, not 1\.0"):
        list(measured_there(client, [Unit(0), Unit(1)], lambda _: None))


def test_units_of_a_task_are_as_many_as_take_its_time_and_leave_some_for_all() -> None:
    assert together(10**6, 10, TASK) == 1
    assert together(10**6, 10, TASK / 8) == 8
    assert together(10**6, 10, 10 * TASK) == 1
    assert together(100, 10, 0.0) == 100 // (10 * PER_THREAD)
    assert together(1, 10, 0.0) == 1


def test_a_failure_is_sent_with_its_name() -> None:
    import pickle

    assert pickle.loads(pickle.dumps(UnitFailed("unit 1", "why"))).args == ("unit 1", "why")
