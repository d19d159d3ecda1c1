"""FMUs of both versions with an importer that makes every mistake: calls in any order, wrong references, wrong sizes,
NULL where FMI allows it or a careless importer passes it, any bytes as a state.

An input is a string of bytes that encodes the calls. Every call ends in OK or in an error with one sentence for
the logger; FMI defines the allowed order of calls. With sanitizers: CXX="c++ -fsanitize=address,undefined" and libasan
preloaded.
"""

from __future__ import annotations

import ctypes
import random
import resource
import tempfile
from collections.abc import Callable
from ctypes import byref, c_char, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from functools import cache, partial
from pathlib import Path
from typing import Any, Literal

import fmpy
import fracgyro as fg
import harness
import numpy as np
from payloads import payload

OK, WARNING, ERROR = 0, 1, 3
MADE, INITIALIZING, RUNNING, TERMINATED = range(4)
STEP = 1e-3
TOKEN = 39  # a GUID in braces and its terminating zero
NUMBERS = [0.0, 1.0, -1.0, 0.5, 1e-3, 1e9, -1e300, 1.7976931348623157e308, float("nan"), float("inf"), 5e-324]
# Device settings: noise, converters and a dynamic rate use a different loop.
DEVICE = {
    "adaptation.kind": "joint",
    "rate.kind": "sine",
    "rate.amplitude": 1.0,
    "rate.frequency": 10.0,
    "device.sensing": "position",
    "device.position_noise_density": 1e-13,
    "device.position_range": 2e-6,
    "device.position_bits": 16,
    "device.delay": 1,
}
FACES: dict[str, tuple[Literal["2.0", "3.0"], Literal["loop", "controller"], dict[str, object]]] = {
    "fmi2-loop": ("2.0", "loop", {}),
    "fmi2-controller": ("2.0", "controller", {}),
    "fmi3-loop": ("3.0", "loop", {}),
    "fmi3-device": ("3.0", "loop", DEVICE),
}
Log2 = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)
Log3 = ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)


class Callbacks(ctypes.Structure):
    _fields_ = [("log", Log2), *((name, c_void_p) for name in ("allocate", "free", "finished", "environment"))]


class Bytes:
    """Numbers of an input, one by one; 0 after its end."""

    def __init__(self, text: bytes) -> None:
        self._text, self._at = text, 0

    def __bool__(self) -> bool:
        return self._at < len(self._text)

    def below(self, limit: int) -> int:
        self._at += 1
        return self._text[self._at - 1] % limit if self._at <= len(self._text) else 0

    def number(self) -> float:
        chosen = self.below(2 * len(NUMBERS))
        return NUMBERS[chosen] if chosen < len(NUMBERS) else (self.below(256) - 100) / 32


