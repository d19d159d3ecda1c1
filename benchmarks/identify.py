"""Errors and intervals of `fg.identify` over many simulated records, against the Cramér-Rao bound.

Writes benchmarks/results/identify.md.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
from machine import command, machine, on_one_core, write

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests/python"))

DEPENDS_ON = ["python/fracgyro/identification/entry.py", "tests/python/bench_records.py"]

SEEDS = int(sys.argv[1]) if len(sys.argv) > 1 else 500
MILLION = 1_000_000


def main() -> None:
    on_one_core()
    import bench_records as bench
    import fracgyro as fg
    from fracgyro.identification.diagnostics import Test, tests, whiteness
    from fracgyro.identification.first_stage import fit_segments
    from fracgyro.identification.records import Response, State, of_arrays
    from fracgyro.identification.structure import invariants, invariants_by
    from fracgyro.identification.sweep import fit_sweep, sweep_tests

    def in_units(unit: float, omega: float, count: int) -> np.ndarray:
        turn = unit / omega
        return np.array([turn**2] * 4 + [turn] * 4 + [turn**2] * 4)[:count]

    def row(errors: list[np.ndarray], squares: list[float], alarms: int, seconds: float) -> str:
        ratio = np.sqrt(np.mean(np.square(errors), axis=0))
        covered = np.mean(np.abs(errors) < 1.96)
        count = errors[0].size
        good.append((alarms, len(errors)))
        return (
            f"{len(errors)} | {ratio.min():.2f} to {ratio.max():.2f} | {covered:.3f} | "
            f"{np.mean(squares) / count:.2f} | {max(squares) / count:.1f} | {alarms} | {seconds:.2f} |"
        )

    def failed(found: list[Test]) -> bool:
        return any(each.verdict == "fail" for each in found)

    good: list[tuple[int, int]] = []
    lines = [
        "# Identification",
        "",
        f"Made by `{command()}`. Machine: {machine('scipy')}.",
        "",
        "Simulated records. Noise: deviation of a sample over the amplitude; of sweeps, of real and "
        "imaginary part over the peak of the same pick-off. Thermal motion: its root of the mean square over the "
        "amplitude. Sweeps: over the invariants that the second stage uses. The interval of each number is that of the "
        "covariance of the first stage, which is the Cramér-Rao bound for the estimated noise. Alarms: records, all "
        "good, in which a test of whiteness fails. Forced: random forces in both drives, one sample late, with "
        "feedthrough; 12 numbers.",
        "",
        "| record | samples | noise | records | RMS error over the deviation, 8 numbers | in the interval | squared "
        "error over expected | largest | alarms | seconds |",
        "|---" * 10 + "|",
    ]
    cases = [
        ("dual mass", bench.DUAL_MASS, 50_000, 1e-3, 0.0),
        ("dual mass", bench.DUAL_MASS, 50_000, 5e-2, 0.0),
        ("disc", bench.DISC, 100_000, 1e-3, 0.0),
        ("disc", bench.DISC, 100_000, 1e-5, 0.0),
        ("paper", bench.PAPER, 20_000, 1e-3, 0.0),
        ("in air", bench.IN_AIR, 4000, 1e-3, 0.0),
        ("in air", bench.IN_AIR, 4000, 1e-5, 0.0),
        ("in air", bench.IN_AIR, 4000, 5e-2, 0.0),
        ("dual mass, thermal motion 1e-6", bench.DUAL_MASS, 50_000, 1e-5, 1e-6),
        ("in air, thermal motion 1e-5", bench.IN_AIR, 4000, 1e-5, 1e-5),
    ]
    for name, device, samples, noise, thermal in cases:
        errors, squares, alarms, used = [], [], 0, 0.0
        for seed in range(SEEDS):
            segment = of_arrays(device.record(samples, 12.6, noise, seed, thermal=thermal))
            begun = time.process_time()
            found = fit_segments([segment])
            used += time.process_time() - begun
            scale = in_units(found.unit, device.omega, 8)
            covariance = found.fit.covariance * np.outer(scale, scale)
            error = found.fit.parameters * scale - device.parameters
            errors.append(error / np.sqrt(np.diag(covariance)))
            squares.append(float(error @ np.linalg.solve(covariance, error)))
            alarms += failed(tests(found.fit, found.spectra, found.segments))
        lines.append(f"| decay, {name} | {samples:,} | {noise:g} | {row(errors, squares, alarms, used / SEEDS)}")
        print(lines[-1], flush=True)
    few, fewest = max(SEEDS // 3, 1), max(SEEDS // 8, 1)  # slow fits
    push, leak = 1e-2 * np.array([[1.0, 0.0], [0.0, 0.9]]), np.array([[0.02, 0.005], [0.003, 0.03]])
    for name, device, samples, count in (
        ("dual mass", bench.DUAL_MASS, 8192, few),
        ("paper", bench.PAPER, 8192, fewest),
    ):
        errors, squares, alarms, used = [], [], 0, 0.0
        for seed in range(count):
            segment = of_arrays(device.forced(samples, 9.0, push, leak, 1e-3, seed))
            begun = time.process_time()
            found = fit_segments([segment])
            used += time.process_time() - begun
            scale = in_units(found.unit, device.omega, 12)
            covariance = found.fit.covariance * np.outer(scale, scale)
            error = found.fit.parameters * scale - np.concatenate([device.parameters, push.ravel()])
            errors.append(error / np.sqrt(np.diag(covariance)))
            squares.append(float(error @ np.linalg.solve(covariance, error)))
            alarms += failed(tests(found.fit, found.spectra, found.segments))
        lines.append(f"| forced, {name} | {samples:,} | 0.001 | {row(errors, squares, alarms, used / len(errors))}")
        print(lines[-1], flush=True)
    for name, device, noise in (
        ("dual mass", bench.DUAL_MASS, "0.001"),
        ("dual mass", bench.DUAL_MASS, "1e-05"),
        ("dual mass", bench.DUAL_MASS, "0.03, y 0.3"),
        ("in air", bench.IN_AIR, "0.001"),
        ("paper", bench.PAPER, "0.001"),
    ):
        widths = [each / quality for each, quality in zip(device.frequency, device.quality, strict=True)]
        ends = device.frequency[0] - 20 * widths[0], device.frequency[1] + 15 * widths[1]
        dense = [
            middle + width / 2 * np.tan(np.linspace(-1.4, 1.4, 100))
            for middle, width in zip(device.frequency, widths, strict=True)
        ]
        at = np.unique(np.concatenate([np.linspace(max(ends[0], 0.3 * device.frequency[0]), ends[1], 201), *dense]))
        drive, through = np.array([[1.0, 0.01], [-0.02, 0.9]]), np.array([[0.1, 0.02], [0.03, 0.2]])
        through = through * min(device.quality)
        clean = device.response(at, drive, through, 0.7)
        peak = np.abs(clean).max(axis=(0, 2))
        sizes = 0.03 * peak.max() * np.ones(2) if "," in noise else float(noise) * peak
        errors, squares, alarms, used = [], [], 0, 0.0
        for seed in range(few):
            generator = np.random.default_rng(seed)
            random = generator.normal(size=clean.shape) + 1j * generator.normal(size=clean.shape)
            begun = time.process_time()
            swept = fit_sweep(Response("sweep", at, clean + sizes[:, None] * random, ("x", "y"), ("x", "y"), State()))
            used += time.process_time() - begun
            scale = in_units(swept.unit, device.omega, 12)[:8]
            covariance = swept.fit.covariance[:8, :8] * np.outer(scale, scale)
            found_scaled = swept.fit.parameters[:8] * scale
            by = invariants_by(found_scaled)
            covariance = by @ covariance @ by.T
            error = np.real(invariants(found_scaled) - invariants(device.parameters))
            errors.append(error / np.sqrt(np.diag(covariance)))
            squares.append(float(error @ np.linalg.solve(covariance, error)))
            alarms += failed(sweep_tests(swept))
        lines.append(f"| sweep, {name} | {len(at)} | {noise} | {row(errors, squares, alarms, used / few)}")
        print(lines[-1], flush=True)
    raised, records = map(sum, zip(*good, strict=True))
    lines += [
        "",
        f"Of all {records} good records {raised} raise an alarm, {100 * raised / records:.1f} %; 1 % is expected, as "
        "the limits of the tests of a record add up to that.",
        "",
        "How often the test of whiteness has a probability below a limit in white noise, of 4,000 draws:",
        "",
        "| bins | below 5 % | below 1 % | below 0.25 % |",
        "|---" * 4 + "|",
    ]
    for bins in (20, 60, 100, 244, 850):
        draws = np.random.default_rng(bins).normal(size=(2, 4000, bins))
        p = np.array([whiteness(one + 1j * other) for one, other in zip(*draws, strict=True)])
        shares = " | ".join(f"{100 * np.mean(p < limit):.2f} %" for limit in (0.05, 0.01, 0.0025))
        lines.append(f"| {bins} | {shares} |")
    print("\n".join(lines[-6:]), flush=True)
    lines += [
        "",
        "## The device",
        "",
        "Dual mass, one decay of 50,000 samples, noise 1e-3: how often the 95 % interval of the second stage contains "
        "the simulated value, and the mean half of the interval.",
        "",
        "| turn of the axes (mrad) | pick-off ratio | ± | angular rate (rad/s) | ± | not determined |",
        "|---" * 6 + "|",
    ]
    from dataclasses import replace

    for turn in (0.02, 0.001, 0.0):
        device = replace(bench.DUAL_MASS, turn=turn)
        inside, halves, missing = [], [], 0
        count = max(SEEDS // 5, 1)
        for seed in range(count):
            found = fg.identify(device.record(50_000, 12.6, 1e-3, seed))
            truth = {"pickoff_ratio": device.ratio, "rate": device.rate}
            inside.append(
                [found[name].interval[0] <= value <= found[name].interval[1] for name, value in truth.items()]
            )
            halves.append([found[name].half for name in truth])
            missing += not found["pickoff_ratio"].determined
        (first, second), (one, other) = np.mean(inside, axis=0), np.mean(halves, axis=0)
        lines.append(
            f"| {1e3 * turn:g} | {first:.2f} | {one:.2g} | {second:.2f} | {other:.2g} | {missing} of {count} |"
        )
        print(lines[-1], flush=True)
    record = bench.DUAL_MASS.record(MILLION, 12.6, 1e-3)
    begun = time.process_time()
    fit_segments([of_arrays(record)])
    fitted = time.process_time() - begun
    begun = time.process_time()
    fg.identify(record)
    whole = time.process_time() - begun
    lines += [
        "",
        f"A million samples of both pick-offs: the first stage takes {fitted:.1f} s of a processor, the whole "
        f"`fg.identify` {whole:.1f} s.",
    ]
    write("identify", lines)


if __name__ == "__main__":
    main()
