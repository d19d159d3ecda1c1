"""The paper's errata: the list is well formed, its evidence holds, and the documents match it."""

from __future__ import annotations

import math
import re
from pathlib import Path

import fracgyro as fg
import numpy as np
import pytest
import xarray as xr
from fracgyro.scenario.schema import ERRATA_SWITCHES
from fracgyro_lab.paper import errata_identities as identities
from fracgyro_lab.paper import errata_page, runs
from fracgyro_lab.paper import errata_runs as seen
from fracgyro_lab.paper.errata import ERRATA
from fracgyro_lab.paper.runs import Results
from fracgyro_lab.paper.table import farther_off, order_ranges

ROOT = Path(__file__).resolve().parents[2]
NUMBER = r"[-−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?"


def numbers(text: str) -> list[float]:
    return [float(each.replace("−", "-")) for each in re.findall(NUMBER, text)]


def after(text: str, words: str, count: int = 1) -> list[float]:
    """The first numbers after `words`, which the text must have."""
    assert words in text
    return numbers(text.split(words, 1)[1])[:count]


def groups(pattern: str, text: str) -> tuple[str, ...]:
    """Those of the first match, which the text must have."""
    match = re.search(pattern, text)
    assert match, pattern
    return match.groups()


@pytest.fixture(scope="module")
def found() -> Results:
    return Results(runs.record_all(), runs.study(4))


# -- The list ------------------------------------------------------------------------------------------------


def test_every_erratum_says_where_what_and_why_once() -> None:
    assert all(each for e in ERRATA for each in (e.where, e.printed, e.correct, e.why))
    assert len({e.where for e in ERRATA}) == len(ERRATA)


def test_every_field_of_an_erratum_is_one_of_the_scenario() -> None:
    scenario = fg.Scenario.paper()
    for field in (field for e in ERRATA for field in e.fields):
        table, name = field.split(".")
        assert hasattr(getattr(scenario, table), name), field


def test_the_first_three_errata_are_the_switches_of_the_two_readings() -> None:
    assert {field for e in ERRATA[:3] for field in e.fields} == set(ERRATA_SWITCHES)
    assert not {field for e in ERRATA[3:] for field in e.fields} & set(ERRATA_SWITCHES)


def test_every_evidence_is_that_of_one_erratum() -> None:
    for module, used in ((identities, [e.identity for e in ERRATA]), (seen, [e.runs for e in ERRATA])):
        public = {f for name, f in vars(module).items() if getattr(f, "__module__", "") == module.__name__}
        public = {f for f in public if callable(f) and not f.__name__.startswith("_")}
        assert public == {f for f in used if f}
        assert len(public) == sum(f is not None for f in used)


def test_the_evidence_of_an_erratum_is_that_of_the_program_and_of_the_runs(found: Results) -> None:
    e = next(e for e in ERRATA if e.where == "Remark 5")
    assert e.evidence(found) == f"{identities.resonances()} {seen.excitation(found)}"
    assert next(e for e in ERRATA if e.where == "(40)").evidence(found) == ""


# -- Identities ----------------------------------------------------------------------------------------------


def test_the_terms_of_equation_1_are_those_of_a_rotating_frame() -> None:
    text = identities.centrifugal_terms()
    assert after(text, "in (1) are ", 2) == after(text, "(Ω × r) is ", 2) == [-34 * 7 + 6 * 11, -29 * 11 + 6 * 7]
    assert after(text, "in the plane is ", 2) == [0, 0]


def test_odd_roots_of_negative_numbers_are_real() -> None:
    held, of = after(identities.odd_roots(), "of −n^p in ", 2)
    assert held == of == 15 * 9


def test_an_order_below_zero_integrates() -> None:
    text = identities.order_of_a_constant()
    assert after(text, "D^(α−1) is ") == [pytest.approx(1 / math.gamma(1.1), abs=5e-4)]
    assert after(text, "t = 1 and ") == [pytest.approx(2**0.1 / math.gamma(1.1), abs=5e-4)]
    assert after(text, "of (7) is ") == [0]


