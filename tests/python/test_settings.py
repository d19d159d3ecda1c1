"""Settings of a scenario for integrations outside Python: every number, with its unit, range and meaning."""

from __future__ import annotations

import importlib.util
import json
import re
from pathlib import Path
from typing import Any

import fracgyro as fg
import pytest
from fracgyro.export import compilers
from fracgyro.export.settings import core_numbers, offered, settings, unit
from fracgyro.export.web import settings_types, web, write_module_data
from fracgyro.scenario.kinds import KINDS, numbers, reports

BESIDES = {
    "run.duration",
    "run.record_every",
    "run.kernel_tolerance",
    "device.sensing",
    "controller.filter",
    "controller.observer_bandwidth",
    "controller.event_threshold",
    "controller.event_share",
    "controller.compensation_bandwidth",
    "datasheet.pickoff_gain_error[0]",
    "datasheet.pickoff_gain_error[1]",
    "datasheet.pickoff_misalignment",
}
ROOT = Path(__file__).resolve().parents[2]
SHORT = fg.Scenario.paper()
OTHER = SHORT.replace(
    {
        "plant.mass": 2.3e-7,
        "plant.reference_frequency": 1100.0,
        "plant.stiffness_deviation": {"xx": 1.0, "xy": 0.1, "yy": -1.0},
        "plant.centrifugal": True,
    }
)


def module_data(tmp_path: Path) -> dict[str, Any]:
    write_module_data(tmp_path / "fracgyro.json")
    data: dict[str, Any] = json.loads((tmp_path / "fracgyro.json").read_text())
    return data


def types_of(kind: str) -> dict[str, str]:
    """TypeScript's types of the settings of one kind, by name."""
    found: dict[str, str] = {}
    for head, body in re.findall(r"^export interface ([\w ]+) {\n(.*?)^}", settings_types(), re.MULTILINE | re.DOTALL):
        members = dict(re.findall(r'^  "([^"]+)": (.+);$', body, re.MULTILINE))
        if head == "CommonSettings" or f'"{kind}"' in members["controller.kind"]:
            found |= members
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_every_setting_of_every_kind_has_its_type_and_meaning(kind: str, tmp_path: Path) -> None:
    fields, typed = module_data(tmp_path)["fields"], types_of(kind)
    web(SHORT.replace({"controller.kind": kind}), tmp_path / "own.json", unbounded=True)
    said = json.loads((tmp_path / "own.json").read_text())["settings"]
    assert set(typed) == set(said) == {"controller.kind", *(n.name for n in offered(kind)), *BESIDES}
    words = {True: "boolean", False: "boolean"}
    for name, value in said.items():
        field = fields[name]
        assert field["description"]
        if name == "controller.kind":
            assert kind in field["choices"]
        elif "choices" in field:
            assert value in field["choices"]
            assert typed[name] == " | ".join(dict.fromkeys(words.get(c, f'"{c}"') for c in field["choices"])), name
        else:
            assert typed[name] == ("number | null" if field.get("infinite") else "number"), name


def test_the_types_that_are_written_are_those_and_every_name_in_them_is_known(tmp_path: Path) -> None:
    text = settings_types()
    interfaces = re.findall(r"^export interface (\w+)", text, re.MULTILINE)
    union = text.splitlines()[-1]
    assert union == f"export type Settings = {' | '.join(interfaces[1:])};"
    head = (ROOT / "integrations/web/fracgyro.d.ts").read_text(encoding="utf-8")
    assert "Settings {" not in head
    assert "NameOf<Settings>" in head


def test_no_number_of_the_core_is_left_out(tmp_path: Path) -> None:
    data = module_data(tmp_path)
    assert list(data["kinds"]) == list(KINDS)
    found_by_the_module = {"run.steps", "controller.order_gamma", "controller.kernel_terms", "controller.kernel_error"}
    for kind, described in data["kinds"].items():
        names = [number.name for number in numbers(kind)]
        assert len(described["numbers"]) == len(names)
        left_out = {name for name, said in zip(names, described["numbers"], strict=True) if said != name}
        assert left_out <= found_by_the_module
        assert set(names) - set(data["fields"]) == left_out | {"run.steps"}
        assert [len(columns) for columns in described["reported"]] == [sum(c.width for c in cs) for cs in reports(kind)]


def test_units_are_those_of_the_equations() -> None:
    text = (ROOT / "EQUATIONS.md").read_text(encoding="utf-8")
    rows = [[cell.strip() for cell in row.split("|")] for row in text.splitlines() if row.startswith("|")]
    listed = {row[4].strip("`"): row[2] for row in rows if len(row) == 8}
    signs = {"ω": "omega", "α": "alpha", "γ": "gamma", "ρ": "rho", "μ": "mu", "ν": "nu"}
    signs |= {"−": "-", "²": "^2", "³": "^3", " ": "*", "–": "1"}
    units: dict[str, list[str]] = {}
    for number in (number for kind in KINDS for number in offered(kind) if not number.choices):
        said = units.setdefault(number.path, [])
        if unit(number) not in said:
            said.append(unit(number))
    compared = {path: "|".join(said) for path, said in units.items() if path in listed}
    assert len(compared) > 40
    for path, said in compared.items():
        words = listed[path].removeprefix("unit ").replace(", ", "|").replace("N s/m", "N.s/m")
        for sign, word in signs.items():
            words = words.replace(sign, word)
        assert words == said, path


def test_a_setting_over_its_scale_is_the_cores_number_to_the_bit() -> None:
    scenario = OTHER
    of_core = core_numbers(scenario)
    found = settings(scenario)
    assert {setting.name for setting in found if setting.scale != 1.0} > {"plant.damping.xx", "plant.angular_rate"}
    for setting in found:
        assert setting.value / setting.scale == of_core[setting.name], setting.name


def test_a_seed_that_no_double_holds_is_refused() -> None:
    scenario = SHORT.replace({"disturbance.seed": 2**53})
    with pytest.raises(ValueError, match=r"disturbance.seed is 9007199254740992: it must be below 2\^53"):
        core_numbers(scenario)


def test_zig_is_missed_in_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "ziglang" else find(name))
    with pytest.raises(ValueError, match="install ziglang from PyPI"):
        compilers.zig("version")
