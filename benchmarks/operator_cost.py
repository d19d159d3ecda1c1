"""Error of a fractional derivative against its cost, here and by other formulas that run sample by sample.

Writes benchmarks/results/operator_cost.md and docs/operators.svg. Counts instructions on emulated Cortex-M, so it needs
what `make setup-embedded` installs.
"""

from __future__ import annotations

import math
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import fracgyro as fg
import numpy as np
from fracgyro.analysis.style import own_style, save_svg
from fracgyro.export.compilers import run
from fracgyro.fractional import Sampled, design
from fracgyro.fractional.sampled import Between
from machine import command, machine, write
from matplotlib.figure import Figure
from numpy.typing import NDArray
from operator_accuracy import exponential
from scipy.signal import lfilter

MEASURES_CODE = True
ROOT = Path(__file__).resolve().parents[1]
PICTURE = ROOT / "docs/operators.svg"
ORDER, STEP, SAMPLES, LONGEST = 0.9, 1e-3, 80_000, 80.0
FROM = 0.1  # time from which errors count: methods of first order are worst at the start
BAND = (0.1, 100.0)  # rad per unit of time
Vector = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Method:
    """One that computes y from samples of u in fixed memory."""

    family: str
    words: str  # the difference from other methods of the family
    flops: int  # multiplications and additions a sample
    numbers: int  # size of its memory
    output: Vector  # for the samples of `record`
    response: Vector | None  # over (j w)^ORDER, at FREQUENCY; None where rates are given


LOWEST, HIGHEST = (1e-3, 1.0 / LONGEST, 0.05), (1e3, math.pi / STEP, 1e4, 1e5, 1e6)  # bands of Oustaloup's filter

FREQUENCY = np.geomspace(*BAND, 400)


def record() -> tuple[Vector, Vector]:
    """u(t) = exp(-t/2) sin(πt) - 0.3 cos(πt/2) + 0.3, which is 0 at t = 0, and its rate."""
    t = STEP * np.arange(SAMPLES)
    decay, fast, slow = np.exp(-0.5 * t), np.pi * t, 0.5 * np.pi * t
    values = decay * np.sin(fast) - 0.3 * np.cos(slow) + 0.3
    return values, decay * (np.pi * np.cos(fast) - 0.5 * np.sin(fast)) + 0.15 * np.pi * np.sin(slow)


def relative(response: Vector) -> Vector:
    return abs(response / (1j * FREQUENCY) ** ORDER - 1.0)


def of_values(values: Vector, tolerance: float, between: Between) -> Method:
    sampled = derivative(tolerance, between)
    return Method(
        f"fracgyro, {between}",
        f"{sampled.count} exponentials",
        5 * sampled.count + 10,
        sampled.count + 2,
        sampled.run(values),
        relative(sampled.frequency_response(FREQUENCY)),
    )


def derivative(tolerance: float, between: Between = "lines") -> Sampled:
    return design(ORDER, STEP, LONGEST, tolerance).sampled(STEP, derivative=True, between=between)


def of_values_and_rates(values: Vector, rates: Vector, tolerance: float) -> Method:
    count = design(ORDER, STEP, LONGEST, tolerance).count
    found = fg.fractional.caputo(values, rates, STEP, ORDER, tolerance=tolerance)
    # For each exponential: decay·g, bump·κ, + rate, + g, + g; weight·g, + sum. Once: κ, differences, their weights.
    return Method("fracgyro, values and rates", f"{count} exponentials", 7 * count + 20, count + 5, found, None)


def grunwald_letnikov(values: Vector, taps: int) -> Method:
    """The first `taps` weights of (1 - 1/z)^ORDER: short memory."""
    weights = np.cumprod(np.append(1.0, 1.0 - (1.0 + ORDER) / np.arange(1, taps))) / STEP**ORDER
    length = 2 ** math.ceil(math.log2(SAMPLES + taps))
    found = np.fft.irfft(np.fft.rfft(values, length) * np.fft.rfft(weights, length), length)[:SAMPLES]
    shifted = np.exp(-1j * STEP * np.outer(FREQUENCY, np.arange(taps)))
    response = relative(shifted @ weights)
    return Method("Grünwald-Letnikov, short memory", f"{taps:,} samples", 2 * taps, taps, found, response)


