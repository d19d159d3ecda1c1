"""Export of a sampled fractional operator or PID as one C99 file and its header, for a microcontroller."""

from __future__ import annotations

import os
import re
from importlib.metadata import version

import numpy as np

from .. import _core
from ..arguments import short
from ..files import whole_folder
from ..fractional import Sampled
from .compilers import SOURCES, Number

STANDARD_HEADERS = {
    "assert", "complex", "ctype", "errno", "fenv", "float", "inttypes", "iso646", "limits", "locale", "math", "setjmp",
    "signal", "stdarg", "stdbool", "stddef", "stdint", "stdio", "stdlib", "string", "tgmath", "time", "wchar", "wctype",
}  # fmt: skip
SUFFIX: dict[Number, str] = {"float": "F", "double": ""}


def operator(
    sampled: Sampled,
    folder: str | os.PathLike[str],
    number: Number = "float",
    *,
    name: str = "operator",
    meaning: str = "",
) -> None:
    """Writes a sampled operator as NAME.c and NAME.h into `folder`: C99 without heap and libm.

    `sampled`: from `fg.fractional.pid` or `ExponentialSum.sampled`. `number`: number type, "float" or "double"; without
    contraction of products and sums the bits equal those of `Sampled.run`. `meaning`: description in the header's
    comment. The folder is complete or absent. Raises TypeError if `sampled` is not Sampled, ValueError for an invalid
    name or number type, a weight that exceeds the number type, and a folder that cannot be written.

    >>> half = fg.fractional.design(0.5, shortest=1e-3, longest=10.0, tolerance=1e-6).sampled(1e-3, derivative=True)
    >>> fg.export.operator(half, "half", name="half_derivative", meaning="Caputo derivative of order 0.5")
    """
    if not isinstance(sampled, Sampled):
        raise TypeError(f"sampled is {short(sampled)}: it must be Sampled, for example from fg.fractional.pid")
    if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z]\w{0,30}", name, re.ASCII):
        raise ValueError(
            f"name is {short(name)}: it must be a letter followed by at most 30 letters, digits and underscores"
        )
    if name.lower() in STANDARD_HEADERS:
        raise ValueError(f"name is {name!r}: it must not be the name of a standard C header")
    if number not in SUFFIX:
        raise ValueError(f"number is {short(number)}: it must be float or double")
    _check_range(sampled, number)
    with whole_folder(folder) as scratch:
        for suffix, text in (("h", _header(sampled, number, name, meaning)), ("c", _source(sampled, number, name))):
            (scratch / f"{name}.{suffix}").write_text(text, encoding="utf-8", newline="\n")


def _check_range(sampled: Sampled, number: Number) -> None:
    """Raises ValueError if a weight exceeds the number type; a negligible weight may underflow."""
    gains = [sampled.now, sampled.past, sampled.change, sampled.past_change]
    weights = np.concatenate([gains, sampled.of_values[:, 1], sampled.of_changes[:, 1]])
    with np.errstate(over="ignore", under="ignore"):
        held = weights.astype(_dtype(number))
    wrong = ~np.isfinite(held) | ((held == 0) & (abs(weights) > 1e-9 * abs(weights).max()))
    if wrong.any():
        raise ValueError(f"a weight of the operator is {weights[wrong][0]:.3g}: it must fit {number}; scale the gains")


def _header(sampled: Sampled, number: Number, name: str, meaning: str) -> str:
    guard = f"{name.upper()}_H"
    size = (sampled.count + 2) * np.dtype(_dtype(number)).itemsize
    return f"""\
/* {_comment(meaning or "A linear system")}.

   Made by `fracgyro export operator` of fracgyro {version("fracgyro")}, for one sample every {sampled.interval:.9g}.
   The signal is assumed to be 0 up to one interval before the first sample.
   A sample that is not finite remains in the state until {name}_reset. */
#ifndef {guard}
#define {guard}

#ifdef __cplusplus
extern "C" {{
#endif

/* {size} bytes. */
typedef struct {{
    {number} memory[{max(sampled.count, 1)}];
    {number} past, past_change;
}} {name}_state;

/* Resets the state. Call it before the first step. */
void {name}_reset({name}_state* state);

/* Returns the output at the next sample. */
{number} {name}_step({name}_state* state, {number} sample);

#ifdef __cplusplus
}}
#endif

#endif
"""


def _source(sampled: Sampled, number: Number, name: str) -> str:
    terms = np.concatenate([sampled.of_values, sampled.of_changes])
    trace = _core.trace_single if number == "float" else _core.trace
    numbers = (sampled.now, sampled.past, sampled.change, sampled.past_change, trace)
    gains = [_literal(value, number) for value in numbers]
    counts = f"{len(sampled.of_values)}, {len(sampled.of_changes)}"
    pairs = terms.tolist() or [(0.0, 0.0)]  # C has no empty array
    rows = [f"    {{{_literal(decay, number)}, {_literal(weight, number)}}},\n" for decay, weight in pairs]
    step = (SOURCES / "include/fracgyro/core/sampled_step.h").read_text(encoding="utf-8")
    return f"""\
/* Compile without contraction of products and sums (-ffp-contract=off, or -std=c99 with gcc) for the same bits on every
   processor. With contraction it is equally accurate, and faster on processors with fused multiply-add. */
#include "{name}.h"

typedef {number} fracgyro_number;

{step}
static const fracgyro_term terms[{len(rows)}] = {{
{"".join(rows)}}};
static const fracgyro_gains gains = {{{counts}, {", ".join(gains)}}};

void {name}_reset({name}_state* state) {{
    for (int j = 0; j < {len(rows)}; ++j) {{
        state->memory[j] = 0;
    }}
    state->past = state->past_change = 0;
}}

{number} {name}_step({name}_state* state, {number} sample) {{
    fracgyro_past past = {{state->past, state->past_change}};
    const {number} output = fracgyro_step_sample(&gains, terms, state->memory, &past, sample);
    state->past = past.sample;
    state->past_change = past.change;
    return output;
}}
"""


def _dtype(number: Number) -> type[np.floating]:
    return np.float32 if number == "float" else np.float64


def _literal(value: float, number: Number) -> str:
    """Exact hexadecimal literal of C99; zero without a sign."""
    digits, exponent = float(_dtype(number)(value) + 0.0).hex().split("p")
    return f"{digits.rstrip('0').rstrip('.')}p{exponent}{SUFFIX[number]}"


def _comment(words: str) -> str:
    """Text for a C comment: one line, without the end marker."""
    return " ".join(words.replace("*/", "* /").split())
