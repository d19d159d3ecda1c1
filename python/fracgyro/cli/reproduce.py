"""`fracgyro reproduce` and `fracgyro selfcheck`."""

from __future__ import annotations

import json
from dataclasses import asdict

import click

from .terminal import progress


@click.command()
@click.option("--out", default="out", show_default=True, metavar="DIR", help="Folder for the results.")
@click.option(
    "--seeds", type=int, metavar="N", help="Set the number of noise seeds for Table 1 and the claims.  [default: 100]"
)
@click.option("--quick", is_flag=True, help="Use 8 seeds: takes seconds.")
@click.option("--json", "as_json", is_flag=True, help="Print the verdicts as JSON.")
def reproduce(out: str, seeds: int | None, quick: bool, as_json: bool) -> None:
    """Rerun the paper and write a report. It has every figure, Table 1 and a verdict on every claim."""
    from ..paper import reproduce as run_all

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


@click.command()
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def selfcheck(as_json: bool) -> None:
    """Recompute the published parity hashes, for problem reports. Exit with 1 if they differ."""
    from ..parity import selfcheck as check

    found = check()
    if as_json:
        click.echo(json.dumps({**asdict(found), "sound": found.sound}))
    else:
        click.echo(
            f"fracgyro {found.version}, Python {found.python}, NumPy {found.numpy}, compiled by {found.compiler}"
        )
        click.echo(f"processor: {found.processor}; lanes of {found.lanes}")
        for number, hashed in found.hashes.items():
            expected = found.published[number]
            verdict = "as published" if hashed == expected else f"NOT the published {expected}"
            click.echo(f"parity hash, {number}: {hashed}, {verdict}")
    if not found.sound:
        raise click.exceptions.Exit(1)
