"""The same examples on every machine, and one line that names the faces not tested, and why."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from browser import chromium
from embedded import need
from hypothesis import HealthCheck, settings

# Neither the clock nor chance decides: `make check-deep` is where new examples are searched for.
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
    """Tests that take a minute come first: at the end no worker waits for one of them."""
    items.sort(key=lambda item: item.get_closest_marker("takes_a_minute") is None)


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """One for all tests of a process: Playwright starts no second one while it runs."""
    need("pages")
    with chromium() as started:
        yield started


def pytest_terminal_summary(terminalreporter: Any) -> None:
    reasons = {report.longrepr[2] for report in terminalreporter.stats.get("skipped", []) if report.longrepr}
    faces = sorted(reason.removeprefix("Skipped: face ") for reason in reasons if "Skipped: face " in reason)
    if faces:
        terminalreporter.write_line(f"Faces skipped: {'; '.join(faces)}")