def test_the_singular_term_grows_without_bound_as_its_floor_falls() -> None:
    forces = after(identities.singular_term(), "the term takes ", 3)
    assert forces == pytest.approx([0.5 * 0.5 * floor**-0.5 for floor in (1e-4, 1e-6, 1e-8)])


def test_the_equivalent_control_leaves_the_disturbance() -> None:
    f, slope = re.findall(r"\d+/\d+", identities.equivalent_control())
    assert f == slope


def test_the_reaching_time_is_a_difference_of_roots() -> None:
    text = identities.reaching_time()
    start, end = 5**2 / 2, 3**2 / 2
    assert after(text, "from 5 to 3 takes ") == [pytest.approx((start**0.5 - end**0.5) * 2**0.5)]
    assert after(text, "/ε is ") == [pytest.approx((2 * (start - end)) ** 0.5)]
    assert after(text, "V̇ = ") == [0]


def test_the_second_integral_of_a_second_derivative_has_no_half() -> None:
    text = identities.second_integral()
    tau = np.linspace(1, 2, 100_001)
    once = np.concatenate([[0.0], np.cumsum(0.5 * 6 * (tau[1:] + tau[:-1]) * np.diff(tau))])
    twice = np.trapezoid(once, tau)
    assert after(text, "D^(2) e is ") == after(text, "e(t_r) is ") == [pytest.approx(twice, rel=1e-6)]
    assert after(text, "with ½ ") == [5.5]


@pytest.mark.parametrize(("layer", "power"), [("quadratic", 2), ("linear", 1)])
def test_inside_the_layer_v_falls_and_rises_as_the_erratum_says(layer: str, power: int) -> None:
    """V of (39) differentiated term by term, with (38), (44) and the force of (46)."""
    rng = np.random.default_rng(0)
    m, n, p, delta = 150.0, 120.0, 90.0, 0.06
    x = np.array([1.0, 1.6, 1.6])
    for _ in range(20):
        s = rng.uniform(0.1, 0.6) * delta * np.array([0.6, -0.8])
        q, v, f = rng.standard_normal((3, 2))
        d, k = (half + half.T for half in rng.standard_normal((2, 2, 2)))  # D̃, K̃
        z = rng.standard_normal()
        omega = np.array([[0.0, -z], [z, 0.0]])
        bounds, estimates = rng.uniform(0.1, 3.0, (2, 3))
        sizes = np.array([1.0, np.linalg.norm(q), np.linalg.norm(v)])
        size, rho, rho_hat = np.linalg.norm(s), bounds @ sizes, estimates @ sizes
        slope = (d + 2 * omega) @ v + k @ q + f - s / size * (size / delta) ** power * rho_hat
        moved = s @ slope
        moved += np.trace(d @ (-0.5 * m * (np.outer(v, s) + np.outer(s, v)))) / m
        moved += np.trace(k @ (-0.5 * n * (np.outer(q, s) + np.outer(s, q)))) / n
        moved += np.trace(omega @ (-p * (np.outer(v, s) - np.outer(s, v)))) / p
        moved -= ((bounds - estimates) / x) @ (x * size * sizes)
        expected = s @ f - size * rho + size * rho_hat * (1 - (size / delta) ** power)
        assert moved == pytest.approx(expected)
    text = identities.layer_dissipation()
    (found,) = map(float, groups(rf"({NUMBER}) ‖s‖ρ with the {layer} layer", text))
    assert found == -1 + 2 * (1 - 0.25**power)


def test_one_kilohertz_is_not_a_thousand_radians_per_second() -> None:
    text = identities.unit_of_frequency()
    for words, rate in (("From (47): kxx = ", 1e3), ("in (48); kxx = ", 2e3 * math.pi)):
        assert after(text, words) == [pytest.approx(63.955 / (1.8e-7 * rate**2), rel=1e-3)]
    assert "kxx = 355.3, kyy = 532.9, Ωz = 0.1 with 1000 rad/s" in text


