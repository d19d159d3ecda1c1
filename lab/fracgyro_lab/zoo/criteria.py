"""Criteria for the claims of the zoo: what decides each, and its verdict with the evidence."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from fracgyro.scenario import Scenario
from fracgyro.scenario.kinds import kinds_with
from fracgyro.simulation.simulate import DivergedError

from ..comparison.rows import ratio_of
from ..comparison.track import FORCE_LIMIT
from ..comparison.track_contenders import NO_LAWS
from ..verdicts import MIN_SHARE, Claim, Judged, share, verdicts
from . import extra
from .facts import Facts
from .laws import cell, contender_of, sensed_base
from .printed import Curves

SMALLER = 0.9  # a ratio of errors below which an improvement counts
SAME_TIME = 1.2  # a ratio of times below which they count as equal
FEW_SENT, SAME_ERROR = 0.5, 1.05  # an event trigger saves: share of forces sent, ratio of errors
STEADY = 1.1  # growth of a norm that counts as none
LATE = 5.0  # the published RMS errors are those after this time
Judgings = Mapping[str, Mapping[str, Any]]


@dataclass(frozen=True)
class Laws:
    """The tuned laws of a setting: their judgings by seed, and their scenarios."""

    judged: Judgings  # results of `Judging.measure`, by law
    scenarios: Mapping[str, Scenario]
    failed: Mapping[str, bool]  # True if a search has found nothing
    seeds: Sequence[int]  # held out

    def ratio(self, law: str, other: str) -> tuple[float, float, float] | None:
        """Ratio of the errors, with the interval over seeds and all pairs of searches; None if one is missing."""
        if law not in self.judged or other not in self.judged:
            return None
        found = ratio_of(self.judged[law], self.judged[other], self.failed[law], self.failed[other])
        low, value, high = (found[name] for name in ("low", "value", "high"))
        return None if value is None else (value, low or 0.0, math.inf if high is None else high)


@dataclass(frozen=True)
class Material:
    """Data for the verdicts on the claims of an entry, for one variant."""

    facts: Facts
    law: str  # name of its contender
    noisy: Laws
    exact: Laws  # without noise
    curves: Mapping[str, Curves]  # runs of the published code by name, as printed or as corrected

    @cached_property
    def scenario(self) -> Scenario:
        return self.noisy.scenarios[self.law]

    @property
    def few(self) -> Sequence[int]:
        return self.noisy.seeds[:8]


def _error_over(m: Material, other: str, words: str, most: float) -> Judged:
    return _ratio(m.noisy, m.law, other, words, most)


def _ratio(laws: Laws, law: str, other: str, words: str, most: float) -> Judged:
    found = laws.ratio(law, other)
    if found is None:
        return False, "a run diverged, or no gains were found."
    value, low, high = found
    return high < most, f"the error is {value:.3g} [{low:.3g}, {high:.3g}] times that {words}."


def beats_integral_action(m: Material) -> Judged:
    return _error_over(m, "network_constant", "with one constant node, an integral", SMALLER)


def beats_network(m: Material) -> Judged:
    return _error_over(m, "network", "of the same network without a prediction", SMALLER)


def beats_nodes(m: Material) -> Judged:
    return _error_over(m, "network", "of the plain network of 16 nodes", SMALLER)


def loops_help(m: Material) -> Judged:
    return _ratio(m.noisy, "network_loops", "network", "of a network without its loops", SMALLER)


def beats_unsupervised(m: Material) -> Judged:
    return _error_over(m, "fuzzy_direct", "without the supervisory term", SMALLER)


def beats_linear(m: Material) -> Judged:
    return _error_over(m, "linear", "of the linear surface", 1.0)


def less_chattering(m: Material) -> Judged:
    mine, theirs = (_chattering(m.noisy.judged.get(law)) for law in (m.law, "linear"))
    found = m.noisy.ratio(m.law, "linear")
    if mine is None or theirs is None or found is None:
        return False, "a run diverged, or no gains were found."
    held = mine < theirs and found[0] <= 1.0
    return held, f"chattering {mine:.2g} against {theirs:.2g} of the linear surface, with {found[0]:.3g} of its error."


def smaller_transient(m: Material) -> Judged:
    means = [_transient(m.noisy.judged.get(law)) for law in (m.law, "linear")]
    if None in means:
        return False, "a run diverged, or no gains were found."
    mine, theirs = (mean or math.nan for mean in means)
    return mine < SMALLER * theirs, f"transient RMS error {mine:.3g} against {theirs:.3g} of the linear surface."


def _transient(judged: Mapping[str, Any] | None) -> float | None:
    """The geometric mean of the transient errors on both axes."""
    if judged is None:
        return None
    values = [value for axis in "xy" for value in judged["metrics"][f"rmse_transient_{axis}"]]
    return None if None in values else math.exp(sum(map(math.log, values)) / len(values))


def saves(m: Material) -> Judged:
    return _saves(m, m.noisy)


def saves_without_noise(m: Material) -> Judged:
    return _saves(m, m.exact)


def _saves(m: Material, laws: Laws) -> Judged:
    if m.law not in laws.scenarios:
        return False, "no gains were found."
    try:
        found = extra.sending(laws.scenarios[m.law], laws.seeds[:4])
    except DivergedError as error:
        return False, f"{error}."
    held = any(share <= FEW_SENT and error <= SAME_ERROR for share, error in found.values())
    parts = ", ".join(f"{share:.0%} at {error:.2f} times the error" for share, error in found.values())
    limits = ", ".join(f"{threshold:g}" for threshold in found)
    return held, f"forces sent with thresholds of {limits}: {parts}."


def _chattering(judged: Mapping[str, Any] | None) -> float | None:
    if judged is None:
        return None
    means = []
    for axis in "xy":
        values: list[float | None] = judged["metrics"][f"chattering_{axis}"]
        known = [value for value in values if value is not None]
        if len(known) < len(values):
            return None
        means.append(sum(known) / len(known))
    return max(means)


def weights_bounded(m: Material) -> Judged:
    try:
        found = extra.drift(m.scenario, m.few[0])
    except DivergedError as error:
        return False, f"{error}."
    if found is None:
        return True, "nothing is learned."
    name, (tenth, half, end) = found
    words = f"{name.replace('_', ' ')} {tenth:.3g}, {half:.3g} and {end:.3g} after 1e5, 5e5 and 1e6 steps in noise."
    return end <= STEADY * half, words


def estimates_converge(m: Material) -> Judged:
    shares = extra.right_estimates(m.scenario, m.few)
    if not shares:
        return False, "the law estimates nothing."
    parts = ", ".join(f"{name} in {each:.0%}" for name, each in shares.items())
    return min(shares.values()) >= MIN_SHARE, f"at t = 80 within 5 %: {parts} of {len(m.few)} seeds."


def settles(m: Material) -> Judged:
    times = m.noisy.judged[m.law]["metrics"]["error_settling_time"]
    known = [time is not None for time in times]
    settled = sorted(time for time in times if time is not None)
    middle = f"{settled[len(settled) // 2]:.2g}" if settled else "never"
    return share(known) >= MIN_SHARE, (
        f"|e| stays below 0.01 q0 from t = {middle} (median), in {share(known):.0%} of seeds: near zero, not zero, as "
        "noise and the step keep an error."
    )


def fixed_time(m: Material) -> Judged:
    return _same_time(m, FORCE_LIMIT)


def fixed_time_free(m: Material) -> Judged:
    return _same_time(m, math.inf)


def _same_time(m: Material, most: float) -> Judged:
    """With the default gains and without learning, which the errors of far starts would mislead."""
    base = contender_of(m.law, m.facts).scenario(sensed_base(cell(m.facts.information, 0.0)))
    rests = {field: value for field, value in NO_LAWS.items() if base.controller.kind in kinds_with(field)}
    times = extra.convergence_times(base.replace({**rests, "controller.force_limit": most}))
    near, far = (times[start] for start in extra.STARTS[-2:])
    listed = ", ".join("never or lost" if time is None else f"{time:.2f}" for time in times.values())
    words = f"{'without a limit' if math.isinf(most) else f'with |u| <= {most:g}'} {listed}"
    held = near is not None and far is not None and far <= SAME_TIME * near
    return held, f"time to |e| < 0.02 from e(0) = 0.1, 1, 10, 100: {words}, with default gains and no learning."


def bound_kept(m: Material) -> Judged:
    if m.curves:
        curves = m.curves["fixed"]
        left = curves.leaves()
        if left is not None:
            return False, f"the bound is left at t = {left:.2f}."
        return True, f"largest |e|/bound {curves.largest_share():.2f}."
    shares = extra.largest_share(m.scenario, m.noisy.seeds)
    inside = [each < 1.0 for each in shares]
    return all(inside), (
        f"inside throughout in {share(inside):.0%} of {len(inside)} seeds; largest |e|/bound {max(shares):.2f}."
    )


def fixed_beats_finite(m: Material) -> Judged:
    fixed, finite = (m.curves[name].rms(LATE)[0] for name in ("fixed", "finite"))
    words = [
        f"{name} {'lost' if math.isnan(rms) else format(rms, '.4f')}"
        for name, rms in (("fixed time", fixed), ("finite time", finite))
    ]
    return fixed < finite, f"RMS of e_x after t = 5: {', '.join(words)}."


def time_bound(m: Material) -> Judged:
    given = {name: float(m.facts.given[name].value) for name in ("k1", "k2", "k3", "k4", "duration")}
    roots, cubes = min(given["k1"], given["k3"]), min(given["k2"], given["k4"])
    bound = 4.0 / roots + 6.0 / cubes
    return bound < given["duration"], f"the bound of the time is {bound:,.0f}, the run takes {given['duration']:g}."


CRITERIA: dict[str, tuple[str, Callable[[Material], Judged]]] = {
    "beats_integral_action": (
        f"error below {SMALLER:g} times that with one constant node, in the whole 95 % interval of all searches",
        beats_integral_action,
    ),
    "beats_network": (
        f"error below {SMALLER:g} times that of the same network without a prediction, in the whole 95 % interval",
        beats_network,
    ),
    "beats_nodes": (
        f"error below {SMALLER:g} times that of the plain network of 16 nodes, in the whole 95 % interval",
        beats_nodes,
    ),
    "loops_help": (
        f"error of the network with both loops below {SMALLER:g} times that without, in the whole 95 % interval",
        loops_help,
    ),
    "beats_unsupervised": (
        f"error below {SMALLER:g} times that without the supervisory term, in the whole 95 % interval",
        beats_unsupervised,
    ),
    "smaller_transient": (
        f"transient RMS error below {SMALLER:g} times that of the linear surface",
        smaller_transient,
    ),
    "saves": (
        f"some threshold sends at most {FEW_SENT:.0%} of the forces at {SAME_ERROR:g} times the error, in noise",
        saves,
    ),
    "saves_without_noise": (
        f"some threshold sends at most {FEW_SENT:.0%} of the forces at {SAME_ERROR:g} times the error, without noise",
        saves_without_noise,
    ),
    "beats_linear": ("error below that of the linear surface, with the whole 95 % interval", beats_linear),
    "less_chattering": ("chattering below that of the linear surface, at no larger an error", less_chattering),
    "weights_bounded": (f"norm after 1e6 steps at most {STEADY:g} times that after half of them", weights_bounded),
    "estimates_converge": (f"rate, D and K within 5 % at t = 80 in {MIN_SHARE:.0%} of seeds", estimates_converge),
    "settles": (f"|e| stays below 0.01 q0 from some time on in {MIN_SHARE:.0%} of seeds", settles),
    "fixed_time": (
        f"with |u| <= {FORCE_LIMIT:g} the time from e(0) = 100 is at most {SAME_TIME:g} times that from 10",
        fixed_time,
    ),
    "fixed_time_free": (
        f"without a force limit the time from e(0) = 100 is at most {SAME_TIME:g} times that from 10",
        fixed_time_free,
    ),
    "bound_kept": ("the error is within the prescribed bound at all times", bound_kept),
    "fixed_beats_finite": ("RMS error after t = 5 of the fixed-time run below that of the finite", fixed_beats_finite),
    "time_bound": ("the bound of the time is shorter than the run", time_bound),
}


def judge(facts: Facts, material: Mapping[str, Material]) -> list[Claim]:
    """Verdicts on the testable claims of an entry, for each variant."""
    testable = {
        str(number): (claim.text, *CRITERIA[claim.criterion])
        for number, claim in enumerate(facts.claim, 1)
        if claim.criterion
    }
    return verdicts(testable, material)
