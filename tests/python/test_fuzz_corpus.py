"""Faults found by fuzzers stay fixed: every input of tests/fuzz/corpus works, or is refused in one sentence."""

from __future__ import annotations

import importlib
import random
import subprocess
import sys
from pathlib import Path

import pytest
from children import PATIENCE

FUZZ = Path(__file__).resolve().parents[1] / "fuzz"


@pytest.mark.parametrize("kind", ["scenarios", "studies", "cli"])
def test_every_input_that_failed_once_works_or_is_refused_in_one_sentence(kind: str) -> None:
    cases = (FUZZ / f"corpus/{kind}.jsonl").read_text(encoding="utf-8").splitlines()
    assert cases
    command = [sys.executable, "-B", FUZZ / f"fuzz_{kind}.py", "--known"]  # it changes what no other test expects
    ran = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert len(ran.stdout.splitlines()) == len(cases)


@pytest.mark.parametrize("kind", ["scenarios", "studies", "cli"])
def test_fuzzers_make_inputs(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(FUZZ)
    make = importlib.import_module(f"fuzz_{kind}").make
    assert len({make(random.Random(seed)) for seed in range(100)}) > 90
