"""Exponentials, times and certified errors of the kernel design; writes benchmarks/results/kernel_design.md."""

from __future__ import annotations

import statistics
import time

import mpmath
import numpy as np
from fracgyro.fractional import ExponentialSum, design
from fracgyro.fractional.kernel import _designed
from machine import command, machine, on_one_core, write

DEPENDS_ON = ["core", "include/fracgyro/core/kernel_design.hpp"]

MINIMAX = {0.1: (8, 17, 26), 0.5: (11, 20, 29), 0.9: (12, 22, 31)}  # minimax counts on [1e-3, 100]
TOLERANCES = (1e-3, 1e-6, 1e-9)
DRAWN, CHECKED = 1000, 60  # designs; those compared with 40 digits
MAX_WIDTH = 1e6
LONGEST = [(order, 1e9, 1e-9) for order in (0.1, 0.5, 0.9, 0.999)]  # the longest runs at the smallest tolerance


def timed(order: float, ratio: float, tolerance: float, repeats: int = 1) -> tuple[ExponentialSum, float]:
    """The design, and the milliseconds of processor time it took: the median of `repeats`."""
    seconds = []
    for _ in range(repeats):
        _designed.cache_clear()
        start = time.process_time()
        kernel = design(order, 1e-3, 1e-3 * ratio, tolerance)
        seconds.append(time.process_time() - start)
    return kernel, 1e3 * statistics.median(seconds)


def true_error(kernel: ExponentialSum) -> float:
    """Error in 40 digits, at both ends and at the highest peaks found in double precision."""
    grid = np.geomspace(kernel.shortest, kernel.longest, 4001)
    seen = np.exp(-np.outer(grid, kernel.poles)) @ kernel.weights * grid**kernel.order
    worst = grid[np.argsort(np.abs(seen * float(mpmath.gamma(1 - kernel.order)) - 1))[-20:]]
    pairs = [
        (mpmath.mpf(s), mpmath.mpf(w)) for s, w in zip(kernel.poles.tolist(), kernel.weights.tolist(), strict=True)
    ]
    scale, order = mpmath.gamma(1 - mpmath.mpf(kernel.order)), mpmath.mpf(kernel.order)
    times = [mpmath.mpf(t) for t in (kernel.shortest, kernel.longest, *worst.tolist())]
    return float(max(abs(mpmath.fsum(w * mpmath.exp(-s * t) for s, w in pairs) * scale * t**order - 1) for t in times))


def main() -> None:
    on_one_core()
    mpmath.mp.dps = 40
    lines = [
        "# The kernel design",
        "",
        f"Made by `{command()}`.",
        "",
        f"Machine: {machine()}.",
        "",
        "On [1e-3, 100]: how many exponentials, and how many minimax sets have; certified error; processor time,",
        "median of 9.",
        "",
        "| α | tolerance | exponentials | minimax | certified error | time |",
        "|---|---|---|---|---|---|",
    ]
    for order, least in MINIMAX.items():
        for tolerance, count in zip(TOLERANCES, least, strict=True):
            kernel, took = timed(order, 1e5, tolerance, 9)
            lines.append(
                f"| {order:g} | {tolerance:.0e} | {kernel.count} | {count} | {kernel.error:.2e} | {took:.1f} ms |"
            )
    lines += ["", "For 1e9 steps at the smallest tolerance of a scenario; the core has room for 64 exponentials.", ""]
    lines += ["| α | exponentials | certified error | time |", "|---|---|---|---|"]
    for order, ratio, tolerance in LONGEST:
        kernel, took = timed(order, ratio, tolerance, 3)
        lines.append(f"| {order:g} | {kernel.count} | {kernel.error:.2e} | {took:.0f} ms |")

    random = np.random.default_rng(0)
    took, bounds, errors = [], [], []
    for i in range(DRAWN):
        # A tenth of the orders within 1e-12 to 1e-2 of 0, another of 1.
        order, near = float(random.uniform(0.0, 1.0)), float(10 ** random.uniform(-12, -2))
        order = near if i % 10 == 0 else 1.0 - near if i % 10 == 1 else order
        ratio, tolerance = float(1 + MAX_WIDTH ** random.uniform(0, 1)), float(10 ** random.uniform(-11, -1))
        kernel, ms = timed(order, ratio, tolerance)
        took.append(ms)
        assert kernel.error <= tolerance
        assert min(kernel.poles.min(), kernel.weights.min()) > 0
        if i < CHECKED:
            bounds.append(kernel.error)
            errors.append(true_error(kernel))
    shares = [e / b for e, b in zip(errors, bounds, strict=True)]
    rare = np.quantile(took, 0.95)
    lines += [
        "",
        f"{DRAWN} designs drawn at random, orders in (0, 1) and near its ends, ranges to {MAX_WIDTH:.0e}, tolerances",
        f"1e-11 to 1e-1: median {statistics.median(took):.1f} ms, 95 % below {rare:.0f} ms,",
        f"at most {max(took):.0f} ms.",
        "All are certified within the tolerance, all rates and weights positive. Of",
        f"{CHECKED} of them the true error, in 40 digits, is at most {max(shares):.3f} of the certified one,",
        f"in the median {statistics.median(shares):.3f}.",
    ]
    write("kernel_design", lines)


if __name__ == "__main__":
    main()