def oustaloup(values: Vector, sections: int, band: tuple[float, float], name: str) -> Method:
    """Oustaloup's recursive filter for s^ORDER on a band, each section sampled by Tustin's rule."""
    low, high = band
    place = (np.arange(sections) + 0.5) / sections
    zeros = low * (high / low) ** (place - ORDER / (2 * sections))
    poles = low * (high / low) ** (place + ORDER / (2 * sections))
    z = np.exp(1j * STEP * FREQUENCY)
    s = 2.0 / STEP * (z - 1.0) / (z + 1.0)
    found, response = high**ORDER * values, np.full(len(s), high**ORDER + 0j)
    for zero, pole in zip(zeros, poles, strict=True):
        h = STEP / 2.0
        found = lfilter([1.0 + h * zero, h * zero - 1.0], [1.0 + h * pole, h * pole - 1.0], found)
        response = response * (s + zero) / (s + pole)
    return Method(name, f"{sections} sections", 4 * sections + 2, sections, found, relative(response))


def tried_bands(values: Vector, chosen: NDArray[np.intp], exact: Vector) -> list[str]:
    """Error of Oustaloup's filter with 15 sections, by band."""
    rows = [f"| lowest | {' | '.join(f'to {high:,.0f}' for high in HIGHEST)} |", "|---:" * (1 + len(HIGHEST)) + "|"]
    for low in LOWEST:
        errors = (abs(oustaloup(values, 15, (low, high), "").output[chosen] - exact).max() for high in HIGHEST)
        rows.append(f"| {low:g} | {' | '.join(f'{error:.1e}' for error in errors)} |")
    return rows


def methods() -> list[Method]:
    values, rates = record()
    return [
        *(of_values(values, tolerance, "lines") for tolerance in (1e-1, 1e-2, 1e-3, 1e-4, 1e-6)),
        *(of_values(values, tolerance, "parabolas") for tolerance in (1e-1, 1e-2, 1e-3, 1e-4, 1e-6)),
        *(of_values_and_rates(values, rates, tolerance) for tolerance in (1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8)),
        *(oustaloup(values, n, (1e-3, 1e3), "Oustaloup, 0.001 to 1000") for n in (5, 7, 11, 15, 21)),
        *(oustaloup(values, n, (1e-3, 1e4), "Oustaloup, 0.001 to 10,000") for n in (5, 7, 11, 15, 21)),
        *(grunwald_letnikov(values, taps) for taps in (10, 100, 1_000, 10_000, 80_000)),
    ]


STYLES = {
    "fracgyro, lines": ("#0072B2", "o"),
    "fracgyro, parabolas": ("#000000", "D"),
    "fracgyro, values and rates": ("#56B4E9", "s"),
    "Oustaloup, 0.001 to 1000": ("#D55E00", "v"),
    "Oustaloup, 0.001 to 10,000": ("#E69F00", "^"),
    "Grünwald-Letnikov, short memory": ("#009E73", "x"),
}
SHOWN = {"20 exponentials", "21 exponentials", "11 sections", "1,000 samples"}  # by frequency


def draw(found: list[Method], errors: dict[Method, float]) -> None:
    with own_style():
        figure = Figure(figsize=(7.0, 3.4), layout="constrained")
        cost, frequency = figure.subplots(1, 2)
        for family, (color, marker) in STYLES.items():
            some = [m for m in found if m.family == family]
            cost.loglog([m.flops for m in some], [errors[m] for m in some], marker=marker, color=color, label=family)
            for m in some:
                if m.response is not None and m.words in SHOWN:
                    frequency.loglog(FREQUENCY, m.response, color=color)
        cost.set(xlabel="multiplications and additions a sample", ylabel="largest error", title="A signal")
        frequency.set(xlabel="angular frequency", ylabel="relative error", title="A sine that lasts")
        for panel in (cost, frequency):
            panel.grid(True, linewidth=0.3)
            panel.spines[["top", "right"]].set_visible(False)
        cost.set_xlim(15.0, 3e3)  # the table has the points beyond
        figure.legend(loc="outside lower center", ncols=3)
        frequency.set_ylim(1e-8, 1.0)
        save_svg(figure, PICTURE, "Errors of fractional derivatives")


