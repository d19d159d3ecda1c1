"""The second stage for all records of one bias and temperature: quantities of the device, and tests."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from .diagnostics import REJECTED, Test
from .profile import Profile, intervals, scan
from .quantity import Quantity, functions, quantities, scales
from .structure import Group, Solution, Structure, best, solve

Array = NDArray[np.float64]

MAX_SKEW = 0.05  # deviation: a skew that is known worse is assumed to be zero
SMALL_SINGULAR = 1e-6  # singular value of the scaled Jacobian: a weaker direction is not determined
REMEDY = "turn the device at a known rate, or give pickoff_ratio"


@dataclass(frozen=True)
class Known:
    """Numbers that the user gives. `mass`, kg; `pickoff`, m per unit of x; `ratio` and `assumed`: (value, deviation),
    the latter by quantity, in the unit in which it is reported."""

    mass: float | None = None
    pickoff: float | None = None
    ratio: tuple[float, float] | None = None
    assumed: Mapping[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class Device:
    """Results of the second stage: quantities in SI, the solution in units of omega0, the profile, tests and notes."""

    quantities: dict[str, Quantity]
    problem: Structure
    solution: Solution
    profile: Profile
    tests: tuple[Test, ...]
    notes: tuple[str, ...]


def fit_device(groups: Sequence[Group], unit: float, known: Known) -> Device:
    """The device behind these groups. Raises ValueError for an assumption about an unknown quantity."""
    priors = _priors(groups, unit, known)
    problem = Structure(tuple(groups), unit, False, priors)
    notes = []
    if problem.known:
        free = Structure(tuple(groups), unit, True, priors)
        if _skew_is_seen(free):
            problem = free
    if not problem.skew:
        notes.append("the pick-offs are assumed at right angles: a known rate shows their skew")
    solution, freedom = best(problem), _freedom(problem)
    if "b2" in problem.names and "b1" in problem.names:
        skewed = replace(problem, skewed_drives=True)
        if freedom > 0 and chdtrc(freedom, solution.squares) < REJECTED:
            problem, solution, freedom = skewed, best(skewed), _freedom(skewed)
            notes.append("the drives are not at right angles: they do not show the pick-off ratio")
        else:
            notes.append("the drives are assumed at right angles")
    found, widen = [], 1.0
    if freedom > 0:
        p = float(chdtrc(freedom, solution.squares))
        words = f"the records agree on one device (chi^2 {solution.squares:.3g} on {freedom}, p = {p:.2g})"
        if p < REJECTED:
            widen = math.sqrt(solution.squares / freedom)
            words = (
                f"the records do not agree on one device (chi^2 {solution.squares:.3g} on {freedom}): intervals are "
                f"{widen:.2g} times wider; a temperature has changed, or a rate is wrong"
            )
        found.append(Test("agreement", "fail" if p < REJECTED else "pass", words, p))
    profile = scan(problem, solution, widen)
    shown = profile.points[0].solution
    reason = f"the coupling kxy is zero within its noise, so these records do not show it: {REMEDY}"
    named = quantities(intervals(problem, profile, functions(problem)), unit, known.mass, known.pickoff, {"": reason})
    if profile.open:
        notes.append(
            f"pickoff_ratio and dxy are not determined: {REMEDY}; intervals of the others cover ratios from 0.5 to 2"
        )
    elif shown is not solution:
        shown = solve(problem, shown.parameters)
    return Device(named, problem, shown, profile, tuple(found), tuple(notes))


def _freedom(problem: Structure) -> int:
    """Degrees of freedom of the sum of squares."""
    return sum(len(each.parameters) for each in problem.groups) + len(problem.priors) - len(problem.names)


def _priors(groups: Sequence[Group], unit: float, known: Known) -> dict[str, tuple[float, float]]:
    """Assumptions on the parameters of the second stage, in units of omega0."""
    priors = {}
    if known.ratio is not None:
        value, deviation = known.ratio
        priors["log_ratio"] = math.log(value), deviation / value
    allowed = Structure(tuple(groups), unit, True).names
    factors = scales(unit, known.mass, known.pickoff)
    for name, (value, deviation) in known.assumed.items():
        if name == "log_ratio" or name not in allowed:
            listed = ", ".join(each for each in allowed if each != "log_ratio")
            raise ValueError(f"assume has {name}: it must have one of {listed}")
        priors[name] = value / factors[name][0], deviation / factors[name][0]
    return priors


def _skew_is_seen(problem: Structure) -> bool:
    """True if the records determine the skew of the pick-offs, and the ratio still with it.

    At one known rate, K and D of nearly the same axes give only a combination of both.
    """
    found = best(problem)
    jacobian = problem.jacobian(found.parameters)
    norms = np.linalg.norm(jacobian, axis=0)
    if not (norms > 0).all():
        return False
    values = np.linalg.svd(jacobian / norms, compute_uv=False)
    deviation = math.sqrt(float(found.covariance[problem.names.index("skew"), problem.names.index("skew")]))
    if not (values[-1] > SMALL_SINGULAR * values[0] and deviation < MAX_SKEW):
        return False
    return not scan(problem, found).open
