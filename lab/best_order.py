"""Table 1 again, over many seeds: is there a best order, how surely, and what moves it; writes docs/best_order.md.

    python lab/best_order.py [--seeds N] [--quick]

All orders meet the same noise, so differences are paired by seed. The figures are docs/best_order*.svg.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import fracgyro as fg
import matplotlib
import numpy as np
from fracgyro.analysis.style import LETTERS, save_svg
from fracgyro.simulation.many import threads_available
from scipy.special import betaincinv, stdtr, stdtrit

sys.path.append(str(Path(__file__).resolve().parents[1] / "benchmarks"))
matplotlib.use("Agg")
import matplotlib.pyplot as plt
from machine import command, machine, write

DEPENDS_ON = ["sliding_mode"]

DOCS = Path(__file__).parent.parent / "docs"
ORDERS = tuple(round(0.1 * n, 1) for n in range(1, 11))
FINE = tuple(round(0.02 * n, 2) for n in range(5, 51))
END = tuple(sorted({*(round(0.9 + 0.005 * n, 3) for n in range(21)), 0.997, 0.999}))
WINDOWS = ("whole", "transient", "steady")
AXES = ("x", "y", "both")  # both: of ‖e‖, the root of the sum of the squares
COLUMNS = [(w, a) for w in WINDOWS for a in AXES]
SIGN = {"x": "x", "y": "y", "both": "‖e‖"}
PAPER = 0.9
CAPUTO = "corrected, Caputo"
LEVEL = 0.05
BLOCK = 2000  # runs per call: a row of metrics each
STEPS, STEPS_HOLD = (2e-3, 1e-3, 5e-4, 2.5e-4), 2e-3
HOLDS = (1e-3, 2e-3, 5e-3, 1e-2)
TRANSIENTS = (5.0, 10.0, 20.0)
STARTS = {  # position, velocity
    "the paper's: [0.5, 0.5], at rest": ([0.5, 0.5], [0.0, 0.0]),
    "half as far out: [0.25, 0.25]": ([0.25, 0.25], [0.0, 0.0]),
    "x mirrored: [-0.5, 0.5]": ([-0.5, 0.5], [0.0, 0.0]),
    "the centre: [0, 0]": ([0.0, 0.0], [0.0, 0.0]),
    "on the reference, at its velocity": ([0.0, 1.0], [float(np.pi), 0.0]),
}
BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION = "#000000", "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00"
PALETTE = (BLUE, VERMILION, GREEN, ORANGE, BLACK)
MARKERS = "os^Dv"


@dataclass
class Sample:
    """RMSE by order, seed, window and axis."""

    orders: Sequence[float]
    values: np.ndarray
    force: np.ndarray  # largest |u|, mean over seeds, by order
    diverged: int

    def of(self, window: str, axis: str) -> np.ndarray:
        """By order and seed."""
        return self.values[:, :, WINDOWS.index(window), AXES.index(axis)]


@dataclass
class Part:
    """Cost of one part of the study."""

    name: str
    runs: int
    steps: int
    seconds: float
    processors: float  # processor time over wall-clock time


@dataclass
class Study:
    table: dict[str, Sample] = field(default_factory=dict)  # by variant
    fine: dict[str, Sample] = field(default_factory=dict)
    end: dict[str, Sample] = field(default_factory=dict)  # towards order 1
    steps: dict[str, Sample] = field(default_factory=dict)
    holds: dict[str, Sample] = field(default_factory=dict)
    densities: dict[str, Sample] = field(default_factory=dict)
    transients: dict[str, Sample] = field(default_factory=dict)
    starts: dict[str, Sample] = field(default_factory=dict)
    silent: dict[str, Sample] = field(default_factory=dict)  # no noise, by variant
    parts: list[Part] = field(default_factory=list)


class Clock:
    """Runs samples, and counts runs, steps and seconds of each part."""

    def __init__(self, parts: list[Part]) -> None:
        self.parts = parts

    def part(self, name: str, work: Callable[[], None]) -> None:
        self.runs = self.steps = 0
        start, used = time.perf_counter(), time.process_time()
        work()
        seconds = time.perf_counter() - start
        self.parts.append(Part(name, self.runs, self.steps, seconds, (time.process_time() - used) / seconds))
        print(f"{name}: {self.runs:,} runs, {seconds:.1f} s", file=sys.stderr, flush=True)

    def sample(self, base: fg.Scenario, orders: Sequence[float], seeds: int, transient: float = 10.0) -> Sample:
        values = np.empty((len(orders), seeds, len(WINDOWS), len(AXES)))
        force = np.zeros(len(orders))
        diverged = 0
        scenarios = [base.replace({"controller.order": order}) for order in orders]
        block = max(1, BLOCK // len(orders))
        for first in range(0, seeds, block):
            some = range(first, min(first + block, seeds))
            runs = fg.measure_many(scenarios, seeds=some, transient=transient)
            shape = len(orders), len(some)
            rmse = runs["rmse"].sel(window=list(WINDOWS), axis=["x", "y"]).values.reshape(*shape, len(WINDOWS), 2)
            values[:, some.start : some.stop, :, :2] = rmse
            values[:, some.start : some.stop, :, 2] = np.hypot(rmse[..., 0], rmse[..., 1])
            force += runs["largest_force"].values.reshape(shape).sum(axis=1) / seeds
            diverged += int(runs["diverged_at"].notnull().sum())
            if some.stop % (10 * block) == 0:
                print(f"  {some.stop:,} seeds", file=sys.stderr, flush=True)
        self.runs += len(orders) * seeds
        self.steps += sum(seeds * one.run.steps for one in scenarios)
        return Sample(orders, values, force, diverged)


def compute(seeds: int, few: int) -> Study:
    """The table with `seeds` seeds (the printed law: a tenth), all else with `few`."""
    study = Study()
    clock = Clock(study.parts)
    corrected, printed = fg.Scenario.paper("corrected"), fg.Scenario.paper("printed")
    variants = {"corrected": corrected, "printed": printed}
    laws = {**variants, CAPUTO: corrected.replace({"controller.derivative": "caputo"})}
    tenth = max(seeds // 10, few)

    def table(variant: str, count: int) -> Callable[[], None]:
        return lambda: study.table.update({variant: clock.sample(variants[variant], ORDERS, count)})

    def fine() -> None:
        for law, base in laws.items():
            study.fine[law] = clock.sample(base, FINE, max(few // 2, 2))

    def end() -> None:
        for law, base in laws.items():
            study.end[law] = clock.sample(base, END, max(few // 2, 2))

    def steps() -> None:
        for step in STEPS:
            base = corrected.replace({"run.step": step, "disturbance.hold": STEPS_HOLD})
            study.steps[f"{step:g}"] = clock.sample(base, ORDERS, few)

    def holds() -> None:
        density = corrected.disturbance.standard_deviation**2 * HOLDS[0]
        for hold in HOLDS:
            base = corrected.replace({"disturbance.hold": hold})
            study.holds[f"{hold:g}"] = clock.sample(base, ORDERS, few)
            if hold == HOLDS[0]:
                study.densities[f"{hold:g}"] = study.holds[f"{hold:g}"]
                continue
            base = base.replace({"disturbance.standard_deviation": float(np.sqrt(density / hold))})
            study.densities[f"{hold:g}"] = clock.sample(base, ORDERS, few)

    def transients() -> None:
        for end in TRANSIENTS:
            study.transients[f"{end:g}"] = clock.sample(corrected, ORDERS, few, end)

    def starts() -> None:
        for name, (position, velocity) in STARTS.items():
            base = corrected.replace({"run.initial_position": position, "run.initial_velocity": velocity})
            study.starts[name] = clock.sample(base, ORDERS, max(few // 4, 8))
        for variant, base in variants.items():
            study.silent[variant] = clock.sample(base.replace({"disturbance.kind": "none"}), ORDERS, 1)

    clock.part("Table 1, corrected law", table("corrected", seeds))
    clock.part("Table 1, printed law", table("printed", tenth))
    clock.part("orders in steps of 0.02", fine)
    clock.part("orders towards 1", end)
    clock.part("step of control", steps)
    clock.part("noise hold", holds)
    clock.part("window", transients)
    clock.part("start, and no noise", starts)
    return study


def winner(values: np.ndarray) -> int:
    """The order (its index) of least mean over seeds."""
    return int(values.mean(axis=1).argmin())


def candidates(values: np.ndarray) -> np.ndarray:
    """Which orders may be the best: a 95 % confidence set that holds whichever order it is.

    An order is excluded if a paired t test finds another one better, at 5 % divided by the number of the other orders.
    The best order is excluded with a probability of at most 5 %, for any number of orders.
    """
    count, seeds = values.shape
    keep = np.ones(count, dtype=bool)
    for k in range(count):
        excess = values[k] - np.delete(values, k, axis=0)
        spread = excess.std(axis=1, ddof=1) / np.sqrt(seeds)
        with np.errstate(divide="ignore", invalid="ignore"):
            p = stdtr(seeds - 1, -excess.mean(axis=1) / spread)
        keep[k] = (count - 1) * np.nanmin(p) > LEVEL
    return keep


def share(values: np.ndarray) -> np.ndarray:
    """In what share of seeds each order is the best one."""
    return np.bincount(values.argmin(axis=0), minlength=len(values)) / values.shape[1]


def share_interval(part: float, seeds: int) -> tuple[float, float]:
    """Clopper and Pearson's exact 95 % interval."""
    hits = round(part * seeds)
    low = 0.0 if hits == 0 else float(betaincinv(hits, seeds - hits + 1, LEVEL / 2))
    high = 1.0 if hits == seeds else float(betaincinv(hits + 1, seeds - hits, 1 - LEVEL / 2))
    return low, high


