"""The reference of exported firmware, if it is not a sine about 0 on each axis."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ..scenario import Scenario
from ..scenario.kinds import numbers
from ..scenario.to_core import core_numbers
from .initializers import float_text, list_text
from .settings import reference_lists


def course(scenario: Scenario) -> list[str]:
    """Definition of the constant `course`, in double precision whatever the controller is in."""
    fields: dict[str, list[float]] = {}
    values_by_name = core_numbers(scenario)
    for number in numbers(scenario.controller.kind):
        if number.table == "reference":
            fields.setdefault(number.field, []).append(values_by_name[number.name])
    kinds = ", ".join(f"fracgyro::ReferenceKind{{{int(kind)}}}" for kind in fields.pop("kind"))
    params = {
        name: list_text(values, "double") if len(values) > 1 else float_text(values[0], "double")
        for name, values in fields.items()
    }
    given = [f".kind = {{{{{kinds}}}}}", *(f".{name} = {text}" for name, text in params.items())]
    terms, rows = reference_lists(scenario)
    lists = {"SineTerm": (terms, (2, 2, 2)), "TableRow": (rows, (1, 2, 2, 2))}
    lines, members = [], []
    for (kind, (flat, widths)), name in zip(lists.items(), ("terms", "rows"), strict=True):
        if flat:
            lines += [f"constexpr fracgyro::{kind} {name}[] = {{", *_structs(flat, widths), "};"]
            members.append(f".{name} = {name}")
    step = f".step = {float_text(scenario.run.step, 'double')}"
    body = ", ".join([".at = &fracgyro::course_at", f".params = {{{', '.join(given)}}}", step, *members])
    return [*lines, f"constexpr fracgyro::Course course{{{body}}};", ""]


def _structs(flat: Sequence[float], widths: tuple[int, ...]) -> Iterator[str]:
    """Initializers of structs whose members have these widths."""
    for at in range(0, len(flat), sum(widths)):
        members, begin = [], at
        for width in widths:
            values = flat[begin : begin + width]
            members.append(float_text(values[0], "double") if width == 1 else f"{{{list_text(values, 'double')}}}")
            begin += width
        yield f"    {{{', '.join(members)}}},"