class Importer:
    """One instance at a time, and its expected state."""

    def __init__(self, library: Path, token: bytes, variables: int, matrices: list[list[int]]) -> None:
        self.library, self.token, self.variables = ctypes.CDLL(str(library)), token, variables
        self.matrices = matrices  # references of the entries of D, K and its deviation; none without a plant
        self.two = hasattr(self.library, "fmi2DoStep")
        self.said: list[bytes] = []
        self._log = (
            Log2(lambda _environment, _name, _status, _category, text: self.said.append(text))
            if self.two
            else Log3(lambda _environment, _status, _category, text: self.said.append(text))
        )
        self._callbacks = Callbacks(log=self._log) if self.two else None
        self.instance: int | None = None
        self.logged = True
        self.saved: list[tuple[c_void_p, int, float]] = []  # states in its memory, and phase and time of each
        self.bytes: list[bytes] = []
        self.phase, self.time = MADE, 0.0

    def call(self, name: str, *values: Any) -> bool:
        """True if the call worked. A failure must have been explained, and so must a refused sample."""
        function = getattr(self.library, f"fmi{2 if self.two else 3}{name}")
        function.restype = c_int
        self.said.clear()
        status = function(c_void_p(self.instance), *values)
        assert status in (OK, ERROR) or (name, status) == ("DoStep", WARNING), (name, status)
        if self.logged:
            assert len(self.said) == (status != OK), (name, status, self.said)
            assert all(b"\n" not in sentence for sentence in self.said), (name, self.said)
        return bool(status != ERROR)

    def make(self, source: Bytes) -> None:
        self.end()
        wrong = source.below(8)
        token = {0: None, 1: b"{00000000-0000-0000-0000-000000000000}"}.get(wrong, self.token)
        self.logged = wrong != 2
        if self.two:
            self.library.fmi2Instantiate.restype = c_void_p
            callbacks = byref(self._callbacks) if self.logged else None
            name = None if wrong == 3 else b"fuzzed"
            made = self.library.fmi2Instantiate(c_char_p(name), c_int(1), c_char_p(token), None, callbacks, c_int(0), 0)
        else:
            self.library.fmi3InstantiateCoSimulation.restype = c_void_p
            log = self._log if self.logged else Log3()
            parts = (c_char_p(b"fuzzed"), c_char_p(token), None, *[ctypes.c_bool(False)] * 4, None, c_size_t(0))
            made = self.library.fmi3InstantiateCoSimulation(*parts, None, log, None)
        assert (made is not None) == (wrong > 1), wrong
        self.instance, self.phase, self.time = made, MADE, 0.0

    def end(self) -> None:
        version, states = (2, "FMUstate") if self.two else (3, "FMUState")
        for state, *_ in self.saved:
            getattr(self.library, f"fmi{version}Free{states}")(c_void_p(self.instance), byref(state))
        self.saved.clear()
        getattr(self.library, f"fmi{version}FreeInstance")(c_void_p(self.instance))  # also NULL
        self.instance = None

    def moved(self, worked: bool, may: bool, to: int) -> None:
        assert worked == may, (self.phase, to)
        self.phase = to if worked else self.phase

    def act(self, source: Bytes) -> None:
        if self.instance is None:
            self.make(source)
            return
        what = source.below(24)
        actions: list[Callable[[Bytes], None]] = [
            self.make,
            self.setup,
            self.initialize,
            self.exit,
            self.step,
            self.terminate,
            self.reset,
            self.get,
            self.set,
            self.save,
            self.load,
            self.forget,
            self.serialize,
            self.deserialize,
            self.ask_for_more,
        ]
        actions[what if what < len(actions) else [4, 7, 8, 13][what % 4]](source)

    def setup(self, source: Bytes) -> None:
        if self.two:
            time = source.number()
            worked = self.call("SetupExperiment", c_int(0), c_double(0), c_double(time), c_int(0), c_double(0))
            self.moved(worked, self.phase == MADE and abs(time) < float("inf"), self.phase)
            self.time = time if worked else self.time

    def initialize(self, source: Bytes) -> None:
        time, no = source.number() if source.below(4) == 0 else 0.0, ctypes.c_bool(False)
        extra = () if self.two else (no, c_double(0), c_double(time), no, c_double(0))
        may = self.phase == MADE and (self.two or abs(time) < float("inf"))
        self.moved(self.call("EnterInitializationMode", *extra), may, INITIALIZING)

    def exit(self, _: Bytes) -> None:
        may = self.phase == INITIALIZING and self.has_a_plant()
        self.moved(self.call("ExitInitializationMode"), may, RUNNING)

    def has_a_plant(self) -> bool:
        if not self.matrices:
            return True
        damping, stiffness, deviation = (self.matrix(references) for references in self.matrices)
        return _least(damping) >= 0 and _least(stiffness) > 0 and _least(stiffness + deviation) > 0

    def matrix(self, references: list[int]) -> np.ndarray:
        values, listed = (c_double * 3)(), (c_uint * 3)(*references)
        sizes = () if self.two else (c_size_t(3),)
        assert self.call(f"Get{'Real' if self.two else 'Float64'}", listed, c_size_t(3), values, *sizes)
        return np.array([[values[0], values[1]], [values[1], values[2]]])

    def step(self, source: Bytes) -> None:
        time, length = source.number(), source.number()
        if source.below(4):
            time, length = self.now(), STEP * (1 + source.below(20))
        if self.two:
            worked = self.call("DoStep", c_double(time), c_double(length), c_int(1))
        else:
            answers, reached = [ctypes.c_bool() for _ in range(3)], c_double()
            worked = self.call(
                "DoStep", c_double(time), c_double(length), ctypes.c_bool(True), *map(byref, answers), byref(reached)
            )
        assert self.phase == RUNNING or not worked
        self.time += length if worked else 0.0

    def now(self) -> float:
        if self.two:  # it has no variable for it
            return self.time
        value = c_double()
        self.call("GetFloat64", byref(c_uint(0)), c_size_t(1), byref(value), c_size_t(1))
        return value.value

    def terminate(self, _: Bytes) -> None:
        self.moved(self.call("Terminate"), self.phase in (INITIALIZING, RUNNING), TERMINATED)

    def reset(self, _: Bytes) -> None:
        self.moved(self.call("Reset"), True, MADE)
        self.time = 0.0

    def references(self, source: Bytes) -> tuple[Any, int]:
        count = source.below(6)
        chosen = [source.below(256) for _ in range(count)]
        listed = [c % (self.variables + 3) if c < 250 else 2**32 - 1 - c % 6 for c in chosen]
        return (c_uint * count)(*listed) if source.below(8) else None, count

    def get(self, source: Bytes) -> None:
        (listed, count), integer = self.references(source), source.below(4) == 0
        kind = ("Integer" if self.two else "Int32") if integer else ("Real" if self.two else "Float64")
        values = ((c_int if integer else c_double) * count)()
        sizes = () if self.two else (c_size_t(count if source.below(8) else source.below(99)),)
        self.call(f"Get{kind}", listed, c_size_t(count), values if source.below(8) else None, *sizes)

    def set(self, source: Bytes) -> None:
        (listed, count), integer = self.references(source), source.below(4) == 0
        kind = ("Integer" if self.two else "Int32") if integer else ("Real" if self.two else "Float64")
        numbers = [source.below(256) - 8 if integer else source.number() for _ in range(count)]
        values = ((c_int if integer else c_double) * count)(*numbers)
        sizes = () if self.two else (c_size_t(count if source.below(8) else source.below(99)),)
        worked = self.call(f"Set{kind}", listed, c_size_t(count), values if source.below(8) else None, *sizes)
        assert not worked or count == 0 or self.phase != TERMINATED

    @property
    def states(self) -> str:
        return "FMUstate" if self.two else "FMUState"

    def save(self, source: Bytes) -> None:
        state = self.saved.pop()[0] if self.saved and source.below(2) else c_void_p()
        assert self.call(f"Get{self.states}", byref(state))
        self.saved.append((state, self.phase, self.time))

    def load(self, source: Bytes) -> None:
        if not self.saved or source.below(8) == 0:
            assert not self.call(f"Set{self.states}", None)
            return
        state, phase, time = self.saved[source.below(len(self.saved))]
        assert self.call(f"Set{self.states}", state)
        self.phase, self.time = phase, time

    def forget(self, source: Bytes) -> None:
        state = self.saved.pop()[0] if self.saved and source.below(2) else c_void_p()
        assert self.call(f"Free{self.states}", byref(state))
        assert state.value is None
        assert self.call(f"Free{self.states}", None)

    def serialize(self, source: Bytes) -> None:
        if not self.saved:
            return
        state, size = self.saved[-1][0], c_size_t()
        assert self.call(f"Serialized{self.states}Size", state, byref(size))
        room = size.value if source.below(4) else source.below(256)
        written = (c_char * room)()
        worked = self.call(f"Serialize{self.states}", state, written, c_size_t(room))
        assert worked == (room >= size.value)
        if worked:
            self.bytes.append(written.raw[: size.value])

    def deserialize(self, source: Bytes) -> None:
        if not self.bytes:
            return
        seed = source.below(256) * 256 + source.below(256)
        attempt = self.bytes[-1]
        if source.below(4):
            attempt = payload(random.Random(f"{seed} 0"), TOKEN, self.bytes[-3:], self.bytes[:2])
        state = c_void_p()
        name = "DeSerializeFMUstate" if self.two else "DeserializeFMUState"
        worked = self.call(name, attempt, c_size_t(len(attempt)), byref(state))
        assert worked or state.value is None
        assert worked or attempt not in self.bytes, "what was saved was refused"
        if worked:
            phase = int.from_bytes(attempt[TOKEN + 4 : TOKEN + 8], "little")  # its first number
            self.saved.append((state, phase, self.time))

    def ask_for_more(self, source: Bytes) -> None:
        count = c_size_t(source.below(2))
        if self.two:
            assert self.call("GetString", None, count, None) == (count.value == 0)
            assert not self.call("CancelStep")
        else:
            assert not self.call("EnterEventMode")
            assert not self.call("GetString", None, count, None, count)


