"""Times the closed loop and its usual alternatives in one run; writes benchmarks/results/loop.md.

    python benchmarks/loop.py [--repeats N] [--quick]

The paper's 80 units of time at h = 1e-3: 80,001 samples, the corrected loop, noise redrawn every step. All runs on one
processor. Every peer is given the noise of our run, and what it computes is compared with ours before it is timed.
"""

from __future__ import annotations

import argparse
import json
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import fracgyro as fg
import jax
import numba
import numpy as np
from machine import command, machine, on_one_core, write
from peers import exponentials_numba, full_history, jax_loop, solve_ivp_oustaloup
from peers.gyroscope import ORDER, STEP, STEPS, references

MEASURES_CODE = True
DEPENDS_ON = ["sliding_mode", "benchmarks/benchmark_loop.cpp", "benchmarks/peers/*"]

ROOT = Path(__file__).resolve().parent.parent
TOLERANCE, TRANSIENT = 1e-6, 10.0
MARK = 5e-3  # seconds
RUNS = 256  # runs of the batch
SPAN = 10.0  # units of time that solve_ivp runs; the transient's steps cost it a little more than later ones
OURS = "fracgyro, C++"
FLOPS = 169, 16  # that a step of the law and the linear plant needs: without exponentials, and for each

# Largest difference from our positions, and of the RMSE after the transient (solve_ivp: of its span).
SAME_OPERATOR = (1e-4, 1e-3)  # exponentials too, the signal linear between samples instead of cubic
GRUENWALD = (1e-2, 0.05)  # first order in h
CONTINUOUS = (2e-2, 0.02)  # controller in continuous time, filters of 1 %; compared with ours at h/10


@dataclass
class Peer:
    name: str
    prepare: Callable[[], object]
    run: Callable[[], np.ndarray]  # positions
    tolerances: tuple[float, float]
    rounds: int
    calls: int = 1  # a repeat is the median of this number of calls
    slow: bool = False  # left out by --quick
    scale: float = 1.0  # factor on the measured seconds, for a shorter span
    expected: np.ndarray | None = None  # positions to compare with, if not ours
    first: float = 0.0  # seconds of the first call, compilation included
    seconds: list[float] = field(default_factory=list)
    agreement: tuple[float, float] = (0.0, 0.0)


