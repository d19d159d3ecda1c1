"""The same examples on every machine, and one line that names the untested targets, with the reason."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from browser import chromium
from embedded import need
from hypothesis import HealthCheck, settings

# Deterministic, independent of time: `make check-deep` searches for new examples.
settings.register_profile(
    "same everywhere",
    derandomize=True,
    deadline=None,
    database=None,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("same everywhere")


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "takes_a_minute: comes first")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run tests that take a minute first, so that no worker waits for one of them at the end."""
    items.sort(key=lambda item: item.get_closest_marker("takes_a_minute") is None)


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """One browser for all tests of a process, because Playwright cannot start a second one while it runs."""
    need("pages")
    with chromium() as started:
        yield started


def pytest_terminal_summary(terminalreporter: Any) -> None:
    reasons = {report.longrepr[2] for report in terminalreporter.stats.get("skipped", []) if report.longrepr}
    targets = sorted(reason.removeprefix("Skipped: target ") for reason in reasons if "Skipped: target " in reason)
    if targets:
        terminalreporter.write_line(f"Targets skipped: {'; '.join(targets)}")