def test_the_resonances_are_those_of_the_plant() -> None:
    found = after(identities.resonances(), "resonances are ", 2)
    mean, half = (355.3 + 532.9) / 2, math.hypot((532.9 - 355.3) / 2, 70.99)
    assert [each**2 for each in found] == pytest.approx([mean - half, mean + half], rel=0.01)
    assert after(identities.resonances(), "that has ", 2) == pytest.approx([math.pi, math.pi / 2], rel=2e-3)


def test_the_figures_go_on_to_19() -> None:
    assert numbers(identities.last_figure()) == [3, 19]


# -- Runs ----------------------------------------------------------------------------------------------------


def test_the_printed_law_leaves_the_rate_where_it_is(found: Results) -> None:
    text = seen.rate_law(found)
    assert after(text, "moves by ")[0] == 0
    assert after(text, "grows to ")[0] > 1
    assert after(text, "moves by up to ")[0] > 1


def test_the_slope_of_the_integral_is_riemann_and_liouvilles_derivative(found: Results) -> None:
    text = seen.derivative(found)
    names = ("Caputo", "Liouville")
    caputo, riemann = (float(groups(rf"{name} derivative by ({NUMBER})", text)[0]) for name in names)
    assert riemann < 0.1 * caputo


def test_the_surface_wanders_in_the_printed_layer(found: Results) -> None:
    printed = after(seen.layer(found), "‖s‖ is ")[0]
    assert printed > 1.5 * after(seen.layer(found), "layer and ")[0]


def test_the_bound_never_stops_and_ends_the_loop(found: Results) -> None:
    bounds = numbers(seen.bound(found).replace("b̂0", ""))[::2]
    assert bounds == sorted(set(bounds))
    text = seen.end(found)
    gains = numbers(text.split("ρh/δ is ")[1].split(";")[0])
    assert gains == sorted(gains)
    assert after(text, "diverges at t = ")[0] < 5000
    assert after(text, "units is ")[0] < 1e-3


def test_a_gaussian_exceeds_the_bound(found: Results) -> None:
    assert after(seen.gaussian(found), "of the run is ")[0] > 4
    assert after(seen.gaussian(found), "bound in ")[0] > 1


def test_only_the_integer_surface_is_left_without_a_tail(found: Results) -> None:
    assert after(seen.finite_time(found), "still ")[0] > 1e-6
    sizes = dict(re.findall(rf"({NUMBER}) \((\w+)\)", seen.tail(found)))
    sizes = {name: float(size) for size, name in sizes.items()}
    assert min(sizes["proposed"], sizes["fractional"]) > 10 * sizes["conventional"]


def test_an_unequal_gain_drives_the_off_diagonal_entries_apart(found: Results) -> None:
    text = seen.symmetry(found)
    xy, yx = after(text, "D̂xy at ")[0], after(text, "D̂yx at ")[0]
    assert xy == pytest.approx(0.5 * yx, rel=0.01)  # 75 and 150


def test_the_sides_of_equation_28_agree_as_corrected_only(found: Results) -> None:
    text = seen.second_integral(found)
    printed, corrected = (
        [float(each) for each in groups(rf"({NUMBER}) and ({NUMBER}) as {reading}", text)]
        for reading in ("printed", "corrected")
    )
    assert corrected[0] == pytest.approx(corrected[1], rel=0.02)
    assert printed[0] != pytest.approx(printed[1], rel=0.05)
    assert printed[0] != pytest.approx(corrected[0], rel=0.05)
    assert abs(after(text, "(t − t_r), is ")[0]) > abs(corrected[0])


def test_the_singular_term_is_part_of_the_force(found: Results) -> None:
    assert after(seen.singular_term(found), "the term is ")[0] > 1