def log(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def stopwatch(function: Callable[[], object]) -> float:
    start = time.perf_counter()
    function()
    return time.perf_counter() - start


def build(folder: Path) -> Path:
    """The C++ benchmark, with the flags of CMakeLists.txt."""
    options = ["-DFRACGYRO_PYTHON=OFF", "-DFRACGYRO_BENCHMARKS=ON", "-DCMAKE_BUILD_TYPE=Release"]
    for command_line in (["cmake", "-S", ROOT, "-B", folder, *options], ["cmake", "--build", folder]):
        subprocess.run([str(word) for word in command_line], check=True, capture_output=True)
    return folder / "benchmark_loop"


def core(program: Path, kernel: fg.fractional.ExponentialSum) -> dict[str, float]:
    """Output of benchmark_loop: medians of three processes."""
    pairs = zip(kernel.poles.tolist(), kernel.weights.tolist(), strict=True)
    text = f"{kernel.count}\n" + "\n".join(f"{s!r} {w!r}" for s, w in pairs)
    runs = [subprocess.run([program], input=text, text=True, capture_output=True, check=True) for _ in range(3)]
    printed = [json.loads(run.stdout) for run in runs]
    return {name: statistics.median(one[name] for one in printed) for name in printed[0]}


def octave(noise: np.ndarray, folder: Path) -> tuple[float, np.ndarray]:
    """Seconds of the loop only, and positions."""
    source, target = folder / "noise", folder / "positions"
    noise.tofile(source)
    script = Path(__file__).parent / "peers" / "octave_loop.m"
    words = ["octave-cli", "--no-gui", "--quiet", str(script), str(source), str(target)]
    seconds = float(subprocess.run(words, capture_output=True, text=True, check=True).stdout)
    return seconds, np.fromfile(target).reshape(-1, 2)


def positions_of(loop: Callable[..., object], *arguments: object) -> np.ndarray:
    """The first two of the channels that the loop gives, as NumPy's array."""
    return np.asarray(loop(*arguments))[:, :2]


def single_runs(noise: np.ndarray, ours: np.ndarray, kernel: fg.fractional.ExponentialSum) -> list[Peer]:
    """All peers that make one run, fastest first."""
    count = len(noise)
    peers = []
    record = np.zeros((count, exponentials_numba.WIDTH))
    for fastmath in (False, True):
        loop = exponentials_numba.make(count, kernel.poles, kernel.weights, fastmath)
        name = f"numba, {kernel.count} exponentials, every channel, fastmath {'on' if fastmath else 'off'}"
        run = partial(positions_of, loop, noise, record)
        peers.append(Peer(name, run, run, SAME_OPERATOR, 9, calls=9))
    scan, given = jax_loop.make_scan(count, kernel.poles, kernel.weights), jax.numpy.asarray(noise)
    run = partial(positions_of, scan, given)
    peers.append(Peer(f"JAX scan, {kernel.count} exponentials", run, run, SAME_OPERATOR, 5, calls=3))
    for library, compiled in (("numba", numba.njit), ("NumPy", lambda function: function)):
        for one_sum in (True, False):
            loop = full_history.make(compiled, one_sum)
            name = f"{library}, full history" + (", half the sums" if one_sum else "")
            peers.append(
                Peer(
                    name,
                    lambda loop=loop: loop(noise[:10]),
                    lambda loop=loop: loop(noise),
                    GRUENWALD,
                    3,
                    slow=library == "NumPy" and one_sum,
                )
            )
    peers.append(
        Peer(
            "NumPy, full history, vectors and matrices throughout",
            lambda: full_history.arrays(noise[:10]),
            lambda: full_history.arrays(noise),
            GRUENWALD,
            2,
            slow=True,
        )
    )
    # Ours at a tenth of the step under the same noise is the nearest to continuous time.
    fine = fg.Scenario.paper().replace(
        {"run.duration": SPAN, "run.step": STEP / 10, "run.record_every": 10, "disturbance.hold": STEP}
    )
    peers.append(
        Peer(
            f"SciPy solve_ivp, Oustaloup ({SPAN:g} units of time, scaled)",
            lambda: solve_ivp_oustaloup.simulate(noise, 10 * STEP),
            lambda: solve_ivp_oustaloup.simulate(noise, SPAN),
            CONTINUOUS,
            3,
            scale=STEPS * STEP / SPAN,
            expected=fg.simulate(fine)["position"].values,
        )
    )
    return peers


def check(peer: Peer, positions: np.ndarray, ours: np.ndarray) -> None:
    """Raises AssertionError unless `positions` are ours within the peer's tolerances."""
    expected = ours if peer.expected is None else peer.expected
    times = STEP * np.arange(len(positions))
    judged = slice(None) if peer.expected is not None else times >= TRANSIENT - 0.5 * STEP
    reference = references(times)[:, :2]
    largest = float(np.abs(positions - expected).max())
    theirs, mine = (np.sqrt(np.mean((p - reference)[judged] ** 2, axis=0)) for p in (positions, expected))
    peer.agreement = largest, float(np.abs(theirs / mine - 1.0).max())
    for value, limit, what in zip(peer.agreement, peer.tolerances, ("positions", "RMSE"), strict=True):
        assert value <= limit, f"{peer.name}: {what} differ by {value:.2g} from ours, allowed is {limit:g}"


def batch(kernel: fg.fractional.ExponentialSum, rounds: int, runs: int) -> dict[str, object]:
    """`runs` runs on this one processor without keeping trajectories: ours and JAX's vmap."""
    scenario, seeds = fg.Scenario.paper(), list(range(runs))
    parts = [
        fg.simulate_many([scenario], seeds=seeds[i : i + 16])["disturbance"].values.copy() for i in range(0, runs, 16)
    ]
    noise = jax.numpy.asarray(np.concatenate(parts))
    del parts
    vmapped = jax_loop.make_batch(STEPS + 1, kernel.poles, kernel.weights, TRANSIENT)
    compiling = stopwatch(lambda: vmapped.lower(noise).compile())
    metrics = fg.measure_many([scenario], seeds=seeds, transient=TRANSIENT)
    ours = metrics["rmse"].sel(window=["whole", "steady"]).transpose("run", "window", "axis").values
    deviation = np.abs(np.asarray(vmapped(noise)) / ours - 1.0)
    # A few noises magnify the signal's being linear instead of cubic between samples: 2 % for 1 of 256. An independent
    # loop, tests/python/oracle.py, shows the same difference when only its interpolation is changed.
    assert np.median(deviation) < 1e-3, "JAX's runs are not ours"
    assert deviation.max() < 0.05, "JAX's runs are not ours"
    seconds: dict[str, list[float]] = {"ours": [], "JAX": []}
    for _ in range(rounds):
        seconds["ours"].append(stopwatch(lambda: fg.measure_many([scenario], seeds=seeds, transient=TRANSIENT)))
        seconds["JAX"].append(stopwatch(lambda: vmapped(noise).block_until_ready()))
    return {"seconds": seconds, "compiling": compiling, "median": np.median(deviation), "largest": deviation.max()}


def line(name: str, seconds: list[float], ours: float, scale: float = 1.0) -> str:
    median, least, most = (scale * f(seconds) for f in (statistics.median, min, max))
    ratio = median / ours
    return (
        f"| {name} | {median:.4g} s | {median / (STEPS + 1) * 1e9:,.0f} ns | {least:.4g} to {most:.4g} s | "
        f"{len(seconds)} | {f'{ratio:,.0f}' if ratio >= 100 else f'{ratio:.3g}'} |"
    )


def limits(cores: list[dict[str, float]], exponentials: int) -> list[str]:
    """Our times against the processor's limits: medians and ranges of ratios, each from the figures of one process."""
    flops = (FLOPS[0] + FLOPS[1] * exponentials) * (STEPS + 1)

    def row(what: str, ratio: Callable[[dict[str, float]], float], mark: str, percent: bool = False) -> str:
        values = sorted(ratio(c) for c in cores)
        shown = [f"{v:.0%}" if percent else f"{v:.2f}" for v in (statistics.median(values), values[0], values[-1])]
        return f"| {what} | {shown[0]} | {shown[1]} to {shown[2]} | {mark} |"

    peak = statistics.median(c["flops_peak"] for c in cores)

    def nanoseconds(name: str) -> str:
        return f"{statistics.median(c[name] for c in cores) / (STEPS + 1) * 1e9:.1f} ns a step"

    return [
        "## Beside what the processor can do at best",
        "",
        "Timed in turn within one C++ program, with registers of four doubles where there are such.",
        "The chain: as many steps of the two square roots, and what links them,",
        "that no step can avoid one after another. The peak: fused multiply-adds of doubles and nothing else on one",
        f"processor, {peak / 1e9:.1f} · 10⁹ operations a second; of a step's operations only those count that the law",
        f"needs, {FLOPS[0]} + {FLOPS[1]} a mode.",
        "",
        "| | median | range | mark |",
        "|---|---|---|---|",
        row(
            f"one run, noise prepared, nothing kept ({nanoseconds('seconds_unkept')}), over the chain",
            lambda c: c["seconds_unkept"] / c["seconds_chain"],
            "at most 2.8",
        ),
        row(
            "the same with every channel recorded, over that",
            lambda c: c["seconds_prepared"] / c["seconds_unkept"],
            "–",
        ),
        row(
            f"the same with every channel recorded and noise drawn ({nanoseconds('seconds')}), over that",
            lambda c: c["seconds"] / c["seconds_unkept"],
            "at most 1.30",
        ),
        row(
            f"runs side by side, same noise ({nanoseconds('seconds_lanes')}): share of the peak",
            lambda c: flops / c["seconds_lanes"] / c["flops_peak"],
            "–",
            percent=True,
        ),
        row(
            f"the same with noise per run ({nanoseconds('seconds_own_noise')}), over that",
            lambda c: c["seconds_own_noise"] / c["seconds_lanes"],
            "–",
        ),
        row(
            f"the same in single precision ({nanoseconds('seconds_single')}), speed over double",
            lambda c: c["seconds_lanes"] / c["seconds_single"],
            "–",
        ),
        "",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=9, help="most rounds; what takes long runs in the first few")
    parser.add_argument("--quick", action="store_true", help="two rounds without the slowest; nothing is written")
    options = parser.parse_args()
    on_one_core()
    rounds = 2 if options.quick else options.repeats

    kernel = fg.fractional.design(ORDER, STEP, STEPS * STEP, TOLERANCE)
    run = fg.simulate(fg.Scenario.paper())
    noise, ours = (np.ascontiguousarray(run[name].values) for name in ("disturbance", "position"))
    peers = [p for p in single_runs(noise, ours, kernel) if not (options.quick and p.slow)]
    cores: list[dict[str, float]] = []
    wall = used = 0.0  # seconds of the peers; equal if no other program used the processor
    absent = octave_version = ""
    with tempfile.TemporaryDirectory() as scratch:
        program = build(Path(scratch))
        for peer in peers:
            peer.first = stopwatch(peer.prepare)
            check(peer, peer.run(), ours)
            log(f"{peer.name}: agrees")
        for number in range(rounds):
            cores.append(core(program, kernel))
            start, busy = time.perf_counter(), time.process_time()
            for peer in peers:
                if number < peer.rounds:
                    peer.seconds.append(statistics.median(stopwatch(peer.run) for _ in range(peer.calls)))
            wall, used = wall + time.perf_counter() - start, used + time.process_time() - busy
            cores.append(core(program, kernel))
            log(f"round {number + 1} of {rounds} done")
        if shutil.which("octave-cli") is None:
            absent = "Octave: octave-cli is not on this machine (Debian: apt-get install octave), so it was not run."
        elif not options.quick:
            peer = Peer("Octave, full history", lambda: None, lambda: ours, GRUENWALD, 1)
            log("Octave runs for about a minute")
            took, positions = octave(noise, Path(scratch))
            told = subprocess.run(["octave-cli", "--version"], capture_output=True, text=True, check=True).stdout
            octave_version = "; " + told.splitlines()[0]
            check(peer, positions, ours)
            peer.seconds.append(took)
            peers.append(peer)
    many = batch(kernel, min(3, rounds), 32 if options.quick else RUNS)

    # The faster of the two numba variants counts.
    numbas = sorted(peers[:2], key=lambda p: statistics.median(p.seconds))
    log(f"numba: {numbas[1].name} takes {statistics.median(numbas[1].seconds):.4g} s")
    peers = [numbas[0], *peers[2:]]
    peers.sort(key=lambda p: p.scale * statistics.median(p.seconds))
    mine = [c["seconds"] for c in cores]
    least = statistics.median(mine)
    runs = 32 if options.quick else RUNS
    per_run = {name: [s / runs for s in seconds] for name, seconds in many["seconds"].items()}
    ours_batch = statistics.median(per_run["ours"])
    lines = [
        "# The closed loop, timed",
        "",
        f"Made by `make bench`, with `{command()}`.",
        "",
        f"Machine: {machine('scipy', 'numba', 'jax')}{octave_version}.",
        f"Everything on one of its processors, which the peers had for {used / wall:.0%} of their time; where that is",
        "clearly less than all, others had it, and only ratios of what takes equally long mean something.",
        f"Operator: {kernel.count} exponentials, certified relative error {kernel.error:.1e}; also for",
        "the peers with exponentials.",
        "",
        "## One run",
        "",
        "Wall-clock seconds of 80 units of time at h = 1e-3 (80,001 steps), double precision, noise redrawn each step,",
        "interleaved. Ours draws its noise and records every channel; the peers are given the noise, and but for numba",
        "with exponentials they record positions only. Compilation is not counted.",
        "",
        "| | median | per step | range | repeats | times ours |",
        "|---|---|---|---|---|---|",
        line(OURS, mine, least),
        *(line(p.name, p.seconds, least, p.scale) for p in peers),
        "",
        f"Mark: at most {MARK * 1e3:g} ms a run ({MARK / (STEPS + 1) * 1e9:.0f} ns a step): "
        f"{'met' if least <= MARK else 'missed'} with the median of {least * 1e3:.2f} ms;",
        f"least {min(mine) * 1e3:.2f} ms. A repeat of ours is the median of 15 runs in three "
        "processes; of numba with exponentials, of nine calls; of JAX, of three.",
        f"{numbas[1].name} took {statistics.median(numbas[1].seconds) * 1e3:.3g} ms.",
        "Half the sums: Grünwald-Letnikov's D^α e as the difference quotient of D^(α-1) e, which is seldom written.",
        *([absent] if absent else []),
        "",
        *(limits(cores, kernel.count) if cores[0]["flops_peak"] else []),
        "## Many runs, per processor",
        "",
        f"{runs} runs of the same length with different noise, no trajectory kept, per run and processor. Ours draws",
        "the noise and gathers all metrics; JAX's is prepared beforehand, and it gathers the RMSE.",
        "",
        "| | median | per step | range | repeats | times ours |",
        "|---|---|---|---|---|---|",
        line("fracgyro, `measure_many`", per_run["ours"], ours_batch),
        line(f"JAX vmap over {runs} runs", per_run["JAX"], ours_batch),
        line(f"{numbas[0].name}, one run after another", numbas[0].seconds, ours_batch),
        "",
        f"JAX took {many['compiling']:.1f} s to compile this, not counted. The RMSE of its runs differs from ours by "
        f"{many['median']:.0e} (median),",
        f"at most {many['largest']:.0e}; whole run and after t = 10, both axes.",
        "",
        "## They compute the same",
        "",
        "Every peer has the noise of our run. Checked before timing, within the tolerances in brackets: the largest",
        "difference of positions over the run, and of the RMSE after t = 10. Of solve_ivp over its span, both against",
        "ours at h = 1e-4, the nearest to its continuous controller. First call: compilation, where there is any.",
        "",
        "| | positions | RMSE | first call |",
        "|---|---|---|---|",
        *(
            f"| {p.name} | {p.agreement[0]:.1e} ({p.tolerances[0]:g}) | {p.agreement[1]:.2%} ({p.tolerances[1]:.1%}) | "
            f"{f'{p.first:.2g} s' if p.first > 0.1 else '–'} |"
            for p in peers
        ),
    ]
    write("loop", lines, keep=not options.quick)


if __name__ == "__main__":
    main()
