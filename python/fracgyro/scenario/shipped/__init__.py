"""The scenarios that come with the package: the paper's, and devices from the literature, each number with its source.

Fields that hardware needs and the paper lacks are the same for all devices; they are in common.toml.
`Scenario.shipped` reads these texts.
"""

from __future__ import annotations

from importlib.resources import files

# Name: description.
SHIPPED = {
    "hardware": "the paper's with what hardware needs: bounded for good, within a force limit",
    "paper_thermal": "the paper's gyroscope and reference, with only thermal noise",
    "paper_resonance": "the paper's gyroscope driven at its resonances, with a realistic force limit",
    "dual_mass": "a dual-mass gyroscope in vacuum, 3925 and 3978 Hz",
    "tuned_in_air": "a gyroscope tuned to near-equal modes, in air",
    "disc": "a mode-matched disc with a quality factor of 2e6",
    "dual_mass_volts": "the dual-mass gyroscope with its electrodes and amplifiers",
    "tuned_in_air_volts": "the gyroscope in air with its electrodes and amplifiers",
    "baw_disc": "a disc of bulk waves at 976 kHz with its electrodes and amplifiers",
}
NAMES = {
    "paper": "the paper's, corrected, every field explained",
    "paper-printed": "the paper's, as printed",
    **SHIPPED,
}
COMMON = "common"


def shipped_text(name: str) -> str:
    """The TOML of a device of SHIPPED, with its sources."""
    head, *tables = _parts(name)
    added = {part.partition("\n")[0]: part for part in _parts(COMMON)[1:]}
    titles = [part.partition("\n")[0] for part in tables]
    tables = [part + added.pop(title, title).removeprefix(title) for title, part in zip(titles, tables, strict=True)]
    merged = [*tables, *added.values()]
    return "\n\n".join([head, *merged]) + "\n"


def _parts(name: str) -> list[str]:
    """The head of a file and each of its tables, without the blank lines between them."""
    lines = (files(__package__) / f"{name}.toml").read_text(encoding="utf-8").splitlines()
    starts = [number for number, line in enumerate(lines) if line.startswith("[")]
    return ["\n".join(lines[a:b]).strip() for a, b in zip([0, *starts], [*starts, None], strict=True)]