def interval(values: np.ndarray, comparisons: int = 1) -> tuple[float, float]:
    """Mean over seeds and half of its 95 % interval, which holds for `comparisons` comparisons at once."""
    n = values.size
    half = stdtrit(n - 1, 1 - LEVEL / comparisons / 2) * values.std(ddof=1) / np.sqrt(n)
    return float(values.mean()), float(half)


def with_error(value: float, half: float, sign: str = "") -> str:
    """A value with the digits that its half-width justifies."""
    if half == 0:
        return f"{value:{sign}.4g}"
    places = max(0, 1 - int(np.floor(np.log10(half))))
    return f"{value:{sign}.{places}f} ± {half:.{places}f}"


def percent(part: float) -> str:
    return "all" if part == 1 else "none" if part == 0 else f"{100 * part:.4g} %"


def span(sample: Sample, window: str, axis: str) -> str:
    """The best order, and in brackets all that may be it where they are several."""
    values = sample.of(window, axis)
    kept = [sample.orders[k] for k in np.flatnonzero(candidates(values))]
    best = f"{sample.orders[winner(values)]:g}"
    return best if len(kept) == 1 else f"{best} ({', '.join(f'{a:g}' for a in kept)})"


def table_lines(sample: Sample) -> list[str]:
    """RMSE by order, window and axis; the least of each column in bold."""
    scales = {"whole": (1e3, "10⁻³"), "transient": (1e3, "10⁻³"), "steady": (1e6, "10⁻⁶")}
    lines = [
        "| α | " + " | ".join(f"{w} {SIGN[a]}, {scales[w][1]}" for w, a in COLUMNS) + " |",
        "|---" * (len(COLUMNS) + 1) + "|",
    ]
    best = {c: winner(sample.of(*c)) for c in COLUMNS}
    for k, order in enumerate(sample.orders):
        cells = []
        for window, axis in COLUMNS:
            text = with_error(*interval(scales[window][0] * sample.of(window, axis)[k]))
            cells.append(f"**{text}**" if best[window, axis] == k else text)
        lines.append(f"| {order:g} | " + " | ".join(cells) + " |")
    return lines


