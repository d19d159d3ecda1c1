"""The pages of the controllers on the documentation site: complete, from headers whose comments have the form."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import fracgyro as fg
import pytest
from fracgyro.scenario.kinds import KINDS, kinds_with

sys.path.append(str(Path(__file__).resolve().parents[2] / "docs/site"))
import comments
import controllers
import formulas
import picture

FIELDS = [f"{name}.{field}" for name, table in fg.Scenario() for field in type(table).model_fields]


@pytest.mark.parametrize("kind", KINDS)
def test_a_page_begins_with_what_it_is_and_when_to_use_it_and_has_law_parameters_and_pictures(kind: str) -> None:
    text, pictures = controllers.page(kind)
    title, first, rest = text.split("\n\n", 2)
    assert re.fullmatch(r"# \S.*", title)
    assert "Use it when " in " ".join(re.sub(r"\]\(.*?\)", "", first).split()[: comments.MAX_WORDS])
    assert "```math\n" in rest
    own = [field for field in FIELDS if kind in kinds_with(field) and len(kinds_with(field)) < len(KINDS)]
    assert [field for field in own if f"| `{field}` |" not in rest] == []
    assert list(pictures) == [f"controller-{kind}-{i}.svg" for i in range(2)]
    assert [name for name, drawn in pictures.items() if name not in rest or drawn.count("<path") < 5] == []


def test_a_controller_is_drawn_in_the_first_setup_whose_reference_it_follows() -> None:
    found = [picture.closed_loop(kind)[0] for kind in ("pid", "park_horowitz", "open_loop")]
    assert found == [0, 1, 2]


def test_short_runs_show_where_the_velocity_is_from() -> None:
    assert controllers.velocity("pid", "") == "estimated by the observer"
    assert controllers.velocity("lqg", "") == "estimated by its own filter"
    assert controllers.velocity("force_rebalance", "") == "not used"


COMMENT = ["PD: a spring and a damper.", "Use it when it serves.", "```math\nu\n```", "Source: textbook."]


def test_a_comment_of_the_form_is_read() -> None:
    found = comments.parsed([*COMMENT, "More."])
    assert found == comments.Comment(
        "PD", "A spring and a damper.", COMMENT[1], COMMENT[3], law=["```math\nu\n```", "More."]
    )


@pytest.mark.parametrize(
    ("paragraphs", "lacks"),
    [
        (["A spring and a damper.", *COMMENT[1:]], "must begin with its name, a colon and one sentence"),
        ([COMMENT[0], *COMMENT[2:]], "has no paragraph that begins with Use it when"),
        (COMMENT[:3], "has no paragraph that begins with Source:"),
        ([*COMMENT[:2], COMMENT[3]], "has no equation"),
        ([COMMENT[0], COMMENT[1] + " so" * 31, *COMMENT[2:]], "needs 41 words"),
    ],
)
def test_a_comment_without_the_form_is_refused(paragraphs: list[str], lacks: str) -> None:
    with pytest.raises(ValueError, match=lacks):
        comments.parsed(paragraphs)


@pytest.mark.parametrize(
    ("plain", "latex"),
    [
        ("u = (D̂₀ + 2Ω̂₀) ṙ", r"u = (\hat{D}_{0} + 2\hat{Ω}_{0}) \dot{r}"),
        ("k₁ |s|^½ sign(s)", r"k_{1} \vert s\vert ^{1/2} \operatorname{sign}(s)"),
        ("λ₁ D^(α-1) e", r"λ_{1} D^{α-1} e"),
        ("dΩ̂z/dt = -√2 ω f_y", r"\frac{\mathrm{d}\hat{Ω}_{z}}{\mathrm{d}t} = -\sqrt{2} ω f_{y}"),
        ("sat(s/δ) for ρ >= 0", r"\operatorname{sat}(s/δ) \text{ for } ρ \ge  0"),
        ("(½dyy - jδ) e²", r"(\tfrac{1}{2}d_{yy} - jδ) e^{2}"),
    ],
)
def test_an_equation_of_a_comment_becomes_latex(plain: str, latex: str) -> None:
    assert formulas.latex(plain) == latex


def test_each_equation_has_a_row() -> None:
    assert formulas.block(["a = 1  b = 2", "c = 3"]).count(r"\\") == 2


def test_a_character_without_latex_is_named() -> None:
    with pytest.raises(ValueError, match="the character ☃"):
        formulas.latex("u = ☃")
