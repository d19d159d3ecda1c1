"""`fracgyro compare` on several workers that keep their trials in one database."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from threading import Thread
from typing import Any

import fracgyro as fg
import pytest
from children import PATIENCE
from fracgyro_lab.comparison.journal import Journal, opened
from fracgyro_lab.comparison.run import compare
from postgres import postgres
from sqlalchemy import create_engine, text

SMALL: dict[str, Any] = {"only": ["linear", "pid"], "classes": ["F"], "noise": [0.0], "trials": 6, "quick": True}


def rows(path: Path) -> list[dict[str, Any]]:
    found = json.loads(path.read_text(encoding="utf-8"))["contenders"]
    return [{name: value for name, value in row.items() if name != "cost"} for row in found]


def states(address: str) -> dict[str, int]:
    """Number of trials in the database, by state."""
    engine = create_engine(address)
    with engine.connect() as connection:
        found = connection.execute(text("SELECT state, count(*) FROM trials GROUP BY state")).all()
    engine.dispose()
    return dict(map(tuple, found))


def linger(inside: str) -> None:
    """In a worker: its next tuning stops after its third trial, reports this, and never ends."""
    keep, kept = Journal.keep, []

    def stop(self: Journal, *arguments: Any) -> None:
        keep(self, *arguments)
        kept.append(self)
        if len(kept) == 3:
            Path(inside).touch()
            time.sleep(PATIENCE)

    Journal.keep = stop  # type: ignore[method-assign]


# The next test covers the database, test_sweep.py workers that are killed: this one, both together.
@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore::DeprecationWarning:distributed", "ignore::ResourceWarning")
def test_a_tuning_whose_worker_is_killed_goes_on_from_the_trials_in_the_database(tmp_path: Path) -> None:
    from distributed import Client, LocalCluster

    expected = compare("track", tmp_path / "here", **SMALL)
    with (
        postgres() as address,
        LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0") as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        pids = client.run(os.getpid)
        victim = min(pids)
        client.run(linger, str(tmp_path / "inside"), workers=[victim])
        results: list[Any] = []
        there = {"scheduler": cluster.scheduler_address, "storage": address}
        running = Thread(target=lambda: results.append(compare("track", tmp_path / "there", **SMALL, **there)))
        running.start()
        while running.is_alive() and not (tmp_path / "inside").exists():
            time.sleep(0.01)
        held = states(address)["COMPLETE"]
        assert held >= 3
        os.kill(pids[victim], signal.SIGKILL)
        running.join(timeout=PATIENCE)
        total = states(address)["COMPLETE"]
        assert total == sum(row["trials"] for row in results[0].rows), "no trial is lost, and none is made twice"
        assert total > held
    assert len(results) == 1
    assert rows(tmp_path / "there" / "compare.json") == rows(expected.data)


def test_what_the_database_holds_is_not_tuned_again(tmp_path: Path) -> None:
    with postgres() as address:
        first = compare("track", tmp_path / "first", **{**SMALL, "only": ["pid"]}, storage=address)
        trials = sum(row["trials"] for row in first.rows)
        assert states(address) == {"COMPLETE": trials}
        compare("track", tmp_path / "second", **{**SMALL, "only": ["pid"]}, storage=address)
        assert states(address) == {"COMPLETE": trials}
    assert rows(tmp_path / "first" / "compare.json") == rows(tmp_path / "second" / "compare.json")


def test_a_trial_that_the_database_holds_damaged_is_refused(tmp_path: Path) -> None:
    address = f"sqlite:///{tmp_path / 'trials.db'}"
    with opened(address, {"a": 1}) as journal:
        assert journal.found({"k": 1.0}) is None
        journal.keep({"k": 1.0}, [0.5, 0.5, 0.1, True])
    with opened(address, {"a": 1}) as journal:
        assert journal.found({"k": 1.0}) == [0.5, 0.5, 0.1, True]
        assert journal.found({"k": 2.0}) is None
    with opened(address, {"a": 2}) as journal:
        assert journal.found({"k": 1.0}) is None, "another tuning"
    engine = create_engine(address)
    with engine.begin() as connection:
        connection.execute(
            text("UPDATE trial_user_attributes SET value_json = '[0.1, 0.5, 0.1, true]' WHERE key = 'found'")
        )
    engine.dispose()
    with pytest.raises(fg.ScenarioError, match=r"trial 0 of .* in the database is damaged"), opened(address, {"a": 1}):
        pass


def test_no_process_outlives_a_comparison_that_is_killed(tmp_path: Path) -> None:
    words = ["compare", "track", "--only", "pid", "--class", "F", "--quick", "--out", str(tmp_path / "out")]
    command = [sys.executable, "-m", "fracgyro", *words]
    lone = subprocess.Popen(command, stderr=subprocess.DEVNULL, start_new_session=True)
    tunings = tmp_path / "out" / "tunings"
    while lone.poll() is None and not (tunings.is_dir() and any(tunings.iterdir())):
        time.sleep(0.01)
    assert lone.poll() is None
    lone.kill()
    lone.wait(timeout=PATIENCE)
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        try:
            os.killpg(lone.pid, 0)
        except ProcessLookupError:
            return
        time.sleep(0.05)
    pytest.fail("a process is left")


def test_a_scheduler_takes_no_controller_of_ones_own(tmp_path: Path) -> None:
    mine = tmp_path / "mine.py"
    mine.write_text("def law(kp):\n    return lambda s: (0.0, 0.0)\nlaw.ranges = {'kp': (1, 2)}\n", encoding="utf-8")
    with pytest.raises(ValueError, match="it must be left out with --controller"):
        compare("track", tmp_path / "out", **SMALL | {"only": []}, controller=f"{mine}:law", scheduler="tcp://x:1")