def comparisons(sample: Sample) -> int:
    """Every pair of orders in every column."""
    count = len(sample.orders)
    return count * (count - 1) // 2 * len(COLUMNS)


def difference(sample: Sample, window: str, axis: str, k: int) -> tuple[float, float]:
    """How much larger the RMSE of order k is than the best's, in % of the best's mean, simultaneous interval."""
    values = sample.of(window, axis)
    best = values[winner(values)]
    return interval(100 * (values[k] - best) / best.mean(), comparisons(sample))


def difference_lines(sample: Sample) -> list[str]:
    lines = [
        "| α | " + " | ".join(f"{w} {SIGN[a]}" for w, a in COLUMNS) + " |",
        "|---" * (len(COLUMNS) + 1) + "|",
    ]
    for k, order in enumerate(sample.orders):
        cells = [
            "**best**" if winner(sample.of(*c)) == k else with_error(*difference(sample, *c, k), "+") for c in COLUMNS
        ]
        lines.append(f"| {order:g} | " + " | ".join(cells) + " |")
    return lines


def best_lines(sample: Sample) -> list[str]:
    seeds = sample.values.shape[1]
    at = list(sample.orders).index(PAPER)
    lines = [
        f"| window | of | best α | may be best | next best, % more | best in … of seeds | α = {PAPER:g}: % more | "
        f"α = {PAPER:g} best in … of seeds |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for window, axis in COLUMNS:
        values = sample.of(window, axis)
        ranked = values.mean(axis=1).argsort()
        best, rival = int(ranked[0]), int(ranked[1])
        kept = ", ".join(f"{sample.orders[k]:g}" for k in np.flatnonzero(candidates(values)))
        shares = share(values)
        low, high = share_interval(shares[best], seeds)
        bounds = f"[{100 * low:.4g}, {100 * high:.4g}] %"
        excess = "–" if best == at else with_error(*difference(sample, window, axis, at), "+")
        lines.append(
            f"| {window} | {SIGN[axis]} | {sample.orders[best]:g} | {kept} | {sample.orders[rival]:g}: "
            f"{with_error(*difference(sample, window, axis, rival), '+')} | {percent(shares[best])} {bounds} | "
            f"{excess} | {percent(shares[at])} |"
        )
    return lines


def move_lines(samples: dict[str, Sample], first: str, columns: Sequence[tuple[str, str]] = COLUMNS) -> list[str]:
    """Best order by setting and column, and RMSE of ‖e‖ there."""
    lines = [
        f"| {first} | " + " | ".join(f"{w} {SIGN[a]}" for w, a in columns) + " | diverged |",
        "|---" * (len(columns) + 2) + "|",
    ]
    for name, sample in samples.items():
        cells = [span(sample, *c) for c in columns]
        lines.append(f"| {name} | " + " | ".join(cells) + f" | {sample.diverged} |")
    return lines


def fine_lines(study: Study) -> list[str]:
    lines = ["| law | window | of | best α | may be best | min RMSE | best of a single seed, 2.5 to 97.5 % |"]
    lines.append("|---|---|---|---|---|---|---|")

    def line(law: str, sample: Sample, window: str, axis: str) -> str:
        values = sample.of(window, axis)
        kept = [sample.orders[k] for k in np.flatnonzero(candidates(values))]
        among = f"{kept[0]:g}" if len(kept) == 1 else f"{kept[0]:g} to {kept[-1]:g} ({len(kept)} orders)"
        single = np.array(sample.orders)[values.argmin(axis=0)]
        low, high = np.quantile(single, [0.025, 0.975], method="inverted_cdf")
        best = winner(values)
        return (
            f"| {law} | {window} | {SIGN[axis]} | {sample.orders[best]:g} | {among} | "
            f"{values[best].mean():.4g} | {low:g} to {high:g} |"
        )

    for law, sample in study.fine.items():
        lines += [line(law, sample, *c) for c in COLUMNS if c[0] != "transient"]
    lines += [line(f"{law}, α ≥ 0.9", s, *c) for law, s in study.end.items() for c in COLUMNS if c[0] != "transient"]
    return lines


def end_lines(study: Study) -> list[str]:
    """RMSE of the whole run and largest force near order 1, by law."""
    lines = [
        "| α | "
        + " | ".join(f"{law}: whole ‖e‖, 10⁻³ | steady ‖e‖, 10⁻⁶ | largest \\|u\\|" for law in study.end)
        + " |",
        "|---" * (1 + 3 * len(study.end)) + "|",
    ]
    for k, order in enumerate(END):
        if order in (0.9, 0.92, 0.94, 0.96, 0.98, 0.99, 0.995, 0.997, 0.999, 1.0):
            cells = [
                f"{1e3 * s.of('whole', 'both')[k].mean():.2f} | {1e6 * s.of('steady', 'both')[k].mean():.1f} | "
                f"{s.force[k]:.0f}"
                for s in study.end.values()
            ]
            lines.append(f"| {order:g} | " + " | ".join(cells) + " |")
    return lines


def log_ticks(panel: plt.Axes) -> None:
    panel.set_yscale("log")
    panel.minorticks_off()
    low, high = panel.get_ylim()
    if high / low < 3:
        subs = (1.0, 1.2, 1.4, 1.6, 1.8, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0)
    else:
        subs = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0) if high / low < 30 else (1.0, 2.0, 5.0)
    panel.yaxis.set_major_locator(matplotlib.ticker.LogLocator(subs=subs, numticks=15))
    panel.yaxis.set_major_formatter(matplotlib.ticker.FuncFormatter(lambda v, _: f"{v:g}"))
    panel.yaxis.set_minor_formatter(matplotlib.ticker.NullFormatter())
    panel.tick_params(labelsize=8)
    panel.grid(True, which="major", linewidth=0.4, alpha=0.5)


