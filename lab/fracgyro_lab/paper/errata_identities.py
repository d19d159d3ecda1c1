"""Evidence for the paper's errata without runs: identities, in exact arithmetic or by the package's own operators."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from itertools import product
from math import isqrt

import numpy as np
from fracgyro import fractional
from fracgyro.scenario import Scenario
from fracgyro.simulation.controller import Controller

from .figures import FIGURES
from .runs import PAPER_ORDER, scenario


def centrifugal_terms() -> str:
    """Ω × (Ω × r) of integers, against the terms in (1)."""
    rate, place = np.array([2, 3, 5]), np.array([7, 11, 0])
    found = np.cross(rate, np.cross(rate, place))[:2]
    x, y, z = rate
    of_one = [-(y**2 + z**2) * place[0] + x * y * place[1], -(x**2 + z**2) * place[1] + x * y * place[0]]
    coriolis = 2 * np.cross([x, y, 0], [13, 17, 0])[:2]  # with Ωz = 0
    return (
        f"For Ω = (2, 3, 5), r = (7, 11, 0) the terms of x and y in (1) are {_pair(of_one)}; Ω × (Ω × r) is "
        f"{_pair(found)}. With Ωz = 0 the Coriolis force in the plane is {_pair(coriolis)}."
    )


def _pair(values: Iterable[int]) -> str:
    return " and ".join(f"{value}".replace("-", "−") for value in values)


def odd_roots() -> str:
    """(−nᵖ)^(q/p) = −n^q, by integers."""
    odd = [(p, q) for p, q in product(range(1, 12, 2), repeat=2) if p > q]
    equal = [(-(n**q)) ** p == (-(n**p)) ** q for p, q in odd for n in range(1, 10)]
    return (
        "(−8)^(1/3) = −2, since (−2)³ = −8. For odd p > q up to 11 and n up to 9, the p-th power of −n^q is the q-th "
        f"power of −n^p in {sum(equal)} of {len(equal)} cases, by integers."
    )


def order_of_a_constant() -> str:
    """D^(α−1) and D^α of 1, which only an integral takes to something that grows."""
    step, constant = 1e-3, np.ones(2001)
    integral = fractional.integral(constant, 0 * constant, step, 1 - PAPER_ORDER)
    derivative = fractional.caputo(constant, 0 * constant, step, PAPER_ORDER)
    return (
        f"Of the constant 1, D^(α−1) is {integral[1000]:.3f} at t = 1 and {integral[2000]:.3f} at t = 2: it grows. The "
        f"derivative D^α of (7) is {abs(derivative[1000]):.3f}."
    )


def singular_term() -> str:
    """The controller's force at e = 0, ė = 1, by its floor."""
    forces = []
    for floor in (1e-4, 1e-6, 1e-8):
        base = scenario("corrected", "proposed").replace({"controller.singularity_floor": floor})
        at, moving = base.reference, np.array([1.0, 0.0])
        start = np.array(at.amplitude) * np.sin(at.phase)
        slope = np.array(at.amplitude) * np.array(at.frequency) * np.cos(at.phase)
        with_it, without = (
            Controller(s).step(0.0, position=start, velocity=slope + moving)[0]
            for s in (base, base.replace({"controller.kind": "fractional"}))
        )
        forces.append(without - with_it)
    return (
        "At e = 0, ė = 1 the term takes "
        + ", ".join(f"{force:.4g}" for force in forces)
        + " of the force with |e| floored at 1e-4, 1e-6, 1e-8: a tenfold force for a hundredth of the floor."
    )


def equivalent_control() -> str:
    """(18) inserted in (17), with rational numbers in place of its symbols."""
    numbers = iter(Fraction(n * n + 1, 2 * n + 1) for n in range(1, 12))
    velocity_terms, stiffness_terms, reference, fractional_term, terminal, f = (next(numbers) for _ in range(6))
    equivalent = velocity_terms + stiffness_terms + reference - fractional_term - terminal  # (18)
    slope = equivalent + f - velocity_terms - stiffness_terms - reference + fractional_term + terminal  # (17)
    return f"With rational numbers in place of all terms, f = {f}: (18) in (17) leaves ṡ = {slope}."


