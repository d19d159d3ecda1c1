"""Processors that a process may use: its affinity and the quotas of its control groups, in files made here."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from fracgyro.simulation import processors as module
from fracgyro.simulation.many import at_most, threads_available
from fracgyro.simulation.processors import processors, quotas


def written(root: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return root


@pytest.mark.parametrize(
    ("groups", "files", "expected"),
    [
        ("0::/", {"cpu.max": "150000 100000\n"}, [1.5]),
        ("0::/", {"cpu.max": "max 100000\n"}, []),
        ("0::/", {}, []),
        ("0::/", {"cpu.max": "nonsense\n"}, []),
        ("0::/a/b", {"a/b/cpu.max": "max 100000", "a/cpu.max": "300000 100000", "cpu.max": "800000 100000"}, [3, 8]),
        ("0::/../x", {"cpu.max": "200000 100000", "x/cpu.max": "1 1"}, [2]),  # the host's
        ("4:memory:/\n1:cpu:/d", {"cpu/d/cpu.cfs_quota_us": "400000", "cpu/d/cpu.cfs_period_us": "100000"}, [4]),
        (
            "3:cpu,cpuacct:/",
            {"cpu,cpuacct/cpu.cfs_quota_us": "50000", "cpu,cpuacct/cpu.cfs_period_us": "100000"},
            [0.5],
        ),
        ("1:cpu:/", {"cpu/cpu.cfs_quota_us": "-1", "cpu/cpu.cfs_period_us": "100000"}, []),
        ("1:cpuset:/", {"cpuset/cpu.cfs_quota_us": "1", "cpuset/cpu.cfs_period_us": "1"}, []),
    ],
)
def test_quotas_of_both_versions_and_of_the_groups_above(
    groups: str, files: dict[str, str], expected: list[float], tmp_path: Path
) -> None:
    written(tmp_path, {"groups": groups + "\n", **{f"root/{name}": text for name, text in files.items()}})
    assert quotas(tmp_path / "groups", tmp_path / "root") == expected


def test_without_control_groups_there_is_no_quota(tmp_path: Path) -> None:
    assert quotas(tmp_path / "none", tmp_path) == []


@pytest.mark.parametrize(("quota", "expected"), [("250000", 3), ("10000", 1), ("99900000", 8), ("max", 8)])
def test_runs_use_no_more_processors_than_the_quota(
    quota: str, expected: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written(tmp_path, {"groups": "0::/\n", "root/cpu.max": f"{quota} 100000\n"})
    monkeypatch.setattr(module, "OF_PROCESS", tmp_path / "groups")
    monkeypatch.setattr(module, "ROOT", tmp_path / "root")
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(8)), raising=False)
    processors.cache_clear()
    try:
        assert threads_available() == expected
        with at_most(2):
            assert threads_available() == min(expected, 2)
    finally:
        processors.cache_clear()
