"""The article, from nothing to the PDF: `make article`.

    python lab/article/build.py [--seeds N] [--comparison DIR] [--out DIR]

Runs the paper's study again, reads the committed logs and the comparison's results, draws the figures and compiles
article.typ, which takes every measured number from values.json.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any

import matplotlib
import typst

sys.path.append(str(Path(__file__).resolve().parents[2] / "benchmarks"))

import comparison
import figures
import logs
import rating
import replication
import sensing
import tracking
from words import short

HERE = Path(__file__).resolve().parent
OUT = HERE.parents[1] / "build" / "article"
SOURCES = ("article.typ", "template.typ", "metadata.yaml", "bibliography.yml")
CITATION = HERE.parents[1] / "CITATION.cff"  # authors and address of the code
SEEDS = 100  # the default of `fracgyro reproduce`
Values = dict[str, Any]


def build(out: Path, seeds: int, results: Path) -> Path:
    """Raises ValueError in one sentence where something that it needs is missing."""
    data = {task: comparison.load(results, task) for task in ("track", "rate")}
    return write(out, replication.replicate(seeds), sensing.errors(2 * seeds), data)


def write(out: Path, again: replication.Replication, errors: sensing.Errors, data: dict[str, Values]) -> Path:
    """Write the values of the runs, the committed logs and the comparison."""
    values: Values = {
        "version": version("fracgyro"),
        "method": method(),
        "sensing": sensing.values(errors),
        "track": tracking.values(data["track"]),
        "rate": rating.values(data["rate"]),
        **replication.values(again),
    }
    out.mkdir(parents=True, exist_ok=True)
    figures.draw(again, errors, data["track"], out / "figures")
    return typeset(values, out)


def typeset(values: Values, out: Path) -> Path:
    """Compiles the sources next to the figures in `out`."""
    (out / "values.json").write_text(json.dumps(values, indent=1, ensure_ascii=False, allow_nan=False), "utf-8")
    for name in SOURCES:
        shutil.copyfile(HERE / name, out / name)
    shutil.copyfile(CITATION, out / CITATION.name)
    typst.compile(out / "article.typ", output=out / "article.pdf", **fonts())
    return out / "article.pdf"


def fonts() -> dict[str, Any]:
    """Those of typst and Matplotlib: the same letters on every machine."""
    return {"font_paths": [Path(matplotlib.get_data_path(), "fonts", "ttf")], "ignore_system_fonts": True}


def method() -> Values:
    """How far the implementation can be trusted, from its logs."""
    ours = logs.row("operator_accuracy", method="exponentials, tolerance 1e-6, double")
    history = logs.row("operator_accuracy", method="whole history, Grünwald-Letnikov (FFT)")
    targets = logs.rows("parity", "target", "parity hash")
    hashes = {row["section"].partition(":")[0]: row["parity hash"] for row in targets}  # by kind of number
    if {(row["section"].partition(":")[0], row["parity hash"]) for row in targets} != set(hashes.items()):
        raise ValueError("benchmarks/results/parity.md has targets that answer with different bits")
    return {
        "operator_error": short(logs.number(ours["largest error"])),
        "history_error": short(logs.number(history["largest error"])),
        "operator_time": ours["time per sample"],
        "targets": str(len({row["target"] for row in targets})),
        "numbers": list(hashes),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description="Write the article, as PDF.")
    parser.add_argument("--seeds", type=int, default=SEEDS, help="noise seeds of the paper's study, 2 or more")
    parser.add_argument("--comparison", type=Path, default=logs.RESULTS, help="folder of compare-track.json and -rate")
    parser.add_argument("--out", type=Path, default=OUT)
    given = parser.parse_args()
    try:
        print(build(given.out, max(2, given.seeds), given.comparison))
    except ValueError as error:
        sys.exit(f"article: {error}")


if __name__ == "__main__":
    main()