def save(figure: plt.Figure, name: str, title: str) -> None:
    save_svg(figure, DOCS / name, title)
    plt.close(figure)


def curve(study: Study, law: str, window: str, axis: str) -> tuple[np.ndarray, np.ndarray]:
    """Mean RMSE by order on both finer grids, short of order 1: the corrected law leaps there."""
    fine, end = study.fine[law], study.end[law]
    orders = np.concatenate([fine.orders, end.orders])
    means = np.concatenate([s.of(window, axis).mean(axis=1) for s in (fine, end)])
    kept = np.argsort(orders, kind="stable")
    kept = kept[orders[kept] < 1]
    return orders[kept], means[kept]


def draw_table(study: Study) -> None:
    """RMSE against order: the table's orders as marks, the finer grid as lines."""
    figure, panels = plt.subplots(2, 3, figsize=(10, 6.4), sharex=True, layout="constrained")
    colours = {"x": BLUE, "y": VERMILION, "both": BLACK}
    for row, (law, sample) in zip(panels, study.table.items(), strict=True):
        for panel, window in zip(row, WINDOWS, strict=True):
            for axis, marker in zip(AXES, MARKERS, strict=False):
                means = sample.of(window, axis).mean(axis=1)
                half = [interval(v)[1] for v in sample.of(window, axis)]
                panel.plot(*curve(study, law, window, axis), color=colours[axis], linewidth=1)
                if law == "corrected":
                    panel.plot(*curve(study, CAPUTO, window, axis), ":", color=colours[axis], linewidth=1)
                panel.errorbar(
                    sample.orders, means, yerr=half, fmt=marker, color=colours[axis], markersize=4, label=SIGN[axis]
                )
                best = int(means.argmin())
                panel.plot(
                    sample.orders[best], means[best], "o", markersize=11, markerfacecolor="none", color=colours[axis]
                )
            log_ticks(panel)
            panel.set_title(f"{law} law, {window}", fontsize=10)
        row[0].set_ylabel("RMSE, unit q₀")
    for panel in panels[-1]:
        panel.set_xlabel("order α")
    panels[0, 0].plot([], [], "k:", linewidth=1, label="with Caputo")
    panels[0, 0].legend(fontsize=8, title="RMSE of", title_fontsize=8, loc="upper right")
    save(figure, "best_order.svg", "RMSE against order")


