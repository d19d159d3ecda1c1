"""The saved state of a controller: resuming, refused states, and safety for arbitrary bytes."""

from __future__ import annotations

import copy
import pickle
import struct
import subprocess
import sys
import zlib
from collections.abc import Callable
from pathlib import Path

import fracgyro as fg
import numpy as np
import pytest
from children import PATIENCE
from embedded import need
from nightly import nightly_unless

ROOT = Path(__file__).parents[2]
PAPER = fg.Scenario.paper().replace({"run.duration": 2.0})
MOTION = ([0.5, 0.25], [0.0, 0.1])
FUZZED = [
    ("fuzz_states.py", "python", 8000),
    ("fuzz_states.py", "browser", 6000),
    ("fuzz_fmu.py", "fmi2-loop", 1000),
    ("fuzz_fmu.py", "fmi2-controller", 200),
    ("fuzz_fmu.py", "fmi3-loop", 1000),
]


def running(scenario: fg.Scenario = PAPER, *, single: bool = False) -> fg.Controller:
    """After 40 samples."""
    controller = fg.Controller(scenario, single_precision=single)
    for n in range(40):
        controller.step(n * 1e-3, *MOTION)
    return controller


def refusal(controller: fg.Controller, state: bytes) -> str:
    before = controller.state
    with pytest.raises(ValueError, match=r"^state ") as refused:
        controller.state = state
    assert controller.state == before
    return str(refused.value)


@pytest.mark.parametrize(
    ("script", "face", "attempts"),
    nightly_unless(lambda script, face, attempts: face in {"python", "browser", "fmi3-loop"}, FUZZED),
)
def test_no_bytes_do_harm(script: str, face: str, attempts: int) -> None:
    if face == "browser":
        need("WebAssembly")
    command = [sys.executable, ROOT / "tests/fuzz" / script, "--face", face, "--attempts", str(attempts)]
    command += ["--seconds", str(PATIENCE)]  # the number of attempts ends them
    ran = subprocess.run(command, capture_output=True, text=True, timeout=2 * PATIENCE)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert f"{face}: {attempts}" in ran.stdout


def test_one_flipped_bit_is_told() -> None:
    controller = running()
    saved = bytearray(controller.state)
    for place in range(saved.index(b"\n") + 1, len(saved), 97):
        saved[place] ^= 4
        assert refusal(controller, bytes(saved)) == "state is damaged: it is not as it was saved"
        saved[place] ^= 4
    controller.state = bytes(saved)


def test_an_index_out_of_range_is_refused_though_the_checksum_is_right() -> None:
    """There is one: how many pairs of exponentials, of at most 32, have not settled yet. It is found by its
    value, as the guard's counts are at most 2 in this scenario."""
    controller = running()
    saved = controller.state
    start = saved.index(b"\n") + 1
    body = saved[start + 4 :]
    (at,) = (at for at in range(0, len(body) - 7, 8) if 2 < struct.unpack_from("<Q", body, at)[0] <= 32)
    for index, taken in ((0, True), (5, True), (33, False), (2**63, False)):
        changed = body[:at] + struct.pack("<Q", index) + body[at + 8 :]
        state = saved[:start] + struct.pack("<I", zlib.crc32(changed)) + changed
        if taken:
            controller.state = state
        else:
            assert refusal(controller, state) == "state is damaged: it is not as it was saved"


@pytest.mark.parametrize("cut", [slice(None, -1), slice(None, 0), slice(1, None)])
def test_a_part_of_a_state_is_refused(cut: slice) -> None:
    controller = running()
    refusal(controller, controller.state[cut])


def test_a_state_of_another_controller_is_refused() -> None:
    other = "state was saved by another version, or by a controller of another scenario or precision"
    assert refusal(running(), running(single=True).state) == other
    assert refusal(running(), running(PAPER.replace({"controller.order": 0.8})).state) == other


@pytest.mark.parametrize("state", ["text", None, 3, [1, 2]])
def test_what_is_no_bytes_is_no_state(state: object) -> None:
    with pytest.raises(TypeError, match=r"^state is .*: it must be bytes from `state`$"):
        running().state = state  # type: ignore[assignment]


@pytest.mark.parametrize("single", [False, True])
@pytest.mark.parametrize("make", [copy.copy, copy.deepcopy, lambda c: pickle.loads(pickle.dumps(c))])
def test_a_copy_goes_on_by_itself(make: Callable[[fg.Controller], fg.Controller], single: bool) -> None:
    controller = running(single=single)
    other = make(controller)
    expected = [other.step((40 + n) * 1e-3, *MOTION) for n in range(3)]
    assert controller.estimates.rate != other.estimates.rate
    np.testing.assert_array_equal([controller.step((40 + n) * 1e-3, *MOTION) for n in range(3)], expected)
    assert controller.state == other.state