def reaching_time() -> str:
    """|s| from 5 to 3 at the rate ε = 1, and a disturbance that (12) allows and that holds s."""
    start, end, rate = 5, 3, 1
    difference = 2 * (Fraction(start**2, 2) - Fraction(end**2, 2))
    printed = Fraction(isqrt(int(difference)), rate)  # the root of 16
    correct = Fraction(start - end, rate)  # √2 √V = |s|
    s, bound = np.array([3, 4]), 5
    held = s @ s - isqrt(s @ s) * bound  # sᵀf − ‖s‖ρ for f = s
    return (
        f"|s| that falls at ε = 1 from 5 to 3 takes {correct}, the difference of roots; √(2 (V(0) − V(t_r)))/ε is "
        f"{printed}. With s = (3, 4), ρ = 5, f = (3, 4): V̇ = {held}."
    )


def second_integral() -> str:
    """D^(−2) D^(2) of t³ from 1 to 2, as the integral of an integral of 6t."""
    begin, end = Fraction(1), Fraction(2)
    # ∫ from 1 to τ of 6t is 3τ² − 3, and the integral of that from 1 to t is t³ − 1 − 3 (t − 1).
    twice = (end**3 - begin**3) - 3 * (end - begin)
    whole, half = (end**3 - part * 3 * begin**2 * (end - begin) - begin**3 for part in (Fraction(1), Fraction(1, 2)))
    return (
        f"For e = t³, t_r = 1, t = 2: D^(−2) D^(2) e is {twice}; e − ė(t_r)(t − t_r) − e(t_r) is {whole}, and with ½ "
        f"{float(half):g}."
    )


def layer_dissipation() -> str:
    """V̇ of (46) at a quarter of the layer, without a disturbance and with a bound estimate of twice the bound."""
    bound, estimate, share = Fraction(1), Fraction(2), Fraction(1, 4)
    rates = {name: -bound + estimate * (1 - gain) for name, gain in (("quadratic", share**2), ("linear", share))}
    return (
        "At ‖s‖ = δ/4 with f = 0 and ρ̂ = 2ρ, V̇ is "
        + " and ".join(f"{float(rate):+g} ‖s‖ρ with the {name} layer" for name, rate in rates.items())
        + "; without it −‖s‖ρ."
    )


def unit_of_frequency() -> str:
    """K of (48) from (47), by either reading of 1 kHz."""
    paper = Scenario.paper()
    cycles = paper.replace({"plant.reference_frequency": 2000 * np.pi})
    found = [s.plant.nondimensional() for s in (paper, cycles)]
    shown = [
        f"kxx = {stiffness[0]:.4g}, kyy = {stiffness[2]:.4g}, Ωz = {rate:.3g}" for _, stiffness, rate, _, _ in found
    ]
    return f"From (47): {shown[0]} with 1000 rad/s, as in (48); {shown[1]} with 2π · 1000 rad/s."


def resonances() -> str:
    """Resonances of the plant, compared with the frequencies of the reference."""
    paper = scenario("corrected", "proposed")
    xx, xy, yy = paper.plant.nondimensional()[1]
    plant = np.sqrt(np.linalg.eigvalsh([[xx, xy], [xy, yy]]))
    return (
        f"The plant's resonances are {plant[0]:.3g} and {plant[1]:.3g} ω0, whatever the reference; that has "
        f"{paper.reference.frequency[0]:.3g} and {paper.reference.frequency[1]:.3g}."
    )


def last_figure() -> str:
    return f"This reproduction draws Figures {min(FIGURES)} to {max(FIGURES)}, each of which the text refers to."