def draw_moves(study: Study) -> None:
    """Draw the effects of step, hold, window and start on the curves."""
    rows = [
        ("step h", study.steps, [("whole", "x"), ("whole", "y"), ("steady", "x"), ("steady", "y")]),
        ("noise hold", study.holds, [("whole", "x"), ("whole", "y"), ("steady", "x"), ("steady", "y")]),
        ("transient until", study.transients, [(w, a) for w in ("transient", "steady") for a in ("x", "y")]),
        ("start", study.starts, [("whole", "x"), ("whole", "y"), ("steady", "x"), ("steady", "y")]),
    ]
    figure, panels = plt.subplots(4, 4, figsize=(13, 12), sharex=True, layout="constrained")
    for row, (what, samples, columns) in zip(panels, rows, strict=True):
        for panel, (window, axis) in zip(row, columns, strict=True):
            for (name, sample), colour, marker in zip(samples.items(), PALETTE, MARKERS, strict=False):
                means = sample.of(window, axis).mean(axis=1)
                panel.plot(
                    sample.orders,
                    means,
                    color=colour,
                    marker=marker,
                    markersize=3.5,
                    linewidth=1,
                    label=name.partition(":")[0].partition(",")[0],
                )
                best = int(means.argmin())
                panel.plot(sample.orders[best], means[best], "o", markersize=10, markerfacecolor="none", color=colour)
            log_ticks(panel)
            panel.set_title(f"{window} {axis}", fontsize=10)
        row[0].set_ylabel("RMSE, unit q₀")
        row[-1].legend(fontsize=8.5, title=what, title_fontsize=9, loc="center left", bbox_to_anchor=(1.02, 0.5))
    for panel in panels[-1]:
        panel.set_xlabel("order α")
    save(figure, "best_order_moves.svg", "What moves the best order")


