"""The laws of the zoo, tuned and judged in full, and the runs of the public code; writes zoo.md and gains.json.

Resumes the results in build/zoo of these sources. The gains are those with which `fracgyro zoo run` runs a law.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from pathlib import Path

import numpy as np
from fracgyro_lab.zoo import page
from fracgyro_lab.zoo.facts import entries
from fracgyro_lab.zoo.fig import lines as lines_of
from fracgyro_lab.zoo.laws import GAINS
from fracgyro_lab.zoo.printed import SWITCHES, PrintedRun, integrated
from fracgyro_lab.zoo.result import Zoo
from fracgyro_lab.zoo.run import SETTINGS, figures_of, printed_run, report

sys.path.append(str(Path(__file__).resolve().parents[1] / "benchmarks"))

from machine import RESULTS, command, machine, write
from sources import digest

LOGS = {"zoo": ["lab/fracgyro_lab/zoo/facts/*.toml"]}
OUT = Path(__file__).parents[1] / "build" / "zoo" / digest(Path(__file__).resolve())  # by sources
CODE = "2023_prescribed"  # the entry with a public code
FINE, FINER = 2e-4, 1e-4  # steps of the runs, and of those that published curves are compared with
MEANT = ("plant_exchanged", "damping_scale")


def show(done: float, total: float, doing: str) -> None:
    print(f"\r{doing} {100 * done / max(total, 1):5.1f} %", end="", file=sys.stderr, flush=True)


def made(quick: bool) -> Zoo:
    """Finish the report in the folder; one of another version or of other laws is repeated."""
    folder = OUT.with_name(f"{OUT.name}-quick") if quick else OUT
    counted = RESULTS / "flops.md"
    try:
        return report(folder, quick=quick, resume=folder.is_dir(), operations=counted, progress=show)
    except ValueError as error:
        if "has another study" not in str(error):
            raise
        shutil.rmtree(folder)
        return report(folder, quick=quick, operations=counted, progress=show)


def keep(zoo: Zoo) -> None:
    """The gains by setting and law, for `fracgyro zoo run`."""
    found = {
        setting: {name: law[setting]["gains"] for name, law in sorted(zoo.laws.items()) if law[setting] is not None}
        for setting in SETTINGS
    }
    tuned = {setting: {name: each for name, each in of.items() if each} for setting, of in found.items()}
    text = json.dumps(tuned, indent=1)
    GAINS.write_text(text + "\n", encoding="utf-8")


def variants() -> dict[str, PrintedRun]:
    """Runs that show what each error of the public code does, and what its terms do."""
    facts = entries()[CODE]
    every = frozenset(SWITCHES)
    found = {f"{run.name}, as printed": printed_run(facts, run.name, "printed") for run in facts.run}
    run = found["fixed, as printed"]
    found |= {f"fixed, without {error}": PrintedRun(run.numbers, every - {error}) for error in SWITCHES}
    for name in ("fixed", "finite"):
        found[f"{name}, plant as meant"] = PrintedRun(found[f"{name}, as printed"].numbers, every - set(MEANT))
        found[f"{name}, as corrected"] = printed_run(facts, name, "corrected")
    numbers = found["fixed, as printed"].numbers
    found["fixed, k1 = k3 = 0"] = PrintedRun({**numbers, "k1": 0.0, "k3": 0.0})
    found["fixed, k1 to k4 = 0"] = PrintedRun({**numbers, **dict.fromkeys(("k1", "k2", "k3", "k4"), 0.0)})
    found["fixed, estimates at rest"] = PrintedRun(numbers, learns=False)
    found["fixed, as corrected, k3 = k4 = 100"] = PrintedRun({**numbers, "k3": 100.0, "k4": 100.0}, frozenset())
    return found


def code() -> list[str]:
    """The table of the public code."""
    rows = []
    for number, (words, run) in enumerate(variants().items()):
        show(number, len(variants()), "public code")
        found = figures_of(integrated(run, step=FINE))
        rows.append((words, *map(page.rms, found["rms"]), f"{found['share']:.2f}", page.leaves(found["leaves"])))
    heads = ("run", "RMS of e_x after t = 5", "of e_y", "largest share of the bound", "leaves it at")
    return page.table(heads, rows)


def distances(folder: Path) -> list[str]:
    """Largest distance to the published curves of e, in a clone of the public code, over the range of each."""
    figures = {"fixed": (2, 0), "finite": (2, 1), "fault": (1, 0)}  # case study, and place of the axes in figure 3
    rows = []
    for name, (study, place) in figures.items():
        show(len(rows), len(figures), "published curves")
        of = [line for line in lines_of(str(folder / f"Case Study {study}/Figures/Fig3.fig")) if line.axes == place]
        both = of[:2]
        published = np.stack([line.y for line in both], axis=1)
        mine = integrated(printed_run(entries()[CODE], name, "printed"), step=FINER, sample=1e-3).error
        gap = np.abs(mine - published)
        far = ~(gap < 0.01 * np.ptp(published, axis=0)).all(axis=1)
        apart = f"{both[0].x[far.argmax()]:.3f}" if far.any() else "never"
        shares = gap.max(axis=0) / np.ptp(published, axis=0)
        rows.append((name, *(f"{each:.2e}" for each in gap.max(axis=0)), *(f"{each:.2%}" for each in shares), apart))
    heads = ("run", "distance x, q0", "y, q0", "x, share of the range", "y", "more than 1 % apart from t =")
    return page.table(heads, rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a minute's look; nothing is tuned, and no gains are kept")
    parser.add_argument("--curves", type=Path, metavar="DIR", help="a clone of the public code, to compare its curves")
    given = parser.parse_args()
    zoo = made(given.quick)
    if not given.quick:
        keep(zoo)
    first, *rest = page.markdown(zoo)
    lines = [first, "", f"Made by `{command()}`, which `make zoo` runs. Machine: {machine('cmaes')}.", ""]
    lines += ["**Untuned.**" if given.quick else "Rules and words: [the zoo](../../docs/zoo.md).", ""]
    lines += [f"{zoo.seconds:.0f} s, {zoo.resumed} pieces found finished. Effort: {zoo.effort}.", *rest]
    lines += ["", "## The public code, error by error", "", "A run that is lost or near the bound depends on the step."]
    lines += ["", *code()]
    if given.curves:
        lines += ["", "## Distance to the published curves", "", *distances(given.curves)]
    write("zoo", lines)


if __name__ == "__main__":
    main()
