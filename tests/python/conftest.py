"""Says in one line which faces were not tested, and why."""

from __future__ import annotations

from typing import Any


def pytest_terminal_summary(terminalreporter: Any) -> None:
    reasons = {report.longrepr[2] for report in terminalreporter.stats.get("skipped", []) if report.longrepr}
    faces = sorted(reason.removeprefix("Skipped: face ") for reason in reasons if "Skipped: face " in reason)
    if faces:
        terminalreporter.write_line(f"Faces skipped: {'; '.join(faces)}")