def winners(samples: dict[str, Sample], window: str, axis: str) -> list[float]:
    return [s.orders[winner(s.of(window, axis))] for s in samples.values()]


def listed(values: Sequence[object]) -> str:
    texts = [f"{v:g}" if isinstance(v, float) else str(v) for v in values]
    return texts[0] if len(texts) == 1 else f"{', '.join(texts[:-1])} and {texts[-1]}"


def moved(samples: dict[str, Sample]) -> str:
    """Which columns' best order changes from setting to setting."""
    found = {c: winners(samples, *c) for c in COLUMNS}
    changed = [f"{w} {SIGN[a]} ({', '.join(f'{x:g}' for x in v)})" for (w, a), v in found.items() if len(set(v)) > 1]
    return f"moves {listed(changed)}" if changed else "moves none"


def answer(study: Study) -> list[str]:
    """The summary on top, from the numbers."""
    sample, printed = study.table["corrected"], study.table["printed"]
    best = {c: sample.orders[winner(sample.of(*c))] for c in COLUMNS}
    best_printed = {c: printed.orders[winner(printed.of(*c))] for c in COLUMNS}
    sure = 100 * min(share(sample.of(*c)).max() for c in COLUMNS)
    alone = sum(candidates(sample.of(*c)).sum() == 1 for c in COLUMNS)
    k = ORDERS.index(PAPER)
    silent, noisy = study.silent["corrected"].of("whole", "both")[k, 0], sample.of("whole", "both")[k].mean()
    quiet = study.silent["corrected"].of("steady", "both")[k, 0] / sample.of("steady", "both")[k].mean()
    duration, transient = fg.Scenario.paper().run.duration, 10.0
    steady = (sample.of("steady", "both")[k] ** 2).mean() * (duration - transient)
    late = 100 * steady / ((sample.of("whole", "both")[k] ** 2).mean() * duration)

    def held(found: dict[tuple[str, str], float]) -> str:
        return f"{sum(found[w, a] == PAPER for w in WINDOWS for a in ('x', 'y'))} of the 6 columns of x and y"

    near, caputo = study.end["corrected"].of("whole", "both"), study.end[CAPUTO].of("whole", "both")
    m, c = winner(near), winner(caputo)
    near, caputo = 1e3 * near.mean(axis=1), 1e3 * caputo.mean(axis=1)
    at, push = END.index(PAPER), study.end["corrected"].force
    claim = [f"{w} {SIGN[a]}" for w, a in COLUMNS if a != "both" and best_printed[w, a] != PAPER]
    return [
        "**Among tenths, each question has its own best order; none is best for all.**",
        "",
        f"- **Table 1.** Over {sample.values.shape[1]:,} paired seeds of the corrected law at h = 1e-3 the RMSE of the "
        f"whole run is minimal at α = {best['whole', 'x']:g} on x, {best['whole', 'y']:g} on y and "
        f"{best['whole', 'both']:g} for ‖e‖; from t = 10 on at {best['steady', 'x']:g}, {best['steady', 'y']:g} and "
        f"{best['steady', 'both']:g}. In {alone} of the 9 columns the 95 % confidence set has only the best order, "
        f"which wins in at least {sure:.4g} % of seeds.",
        f"- **The start decides, not the noise.** At α = {PAPER:g} the RMSE of ‖e‖ over the whole run is {silent:.5f} "
        f"without noise and {noisy:.5f} with it on average, and {late:.1g} % of its square arises from t = 10 on. Even "
        f"there the RMSE without noise is {100 * quiet:.0f} % of that with it. With four other starts the best order "
        f"on x over the whole run is {listed(winners(study.starts, 'whole', 'x')[1:])}.",
        f"- **Tenths hide what happens near 1.** The RMSE of ‖e‖ is {near[at]:.1f}e-3 at 0.9, {near[m]:.1f}e-3 at "
        f"{END[m]:g} (the minimum of those tried) and {near[-1]:.1f}e-3 at 1. The corrected law jumps there: an "
        f"initial push, with which the force reaches {push[m]:.0f} at {END[m]:g} and {push[-1]:.0f} at 1, drops out. "
        f"Without that push (Caputo's derivative) the best is {END[c]:g} with {caputo[c]:.2f}e-3, against "
        f"{caputo[-1]:.2f}e-3 at 1. The push accounts for "
        f"{100 * (1 - (caputo[-1] - caputo[c]) / (near[-1] - near[m])):.3g} % of what a fractional order saves here.",
        f"- **What moves the best tenth.** The step {moved(study.steps)}; the noise hold {moved(study.holds)}; the "
        f"window {moved(study.transients)}.",
        f"- **Claim h of the paper**, minimal at α = {PAPER:g}, holds in {held(best)} under the corrected law and in "
        f"{held(best_printed)} under the printed one" + (f" (not for {listed(claim)})." if claim else "."),
    ]