@cache
def importer(face: str) -> Importer:
    """Importer with the library and the data of its model description."""
    fmi, content, device = FACES[face]
    folder = Path(tempfile.mkdtemp())
    changes = {"run.duration": 2.0, "adaptation.kind": "composite", "controller.switching_limit": 0.5}
    fg.export.fmu(fg.Scenario.paper().replace({**changes, **device}), folder / "made.fmu", fmi=fmi, content=content)
    unpacked = Path(fmpy.extract(str(folder / "made.fmu"), str(folder / "made")))
    (library,) = unpacked.glob("binaries/*/*.so")
    description = fmpy.read_model_description(str(unpacked))
    token = description.guid if fmi == "2.0" else description.instantiationToken
    references = {variable.name: int(variable.valueReference) for variable in description.modelVariables}
    names = ("damping", "stiffness", "stiffness_deviation") if content == "loop" else ()
    matrices = [[references[f"plant.{name}.{entry}"] for entry in ("xx", "xy", "yy")] for name in names]
    return Importer(library, token.encode(), len(references), matrices)


def _least(matrix: np.ndarray) -> float:
    """The smallest eigenvalue over the largest entry; zero if it differs only by rounding."""
    largest = float(np.abs(matrix).max())
    if largest == 0 or largest == np.inf:
        return 0.0 if largest == 0 else -1.0
    least = float(np.linalg.eigvalsh(matrix / largest)[0])
    return 0.0 if abs(least) <= 1e-12 else least


def make(rng: random.Random) -> bytes:
    return rng.randbytes(300)


def check(face: str, case: bytes, _: Path) -> str:
    trying = importer(face)
    trying.end()  # left by a failed input
    trying.bytes.clear()
    source = Bytes(case)
    while source:
        trying.act(source)
    trying.end()
    return "worked"


if __name__ == "__main__":
    harness.main(
        {
            face: harness.Face(make, partial(check, face), partial(importer, face), resource.RLIM_INFINITY)
            for face in FACES
        }
    )
