"""The check of comments, docstrings, messages and Markdown finds planted faults, and nothing in code or plain prose."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "tests"))

import english  # noqa: E402

PLANTED = {
    "a.py": (
        '"""Of runs.\n\nThe colour of a picture."""\n\ntold = 1  # one\n\n# What a run needs,\n# of all things\n'
        'raise ValueError("somebody learnt it")\n',
        ["1: Of", "3: colour", "7: What", "9: learnt", "9: somebody"],
    ),
    "a.cpp": ('int alone;  // as set\nauto url = "https://a";\n/* One\n   that is no sum */\n', ["1: as", "4: is no"]),
    "a.mjs": ("const face = `so many`;  // beside it\n", ["1: beside"]),
    "a.toml": ('kind = "a"  # where it ends\n[beside]\n', ["1: where"]),
    "Makefile": ("# Whether to build anew\nall:\n\techo beside\n", ["1: Whether", "1: anew"]),
    "a.md": (
        "# Neighbours\n\n`told` tells\n\n```sh\nmend\n```\n",
        ["1: Neighbours", "3: tells"],
    ),
}


@pytest.mark.parametrize("name", PLANTED)
def test_every_planted_fault_is_found_at_its_line_and_nothing_else(name: str) -> None:
    text, expected = PLANTED[name]
    found = [line.removeprefix(f"{name}:") for line in english.findings(name, text)]
    assert [":".join(line.split(":")[:2]) for line in found] == expected


def test_a_clean_file_passes_and_a_fault_is_reported_with_what_to_say() -> None:
    ran = subprocess.run([sys.executable, english.__file__, "README.md"], capture_output=True, text=True)
    assert (ran.returncode, ran.stdout) == (0, "")
    assert english.findings("a.md", "a run made again") == ["a.md:1: made again: again; regenerated"]