def page(study: Study) -> list[str]:
    corrected, printed = study.table["corrected"], study.table["printed"]
    seeds, tenth = corrected.values.shape[1], printed.values.shape[1]
    few, finer = study.steps["0.001"].values.shape[1], study.fine["corrected"].values.shape[1]
    first = study.parts[0]
    total = sum(p.seconds for p in study.parts)
    lines = [
        "# The best order",
        "",
        f"Generated by `{command()}`, fracgyro {fg.__version__}. Machine: {machine('matplotlib', 'scipy')}; "
        f"{threads_available()} processors available. {total:.0f} s in all.",
        "",
        *answer(study),
        "",
        "![RMSE against order](best_order.svg)",
        "",
        "Marks: the table below, with 95 % intervals (mostly smaller than the marks); rings: their minimum; lines: "
        f"finer orders, {finer} seeds; "
        "dotted: the corrected law with Caputo's derivative instead of Riemann-Liouville's.",
        "",
        f"## Table 1, corrected law, {seeds:,} seeds",
        "",
        "Mean RMSE, unit q₀, and half of its 95 % interval (Student's t, over seeds). Whole: t < 80; transient: "
        "t < 10; steady: from t = 10 on. ‖e‖: both axes together. Seeds "
        f"0 to {seeds - 1}, the same noise for all orders. Runs that diverged: {corrected.diverged}.",
        "",
        *table_lines(corrected),
        "",
        "### Which is best, and how surely",
        "",
        "*May be best*: a 95 % confidence set of orders; an order is out when a paired t test finds another one better "
        "at 5 %/9, so the true best is in it with at least 95 % probability, although it was not chosen beforehand. "
        f"*% more*: paired difference from the best, in % of the best's mean, with intervals for all "
        f"{comparisons(corrected)} pairs and columns at once (Bonferroni), so they hold for a best that was picked "
        "from the same data. *Best in … of seeds*: exact 95 % interval (Clopper, Pearson) of the probability that this "
        "order beats the nine others under fresh noise.",
        "",
        *best_lines(corrected),
        "",
        "All differences from the best, % (same intervals):",
        "",
        *difference_lines(corrected),
        "",
        f"## The same as printed, {tenth:,} seeds",
        "",
        *table_lines(printed),
        "",
        *best_lines(printed),
        "",
        "## Between the tenths",
        "",
        f"Orders from 0.1 to 1 in steps of 0.02; then 0.9 to 1 in steps of 0.005, with 0.997 and 0.999; {finer} seeds. "
        "*May be best* is the interval that noise leaves; the spacing of the grid adds to it. The curves have "
        "several minima, so the best of a coarse grid says little about the orders between. Where 0.999 is best, it is "
        "the largest order tried below 1, not an optimum: the next section says why.",
        "",
        *fine_lines(study),
        "",
        "### Towards order 1",
        "",
        "With the Riemann-Liouville derivative the law contains λ₁ e(0) t^(−α)/Γ(1−α), a push at the start. As "
        "α → 1, all of it falls into the first step: a force of λ₁ |e(0)|/h = 5000 for e(0) = [0.5, −0.5]. It changes "
        "the velocity by λ₁ |e(0)| within one step and so drives the motion towards the surface. At α = 1 the term is "
        "absent, so the corrected law jumps there; with Caputo's derivative there is no push at any order. The push "
        "grows as h^(−α), and a force limit clips it. Largest |u|: mean over seeds.",
        "",
        *end_lines(study),
        "",
        "## What moves it",
        "",
        f"Corrected law, {few} seeds each, orders in tenths. Best α; in parentheses all that may be best, where "
        "there are several.",
        "",
        "![What moves the best order](best_order_moves.svg)",
        "",
        f"**Step of control** h (noise held for {STEPS_HOLD:g} in all, so the same force at every step):",
        "",
        *move_lines(study.steps, "h"),
        "",
        "**Noise hold**, standard deviation 1 (its power at low frequencies grows with the hold):",
        "",
        *move_lines(study.holds, "hold"),
        "",
        f"**Noise hold at the same density** ({HOLDS[0]:g}; standard deviation falls as the root of the hold):",
        "",
        *move_lines(study.densities, "hold"),
        "",
        "**Window**: transient before, steady from this time on:",
        "",
        *move_lines(study.transients, "t", [c for c in COLUMNS if c[0] != "whole"]),
        "",
        f"**Start** ({max(few // 4, 8)} seeds): the same controller, another initial condition:",
        "",
        *move_lines(study.starts, "start"),
        "",
        "**No noise** (one run): the best order, and the RMSE without noise in % of the mean with it, at "
        f"α = {PAPER:g} and 1. Where it is near 100 %, the window shows the start, not the noise.",
        "",
        "| law | " + " | ".join(f"{w} {SIGN[a]}" for w, a in COLUMNS) + " |",
        "|---" * (len(COLUMNS) + 1) + "|",
        *(
            f"| {law} | " + " | ".join(f"{s.orders[winner(s.of(*c))]:g}" for c in COLUMNS) + " |"
            for law, s in study.silent.items()
        ),
        *(
            f"| {law}, % at α = {order:g} | "
            + " | ".join(
                f"{100 * s.of(*c)[ORDERS.index(order), 0] / study.table[law].of(*c)[ORDERS.index(order)].mean():.3g}"
                for c in COLUMNS
            )
            + " |"
            for law, s in study.silent.items()
            for order in (PAPER, 1.0)
        ),
        "",
        "## What this does not say",
        "",
        "Intervals are over noise seeds only. Plant, gains, reference and initial estimates are the paper's; each "
        "could move the best order as the start does, which seeds do not show. Gains were not tuned again for "
        "each order: at another order the same λ₁ means another stiffness of the surface. Table 1's own values are not "
        "available, so nothing here is compared with them.",
        "",
        "## Time",
        "",
        "*Processors*: processor time over wall-clock time; below the number available, other programs used the "
        f"machine. Table 1 of the corrected law took {first.seconds * first.processors:.0f} processor seconds, so "
        f"{first.seconds * first.processors / threads_available():.0f} s at least on all of them. Figures and "
        "the page are not included.",
        "",
        "| part | runs | steps | seconds | processors | ns a step |",
        "|---|---|---|---|---|---|",
        *(
            f"| {p.name} | {p.runs:,} | {p.steps:.3g} | {p.seconds:.1f} | {p.processors:.2f} | "
            f"{1e9 * p.seconds / p.steps:.1f} |"
            for p in study.parts
        ),
    ]
    return lines


def report(study: Study) -> None:
    plt.rcParams.update(LETTERS)
    draw_table(study)
    draw_moves(study)
    write("best_order", page(study))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10_000, metavar="N", help="of the table (default 10000)")
    parser.add_argument("--quick", action="store_true", help="40 seeds for the table, 8 for all else; prints, no files")
    options = parser.parse_args()
    if options.seeds < 2:
        parser.error(f"--seeds is {options.seeds}: an interval needs 2 or more")
    study = compute(40, 8) if options.quick else compute(options.seeds, min(options.seeds, 200))
    if options.quick:
        print("\n".join(page(study)))
    else:
        report(study)


if __name__ == "__main__":
    main()
