"""What the faces outside Python are told of a scenario: every number, with its unit, range and meaning."""

from __future__ import annotations

import importlib.util
import json
import re
from pathlib import Path
from typing import Any

import fracgyro as fg
import pytest
from fracgyro.export import compilers, web
from fracgyro.export.settings import UNITS, core_numbers, path_of, settings

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


def module_fields(tmp_path: Path) -> dict[str, Any]:
    web.write_module_data(tmp_path / "fracgyro.json")
    data = json.loads((tmp_path / "fracgyro.json").read_text())
    assert data["fields"].keys() == data["paper"]["corrected"]["settings"].keys()
    fields: dict[str, Any] = data["fields"]
    return fields


def test_every_setting_has_its_type(tmp_path: Path) -> None:
    types = (ROOT / "faces/web/fracgyro.d.ts").read_text(encoding="utf-8").split("export interface Settings {")[1]
    typed = dict(re.findall(r'^  "([^"]+)": (.+);$', types, re.MULTILINE))
    fields = module_fields(tmp_path)
    assert list(typed) == list(json.loads((tmp_path / "fracgyro.json").read_text())["paper"]["corrected"]["settings"])
    for name, field in fields.items():
        if "choices" in field:
            assert typed[name] == " | ".join(f'"{choice}"' for choice in field["choices"])


def test_no_number_of_the_core_is_left_out(tmp_path: Path) -> None:
    derived = {"run.steps", "controller.order_gamma", "controller.mode_count", "controller.mode_error"}
    assert set(core_numbers(SHORT)) - set(module_fields(tmp_path)) == derived


def test_units_are_those_of_the_equations() -> None:
    text = (ROOT / "EQUATIONS.md").read_text(encoding="utf-8")
    rows = [[cell.strip() for cell in row.split("|")] for row in text.splitlines() if row.startswith("|")]
    listed = {row[4].strip("`"): row[2] for row in rows if len(row) == 8}
    signs = {"ω": "omega", "α": "alpha", "−": "-", "²": "^2", " ": "*", "–": "1"}
    for path, unit in UNITS.items():
        if path not in listed:
            assert path.startswith("adaptation.initial_")
            continue
        words = listed[path].removeprefix("unit ").replace(", ", "|").replace("N s/m", "N.s/m")
        for sign, word in signs.items():
            words = words.replace(sign, word)
        assert words == (unit if isinstance(unit, str) else "|".join(unit)), path


def test_a_setting_over_its_scale_is_the_cores_number_to_the_bit() -> None:
    scenario = OTHER
    numbers = core_numbers(scenario)
    found = settings(scenario)
    assert {path_of(setting.name) for setting in found} == set(UNITS)
    for setting in found:
        assert setting.value / setting.scale == numbers[setting.name], setting.name


def test_a_seed_that_no_double_holds_is_refused() -> None:
    scenario = SHORT.replace({"disturbance.seed": 2**53})
    with pytest.raises(ValueError, match=r"disturbance.seed is 9007199254740992: it must be below 2\^53"):
        core_numbers(scenario)


def test_zig_is_missed_in_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "ziglang" else find(name))
    with pytest.raises(ValueError, match="install ziglang from PyPI"):
        compilers.zig("version")
