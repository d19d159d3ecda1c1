"""`fracgyro reproduce`, `fracgyro compare` and `fracgyro enter`."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import click
from fracgyro.cli.completion import scenarios as scenario_names
from fracgyro.cli.options import controller_option
from fracgyro.cli.terminal import print_table, progress


@click.command()
@click.option("--out", default="out", show_default=True, metavar="DIR", help="Folder for the results.")
@click.option(
    "--seeds", type=int, metavar="N", help="Set the number of noise seeds for Table 1 and the claims.  [default: 100]"
)
@click.option("--quick", is_flag=True, help="Use 8 seeds: takes seconds.")
@click.option("--json", "as_json", is_flag=True, help="Print the verdicts as JSON.")
def reproduce(out: str, seeds: int | None, quick: bool, as_json: bool) -> None:
    """Rerun the paper and write a report. It has every figure, Table 1 and a verdict on every claim."""
    from .paper import reproduce as run_all

    with progress("starting") as show:
        result = run_all(out, seeds=seeds, quick=quick, progress=show)
    verdicts = [{"id": c.id, "variant": c.variant, "verdict": c.verdict} for c in result.claims]
    if as_json:
        click.echo(json.dumps({"report": str(result.report), "seconds": result.seconds, "claims": verdicts}))
        return
    by_claim: dict[str, dict[str, str]] = {}
    for claim in result.claims:
        by_claim.setdefault(f"({claim.id}) {claim.claim}", {})[claim.variant] = claim.verdict
    for text, both in by_claim.items():
        click.echo(f"{text}\n      as printed: {both['printed']}; as corrected: {both['corrected']}")
    click.echo(f"\n{result.seconds:.0f} s. Report: {result.report}")


def _listed(context: click.Context, parameter: click.Parameter, value: str | None) -> tuple[str, ...]:
    return tuple(word.strip() for word in value.split(",")) if value else ()


def _numbers(context: click.Context, parameter: click.Parameter, value: str | None) -> tuple[float, ...]:
    try:
        return tuple(map(float, value.split(","))) if value else ()
    except ValueError:
        raise click.BadParameter(f"{value}: it must be numbers, as in 0,1e-13") from None


def _without_password(context: click.Context, parameter: click.Parameter, value: str | None) -> str | None:
    if value and re.search(r"://[^/]*:[^/]*@|[?&]password=", value):
        raise click.UsageError(
            "--storage has a password, which every user of this machine can see in the list of processes: put it into "
            "~/.pgpass instead, see docs/cluster.md"
        )
    return value


@click.command()
@click.argument("task", metavar="TASK")
@click.argument("scenarios", nargs=-1, metavar="[SCENARIO...]", shell_complete=scenario_names)
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="DIR", help="Folder for the results.")
@click.option("--only", callback=_listed, metavar="A,B", help="Compare only these contenders.")
@click.option(
    "--class", "classes", callback=_listed, metavar="F,P", help="Select what is measured: F all, P positions only."
)
@click.option("--noise", callback=_numbers, metavar="N,N", help="Set the noise of positions in m/sqrt(Hz), as 0,1e-13.")
@controller_option("Add your own controller.")
@click.option("--trials", type=int, metavar="N", help="Limit the trials of each search to N.")
@click.option("--quick", is_flag=True, help="Run a quick preview: 20 trials, 2 seeds; gains are not tuned.")
@click.option("--resume", is_flag=True, help="Finish the comparison that DIR holds.")
@click.option("--scheduler", metavar="ADDRESS", help="Run on this Dask cluster, for example tcp://host:8786.")
@click.option(
    "--storage",
    callback=_without_password,
    metavar="ADDRESS",
    help="Store trials in this database, for example postgresql://host/name; the password is in ~/.pgpass.",
)
@click.option(
    "--searched",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Keep those searches of this earlier compare.json whose errors are still the same.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def compare(task: str, scenarios: tuple[str, ...], out: Path, as_json: bool, **options: Any) -> None:
    """Compare controllers on TASK, track or rate: tune each, judge all on unseen seeds and plants."""
    from .comparison import compare as run
    from .comparison.report import rank

    with progress("starting", rate="runs/s") as show:
        result = run(task, out, scenarios=scenarios, progress=show, **options)
    if as_json:
        click.echo(result.data.read_text(encoding="utf-8"))
        return
    what, over = ", ".join(result.task.error_words), f"over {result.task.over}"
    ranked = sorted(
        result.rows, key=lambda row: (row["scenario"], row["class"], row["noise"], row["ceiling"], *rank(row))
    )
    print_table(("contender", "class", "noise", "ceiling", what, over, "decided", ""), map(_line, ranked))
    click.echo(f"{result.seconds:.0f} s. Report: {result.report}, data: {result.data}")


def _line(row: dict[str, Any]) -> list[str]:
    error, ratio = row["metrics"].get("error", {}).get("value"), row["ratio"] or {}
    marks = "" if row["tuned"] or not row["trials"] else " (untuned)"
    low, high = (f"{ratio[end]:.3g}" if ratio.get(end) is not None else "-" for end in ("low", "high"))
    shown = f"{ratio['value']:.3g} [{low}, {high}]" if ratio.get("value") else "-"
    missing = "diverges" if row["diverged"] else "none kept the limits"
    cells = [row["name"] + marks, row["class"], f"{row['noise']:g}", f"{row['ceiling'] or '-'}"]
    remark = "" if row["kept"] or error is None else "beyond a limit"
    return [*cells, missing if error is None else f"{error:.3g}", shown, row["verdict"] or "-", remark]


@click.command()
@click.argument("law", metavar="LAW")
@click.option("--out", type=click.Path(path_type=Path), metavar="FILE", help="Write the entry to this JSON file.")
@click.option(
    "--class",
    "information",
    type=click.Choice(["F", "P"]),
    default="F",
    show_default=True,
    help="Select what is measured: F all, P positions only.",
)
@click.option("--author", metavar="NAME", help="Set the name shown on the board.")
@click.option("--check", "checked", is_flag=True, help="Reproduce LAW, an entry: run its law again and compare.")
def enter(law: str, out: Path | None, information: str, author: str | None, checked: bool) -> None:
    """Run a law through the task `track`, for the board.

    LAW is FILE.py, FILE.py:NAME, or the name of a compiled law. It runs in a process of its own, without network, in an
    empty folder, with limits of time and memory.
    """
    from fracgyro.extras import require
    from fracgyro.files import check_place

    require("study", "cmaes")
    from .board.check import check as run_again
    from .board.enter import enter as run
    from .board.enter import write

    if checked and (out or author):
        raise click.UsageError("--check takes neither --out nor --author")
    if not checked and out is None:
        raise click.UsageError("--out is missing: name the JSON file of the entry")
    if out is not None:
        check_place(out, b'{\n"f')
    with progress("starting", rate="runs/s") as show:
        if checked:
            entry = run_again(Path(law), progress=show)
        else:
            entry = run(law, information=information, author=author, progress=show)
    if out is not None:
        write(entry, out)
    print_table(("gains", "error", "chattering", "error over the limit", "steady"), map(_entered, entry.rows))
    click.echo(f"{law}: reproduced" if checked else f"Entry: {out}")


def _entered(named: tuple[str, Any]) -> list[str]:
    name, row = named
    words = name.replace("_", " ")
    if row is None:
        return [words, "-", "-", "-", "-"]
    over = row.over_limit
    numbers = (row.error.value, row.chattering, over and over.error, over and over.steady)
    return [words, *("-" if number is None else f"{number:.3g}" for number in numbers)]
