"""The same examples on every machine, and one line that names the untested targets, with the reason."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from browser import chromium
from embedded import need
from hypothesis import HealthCheck, settings
from shared import compile_once

# Deterministic, independent of time: `make check-deep` searches for new examples.
settings.register_profile(
    "same everywhere",
    derandomize=True,
    deadline=None,
    database=None,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("same everywhere")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run tests that take a minute first, so that no worker waits for one of them at the end."""
    items.sort(key=lambda item: item.get_closest_marker("takes_a_minute") is None)


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """One browser for all tests of a process, because Playwright cannot start a second one while it runs."""
    need("pages")
    with chromium() as started:
        yield started


@pytest.fixture(scope="session")
def lanes(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """The program that answers in lanes, for every scenario, is compiled by one process of pytest."""
    from fracgyro.export import targets
    from fracgyro.export.compilers import compiler, run

    def system_compiler(*words: str | Path) -> None:
        compile_once(tmp_path_factory, [*compiler(), *map(str, words)], run)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(targets, "system_compiler", system_compiler)
        yield


def pytest_terminal_summary(terminalreporter: Any) -> None:
    reasons = {report.longrepr[2] for report in terminalreporter.stats.get("skipped", []) if report.longrepr}
    targets = sorted(reason.removeprefix("Skipped: target ") for reason in reasons if "Skipped: target " in reason)
    if targets:
        terminalreporter.write_line(f"Targets skipped: {'; '.join(targets)}")
