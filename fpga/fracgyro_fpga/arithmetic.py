"""Number types of exported hardware, float and fixed point: their arithmetic in Python, bit by bit, and their units.

A value is an np.float32, or the integer that is a fixed number times 2^28. A word is its representation at the ports:
the bits of the float, or of that integer.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from math import isqrt
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

HardwareNumber = Literal["float", "fixed"]
Value = Any

ONE_OF_32 = 0xFFFFFFFF
MANTISSA = 23  # bits of a float's fraction
BIAS = 129  # excess of the internal exponent of a normal float over its own
ORIGIN = 0x3F3504F3  # sqrt(1/2), as float32
FRACTION, MOST, BEYOND = 28, 2**47 - 1, 2.0**19  # equal to HardwareFixed in cpp/fixed.hpp


class Arithmetic(ABC):
    """A number type. `stages`: of each unit in `units`; except for sums and products they end with that of choose."""

    number: ClassVar[HardwareNumber]
    units: ClassVar[str]  # a file of verilog/, whose modules begin with `prefix`
    prefix: ClassVar[str]
    word: ClassVar[int]  # bits of a word at the ports
    inside: ClassVar[int]  # bits inside: a sign and a magnitude
    stages: ClassVar[Mapping[str, int]]
    busy: ClassVar[Mapping[str, int]]  # cycles until a unit that computes digit by digit begins again
    dividers: ClassVar[int]  # number of units that compute quotients
    from_integer: ClassVar[int]  # stages
    fraction: ClassVar[int]  # bits of a word after the point; 0: floating point
    rows: ClassVar[np.dtype[Any]]  # row type of the files of testbench.cpp

    @abstractmethod
    def of_bits(self, bits: int) -> Value:
        """A constant in the format of the tracer."""

    @abstractmethod
    def encoded(self, bits: int) -> int:
        """The constant in the internal format."""

    @abstractmethod
    def values(self, numbers: NDArray[np.floating]) -> list[Value]:
        """The nearest values."""

    @abstractmethod
    def words(self, numbers: NDArray[np.floating]) -> NDArray[Any]:
        """Words in the format that testbench.cpp reads. Without a NaN in the format, NaN becomes the last number."""

    @abstractmethod
    def numbers(self, words: NDArray[Any]) -> NDArray[np.floating]:
        """Exact values of words."""

    @abstractmethod
    def of_phase(self, part: int, value: int) -> Value:
        """A part of a phase (graph.Input)."""

    @abstractmethod
    def whole(self, part: int, text: str) -> str:
        """The same in Verilog, for the unit from_integer."""

    @abstractmethod
    def compute(self, op: str, a: Value, *others: Value) -> Value:
        """One operation of the graph."""

    def stages_of(self, op: str) -> int:
        return self.stages.get(op, self.stages["select"])


class Float(Arithmetic):
    number, units, prefix = "float", "units.v", "fp"
    word, inside = 32, 33
    stages: ClassVar = {"add": 5, "multiply": 4, "divide": 13, "square_root": 17, "exponent": 4, "select": 1}
    busy: ClassVar = {"divide": 10, "square_root": 14}
    dividers, from_integer, fraction = 1, 4, 0
    rows = np.dtype("<f4")

    def of_bits(self, bits: int) -> np.float32:
        return np.float32(np.array([bits], np.uint32).view(np.float32)[0])

    def encoded(self, bits: int) -> int:
        sign, exponent, fraction = bits >> 31, bits >> 23 & 0xFF, bits & 0x7FFFFF
        if exponent == 255:
            return (0 if fraction else sign << 32) | 511 << 23 | (1 << 22 if fraction else 0)
        if exponent == 0:
            if not fraction:
                return sign << 32
            shift = 24 - fraction.bit_length()
            return sign << 32 | (BIAS + 1 - shift) << 23 | (fraction << shift & 0x7FFFFF)
        return sign << 32 | (exponent + BIAS) << 23 | fraction

    def values(self, numbers: NDArray[np.floating]) -> list[Value]:
        return list(self.words(numbers))

    def words(self, numbers: NDArray[np.floating]) -> NDArray[np.float32]:
        return numbers.astype(np.float32)

    def numbers(self, words: NDArray[Any]) -> NDArray[np.floating]:
        return words

    def of_phase(self, part: int, value: int) -> np.float32:
        return np.float32(value)

    def whole(self, part: int, text: str) -> str:
        return text if part == 0 else f"{{31'd0, {text}}}"

    def compute(self, op: str, a: np.float32, *others: np.float32) -> np.float32:
        match op:
            case "square_root":
                return np.float32(np.sqrt(a))
            case "exponent":
                return np.float32((_bits(a) - ORIGIN) >> MANTISSA)
            case "mantissa":
                return self.of_bits(((_bits(a) - ORIGIN) & ((1 << MANTISSA) - 1)) + ORIGIN)
        b, *chosen = others
        match op:
            case "add":
                return np.float32(a + b)
            case "multiply":
                return np.float32(a * b)
            case "divide":
                return np.float32(a / b)
            case "select":
                return chosen[0] if a < b else chosen[1]
            case "copy_sign":
                return np.float32(np.copysign(b, a))
            case "scale":
                return self.of_bits((_bits(a) + (_bits(b) << MANTISSA)) & ONE_OF_32)
        return np.float32(a < b)


class Fixed(Arithmetic):
    """The same numbers as HardwareFixed in cpp/fixed.hpp."""

    number, units, prefix = "fixed", "fixed_units.v", "fx"
    word, inside = 48, 48
    stages: ClassVar = {"add": 1, "multiply": 3, "divide": 18, "square_root": 21, "select": 1}
    busy: ClassVar = {"divide": 17, "square_root": 20}
    dividers, from_integer, fraction = 2, 1, FRACTION
    rows = np.dtype("<i8")

    def of_bits(self, bits: int) -> int:
        return bits

    def encoded(self, bits: int) -> int:
        return (1 << 47 if bits < 0 else 0) | abs(bits)

    def values(self, numbers: NDArray[np.floating]) -> list[Value]:
        found: list[Value] = self.words(numbers).tolist()
        return found

    def words(self, numbers: NDArray[np.floating]) -> NDArray[np.int64]:
        within = np.clip(np.nan_to_num(numbers.astype(np.float64), nan=BEYOND), -BEYOND, BEYOND) * 2.0**FRACTION
        nearest = np.copysign(np.minimum(np.floor(np.abs(within) + 0.5), MOST), within)
        return nearest.astype(np.int64)

    def numbers(self, words: NDArray[Any]) -> NDArray[np.floating]:
        return words * 2.0**-FRACTION

    def of_phase(self, part: int, value: int) -> int:
        return value if part == 0 else value << FRACTION

    def whole(self, part: int, text: str) -> str:
        return f"{{{{16{{{text}[31]}}}}, {text}}}" if part == 0 else f"{{19'd0, {text}, 28'd0}}"

    def compute(self, op: str, a: int, *others: int) -> int:
        if op == "square_root":
            return isqrt(max(a, 0) << FRACTION)
        b, *chosen = others
        sign = -1 if (a < 0) != (b < 0) else 1
        match op:
            case "add":
                return max(-MOST, min(MOST, a + b))
            case "multiply":
                return sign * min(MOST, (abs(a * b) + (1 << (FRACTION - 1))) >> FRACTION)
            case "divide":
                return sign * min(MOST, (abs(a) << FRACTION) // abs(b) if b else MOST)
            case "select":
                return chosen[0] if a < b else chosen[1]
            case "copy_sign":
                return -abs(b) if a < 0 else abs(b)
        return int(a < b)


def _bits(value: np.float32) -> int:
    return int(np.array([value], np.float32).view(np.uint32)[0])


ARITHMETICS: dict[HardwareNumber, Arithmetic] = {"float": Float(), "fixed": Fixed()}