def jumps() -> list[str]:
    """Response of lines and parabolas to a step and to noise."""
    both = [derivative(1e-6, between) for between in get_args(Between)]
    first = [", ".join(f"{y:.0f}" for y in sampled.run(np.ones(3))) for sampled in both]
    noise = np.random.default_rng(0).normal(size=50_000)
    lines, parabolas = (float(sampled.run(noise).std()) for sampled in both)
    return [
        f"Of a unit step lines make {first[0]}, …, and parabolas {first[1]}, …; of white noise parabolas make "
        f"{parabolas / lines:.2f} times as much as lines (standard deviation of {len(noise):,} samples)."
    ]


def instructions() -> list[str]:
    """Rows of a table: what a step of the exported C takes."""
    sys.path.insert(0, str(ROOT / "tests/python"))
    from operator_c import built

    rows = []
    for tolerance in (2e-2, 5e-5, 1e-6):
        sampled = derivative(tolerance)
        cells = [str(sampled.count)]
        for target, number in (("m4f", "float"), ("m7", "float"), ("m7", "double")):
            for flags in (("-O2",), ("-O3", "-ffp-contract=fast")):
                with tempfile.TemporaryDirectory() as folder:
                    place = Path(folder) / "c"
                    cells.append(run(built(sampled, number, place, target, "count", *flags), place).strip())
        rows.append(f"| {' | '.join(cells)} |")
    return rows


def main() -> None:
    t = STEP * np.arange(SAMPLES)
    chosen = np.unique(np.linspace(round(FROM / STEP), SAMPLES - 1, 300).astype(int))
    fast, slow = exponential(complex(-0.5, np.pi), t[chosen]), exponential(complex(0, 0.5 * np.pi), t[chosen])
    exact = fast.imag - 0.3 * slow.real
    found = methods()
    errors = {m: float(abs(m.output[chosen] - exact).max()) for m in found}
    draw(found, errors)
    compiler = run(["arm-none-eabi-gcc", "--version"]).splitlines()[0]
    emulator = run(["qemu-system-arm", "--version"]).splitlines()[0]
    low, high = BAND
    lines = [
        "# Fractional derivatives in fixed memory: error and cost",
        "",
        f"Made by `{command()}`.",
        "",
        f"Machine: {machine('scipy')}; {compiler}; {emulator}.",
        "",
        f"Derivative of order {ORDER:g}, samples {STEP:g} apart. A signal: exp(-t/2) sin(πt) - 0.3 cos(πt/2) + 0.3, "
        f"{SAMPLES:,} samples, largest error from t = {FROM:g} on against the closed form in 30 digits; the derivative "
        f"reaches {abs(exact).max():.2g}. A sine that lasts: largest relative error of the frequency response from "
        f"{low:g} to {high:g} rad per unit of time. Flops: multiplications and additions a sample; numbers: what is "
        "remembered.",
        "",
        "| method | | flops | numbers | error, signal | error, sine |",
        "|---|---|---:|---:|---:|---:|",
        *(
            f"| {m.family} | {m.words} | {m.flops:,} | {m.numbers:,} | {errors[m]:.1e} | "
            f"{'–' if m.response is None else f'{m.response.max():.1e}'} |"
            for m in found
        ),
        "",
        "Lines and parabolas: what the signal is taken for between samples. Oustaloup's filter is sampled by Tustin's "
        "rule, section by section; its second band is the best of those below. With rates, a "
        "frequency response of values only does not exist.",
        "",
        *jumps(),
        "",
        "## The band of Oustaloup's filter",
        "",
        "Error of the signal with 15 sections, from the lowest to the highest frequency:",
        "",
        *tried_bands(record()[0], chosen, exact),
        "",
        "## The exported C on Cortex-M",
        "",
        "Instructions of a step with its call, under QEMU: `-O2` without contraction of products and sums, which has "
        "the bits of Python, and `-O3 -ffp-contract=fast`. A Cortex-M4F computes doubles in software.",
        "",
        "| exponentials | M4F, float | … contracted | M7, float | … contracted | M7, double | … contracted |",
        "|---:|---:|---:|---:|---:|---:|---:|",
        *instructions(),
    ]
    write("operator_cost", lines)


if __name__ == "__main__":
    main()