@pytest.mark.parametrize("layer", ["quadratic", "linear"])
def test_v_rises_inside_the_layer_whatever_the_step(found: Results, layer: str) -> None:
    text = seen.layer_dissipation(found)
    share, *rises = after(text, f"with the {layer} layer V rises in ", 4)
    assert share > 90
    assert min(rises) > 0.9 * max(rises) > 0.05


def test_excitation_does_not_move_the_rate_as_printed(found: Results) -> None:
    text = seen.excitation(found)
    assert after(text, "normalized information ")[0] > 0.1
    assert after(text, "nevertheless moves by ")[0] == 0
    assert after(text, "corrected, it is ")[0] > 5


def test_orders_differ_only_beyond_the_noise_of_their_seeds() -> None:
    means = {0.1: 5.0, 0.2: 5.0, 0.5: 2.01, 0.7: 5.0, 1.0: 2.0}  # with spread 1
    spread = np.sin(np.arange(20.0) ** 2)

    def metrics(order: float) -> xr.Dataset:
        rmse = (means.get(order, 1.0) + np.roll(spread, int(10 * order) % 10)).reshape(-1, 1, 1)
        return xr.Dataset({"rmse": (["run", "window", "axis"], rmse)}, coords={"window": ["whole"], "axis": ["y"]})

    study = {("printed", "proposed", order): metrics(order) for order in runs.ORDERS}
    assert farther_off(study, "printed", "whole", "y") == [0.1, 0.2, 0.7]
    assert order_ranges([0.1, 0.2, 0.7]) == "0.1 to 0.2, 0.7"
    assert order_ranges([]) == "no order"


def test_low_orders_are_farther_from_the_reference_than_the_integer_one(found: Results) -> None:
    text = seen.table(found)
    printed, corrected = re.findall(r"as \w+, over the whole run ([^;]*?), after t = 10 ([^;]*?)(?:;|\.$)", text)
    assert printed[0] == "0.1 to 0.5 on x and 0.1 to 0.8 on y"
    assert corrected[1] == "0.1 to 0.9 on x and 0.1 to 0.9 on y"


# -- Documents -----------------------------------------------------------------------------------------------


def read(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def test_the_page_and_the_table_are_those_of_the_list() -> None:
    assert read("docs/errata.md") == errata_page.page(), "make it again, as its first lines say"
    assert read("EQUATIONS.md").split("theory.\n\n")[-1] == errata_page.table(), "make it again, as the lines above say"


def test_every_count_of_errata_is_that_of_the_list() -> None:
    texts = {path: path.read_text(encoding="utf-8") for path in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]}
    texts[ROOT / "lab/article/article.typ"] = read("lab/article/article.typ")
    counts = {
        str(path): found for path, text in texts.items() if (found := re.findall(r"\b(\w+)\W{1,2}errata\b", text))
    }
    spelled = r"one|two|three|four|five|six|seven|eight|nine|\w*ten|eleven|twelve|\w+teen|twenty\w*|thirty\w*|\d+"
    stated = {path: {each for each in found if re.fullmatch(spelled, each)} for path, found in counts.items()}
    assert {each for found in stated.values() for each in found} == {str(len(ERRATA))}
    assert str(len(ERRATA)) in stated[str(ROOT / "docs/paper.md")]


def test_the_orders_farther_off_are_those_of_the_committed_table() -> None:
    assert "it is farther off on y from α = 0.1 to 0.8" in " ".join(read("docs/paper.md").split())
    table = read("docs/best_order.md").split("## The same as printed")[1].split("\n## ")[0]
    heads = [head.strip() for head in groups(r"(\| α .*)", table)[0].strip("|").split("|")]
    rows = [
        [numbers(cell) for cell in line.strip("|").split("|")]
        for line in re.findall(r"^\| [01]\.?\d? \|.*", table, re.M)
    ]
    whole_y = {row[0][0]: row[heads.index("whole y, 10⁻³")][0] for row in rows}
    assert {order for order in whole_y if whole_y[order] > whole_y[1.0]} == {0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8}
