"""The work of an entry: as given, tuned with a small effort, and under changes; raw results by seed.

It runs in the process of the law (inside.py). The task, its errors and its changes are those of `compare track`.
"""

from __future__ import annotations

import inspect
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import numpy as np
from fracgyro.scenario import Scenario, ScenarioError
from fracgyro.simulation.controller import Controller
from fracgyro.simulation.measure import measure_many
from fracgyro.simulation.native import Law
from fracgyro.simulation.own_file import ControllerFile
from fracgyro.simulation.simulate import simulate
from fracgyro.simulation.user_controller import ControllerLike
from fracgyro.study.tune.criteria import Measured

from ..comparison.contender import Contender
from ..comparison.own import GAIN, controller_of, own_contender
from ..comparison.task import Cell, Changes, sensed
from ..comparison.track import CHATTERING, HIGH, Track
from ..comparison.tuning import CONFIRMED, Tuning
from . import entrant
from .guard import Guard

NOISE = 1e-13  # density of the measured position, m/sqrt(Hz)
CEILING = HIGH  # largest chattering of the tuned row
TRIALS, SEARCH_SEEDS, TRAINING, JUDGING, FEW = 80, 2, 4, 8, 2
CHANGES = [
    *("K +5 %", "K -5 %", "D +5 %", "dxy +10 %", "kxy +300 deg/s", "rate -300 deg/s", "noise x 3"),
    *("one step of hidden delay", "12 bit", "0.7 of the force"),
]
PUSH: dict[str, Any] = {"kind": "pulse", "amplitude": (100.0, 100.0), "start": 12.0, "width": 0.5}
TIMED_STEPS, TIMED = 5000, 5
HOPELESS = 1.5  # a law is refused at once if it needs the time limit times this
WINDOWS = 60  # numbers of the trace
BETTER, SPREADS = math.log(1.2), 5.0  # a law that knows the seeds has an error smaller by more than both
Progress = Callable[[float, float, str], object]


def cell(information: str) -> Cell:
    """The setting of all entries of a class."""
    return Cell("paper", information, NOISE, CEILING)


def base(information: str) -> Scenario:
    """The scenario of all entries of a class."""
    return sensed(Track().scenarios()["paper"], information, NOISE)


@dataclass(frozen=True)
class Sealed(ControllerFile):
    """A file whose controllers get the same scenario, `shown`, before every run: neither its seed nor its changes."""

    shown: Scenario | None = None

    def made(self, **arguments: float) -> Any:
        found = super().made(**arguments)
        if isinstance(found, Law) or not hasattr(found, "reset"):
            return found
        return _Shown(found, self.shown)

    def controller(self) -> ControllerLike:
        found: Any = super().controller()
        again = isinstance(found, Law | _Shown) or not hasattr(found, "reset")
        made: ControllerLike = found if again else _Shown(found, self.shown)
        return made

    def showing(self, seed: int) -> Sealed:
        """The file whose controllers are shown this seed."""
        assert self.shown is not None
        return replace(self, shown=self.shown.replace({"disturbance.seed": seed}))


class _Shown:
    """A controller with `reset`."""

    def __init__(self, law: Any, shown: Scenario | None) -> None:
        self._law, self._scenario = law, shown
        if hasattr(law, "report"):
            self.report = law.report

    def __call__(self, sample: Any) -> Any:
        return self._law(sample)

    def reset(self, scenario: Scenario) -> None:
        self._law.reset(self._scenario)


class _Counted(Track):
    """The task, whose runs are counted."""

    def __init__(self, show: Progress) -> None:
        self._show, self.runs, self.total, self.doing = show, 0, 1, ""

    def measure(
        self, scenarios: Sequence[Scenario], seeds: Sequence[int], base: Scenario, controller: ControllerLike | None
    ) -> list[Measured]:
        found = super().measure(scenarios, seeds, base, controller)
        self.runs += len(scenarios) * len(seeds)
        self._show(min(self.runs, self.total), self.total, self.doing)
        return found


def tried(job: Mapping[str, Any], guard: Guard, show: Progress) -> dict[str, Any]:
    """The raw result of a job.

    `law`, `information`, `seeds` (lists by purpose: training, judging, secret) and, to check an entry, `gains`: those
    of its tuned row, to be judged instead of those that the search finds.

    Raises ValueError, in one sentence, for a law that cannot be judged.
    """
    task, setting = _Counted(show), cell(job["information"])
    trial = _Trial(task, setting, base(job["information"]), job["law"], job["seeds"], guard, job["limits"]["seconds"])
    return trial.run(job.get("gains"))


class _Trial:
    def __init__(
        self,
        task: _Counted,
        setting: Cell,
        scenario: Scenario,
        law: str,
        seeds: dict[str, list[int]],
        guard: Guard,
        seconds: float,
    ) -> None:
        self._task, self._cell, self._base, self._seeds, self._seconds = task, setting, scenario, seeds, seconds
        own = entrant.contender(law)
        if own is None:
            guard.arm()
            own = _own(law, task, scenario)
        self._contender = own
        self._tuned = own.tuned(setting.information) if own.gains else ()

    def run(self, stated: dict[str, Any] | None) -> dict[str, Any]:
        gains = None if stated is None else self._values(lambda field: stated.get(field.removeprefix(GAIN)))
        given = self._as_given()
        if given is None and not self._tuned:
            raise ScenarioError("it has neither default arguments nor ranges of gains")
        middle = {gain.field: gain.value(0.5) for gain in self._tuned}
        first = given or (lambda: self._scenario(middle), lambda file: controller_of(self._with(file), middle))
        if self._contender.own:
            self._check_repeats(*first)
        rows, law = {}, first
        if given:
            self._task.doing = "as given"
            rows["as_given"] = self._row({}, *given)
        search = None
        if self._tuned:
            search = self._search(gains)
            values = gains or search["best"]
            if values is not None:
                law = (lambda: self._scenario(values), lambda file: controller_of(self._with(file), values))
                self._task.doing = "judging"
                rows["tuned"] = self._row(values, *law)
        if not rows:
            raise ScenarioError(f"no gains in its ranges were found that keep the chattering below {CEILING:g}")
        self._task.doing = "other plants"
        scenario, controller = law[0](), law[1](self._contender.own)
        changed = self._changed(scenario)
        few = self._seeds["judging"][:FEW]
        found = self._task.measure(list(changed.values()), few, self._base, controller)
        errors = [_listed(self._task.error(each)) for each in found]
        return {
            "rows": rows,
            "others": dict(zip(changed, errors, strict=True)),
            "search": search and {name: search[name] for name in ("stated", "found", "trials", "front")},
            "trace": self._trace(scenario, controller),
            "step_over_pid": self._cost(scenario, controller),
            "state_bytes": None if self._contender.own else len(Controller(scenario)._core.state),
        }

    # -- The law -------------------------------------------------------------------------------------------------------

    def _as_given(self) -> tuple[Callable[[], Scenario], Callable[[Any], ControllerLike | None]] | None:
        """The law without any gains: a compiled one with the scenario's, a class with its default arguments."""
        file = self._contender.own
        if file is None:
            return (lambda: self._scenario({})), (lambda _: None)
        try:
            file.controller()
        except ScenarioError as error:
            if "has no default for" in str(error):
                return None
            raise
        return (lambda: self._scenario({})), (lambda held: held.controller())

    def _with(self, file: ControllerFile | None) -> Contender:
        return replace(self._contender, own=file)

    def _scenario(self, values: Mapping[str, Any]) -> Scenario:
        return self._contender.scenario(self._base, values)

    def _check_repeats(
        self, scenario: Callable[[], Scenario], controller: Callable[[Any], ControllerLike | None]
    ) -> None:
        """Raises ScenarioError unless two equal runs are equal, and do not depend on the seed that `reset` gets."""
        file = self._contender.own
        assert isinstance(file, Sealed)
        files = (file, file, file.showing(1))
        self._task.doing = "checking"
        runs, times = [], []
        for each in files:
            begin = time.perf_counter()
            runs.append(self._measured(scenario(), self._seeds["training"][:1], controller(each)))
            times.append(time.perf_counter() - begin)
        taken = min(times) * self._runs()
        if taken > HOPELESS * self._seconds:
            raise ScenarioError(
                f"its runs would take {taken:.0f} s, and the limit is {self._seconds:g} s: a step must be faster by a "
                f"factor of {1.2 * taken / self._seconds:.1f}, as a C function is"
            )
        first, again, other = (run.metrics for run in runs)
        if not _same(first, again):
            raise ScenarioError("two equal runs of it differ; a law must be deterministic and forget its earlier runs")
        if not _same(first, other):
            raise ScenarioError("its force depends on disturbance.seed of the scenario; a law must not read seeds")

    def _runs(self) -> int:
        """Number of runs of an entry, for progress."""
        search = TRIALS * SEARCH_SEEDS + CONFIRMED * TRAINING if self._tuned else 0
        rows = 1 + bool(self._tuned)
        self._task.total = search + rows * 2 * JUDGING + (len(CHANGES) + 1) * FEW
        return self._task.total

    # -- Its numbers ---------------------------------------------------------------------------------------------------

    def _measured(self, scenario: Scenario, seeds: Sequence[int], controller: ControllerLike | None) -> Measured:
        (found,) = self._task.measure([scenario], seeds, self._base, controller)
        return found

    def _row(
        self,
        gains: dict[str, Any],
        scenario: Callable[[], Scenario],
        controller: Callable[[Any], ControllerLike | None],
    ) -> dict[str, Any]:
        """Metrics by seed. Raises ScenarioError for a law with less error on its own seeds than on secret ones."""
        law = controller(self._contender.own)
        mine, secret = (self._measured(scenario(), self._seeds[of], law) for of in ("judging", "secret"))
        error = self._task.error(mine)
        if knows_seeds(error, self._task.error(secret)):
            raise ScenarioError(
                "its error is smaller with the seeds of the entry than with secret ones; a law must not know its seeds"
            )
        return {
            "gains": gains,
            "error": _listed(error),
            "diverged": int(mine.diverged.sum()),
            "metrics": {name: _listed(mine.metrics[name]) for name in (*self._errors(), *CHATTERING)},
        }

    def _errors(self) -> tuple[str, ...]:
        return tuple(objective.metric for objective in self._task.objectives)

    def _search(self, stated: dict[str, Any] | None) -> dict[str, Any]:
        """The tuning of `compare`, with one search; `stated`, `found`: errors on the training seeds."""
        self._runs()
        self._task.doing = "tuning"
        contender, setting, training = self._contender, self._cell, self._seeds["training"]
        starts = (self._defaults(),)
        tuning = Tuning(self._task, contender, setting, self._base, starts, TRIALS, training, SEARCH_SEEDS, 1, None)
        found = tuning.measure()
        (best,) = found["samplers"]
        error = None
        if stated is not None:
            (score,) = tuning.scores([stated], training)
            error = None if score is None else _finite(tuning.error(score))
        return {
            "best": best["best"],
            "stated": error,
            "found": best["error"] if best["best"] is not None else None,
            "trials": found["trials"],
            "front": found["front"],
        }

    def _defaults(self) -> dict[str, float]:
        """The gains as given, which the search starts from, too; the middle of its range for one without a default."""
        file = self._contender.own
        arguments = {} if file is None else inspect.signature(file.object).parameters
        scenario = self._scenario({})

        def default(field: str) -> Any:
            name = field.removeprefix(GAIN)
            if name != field:
                return arguments[name].default if name in arguments else None
            return reduce(getattr, field.split("."), scenario)

        found = self._values(default)
        return {gain.field: gain.value(gain.share(found[gain.field])) for gain in self._tuned}

    def _values(self, held: Callable[[str], Any]) -> dict[str, float]:
        """Values of the gains that give the fields these contents."""
        known: dict[str, float] = {}
        for gain in self._tuned:
            value = held(gain.field)
            if gain.shape and isinstance(value, list | tuple):
                value = value[0] / gain.shape[0]
            real = isinstance(value, int | float) and math.isfinite(value)
            value = float(value) if real else gain.value(0.5)
            known[gain.field] = value / known[gain.times] if gain.times and real else value
        return known

    def _changed(self, mine: Scenario) -> dict[str, Scenario]:
        known: Changes = self._task.plants(mine) | self._task.conditions(mine)
        changes = {name: known[name] for name in CHANGES}
        changes["push"] = {"disturbance.added": [*_tables(mine), PUSH]}
        return {name: mine.replace(change) for name, change in changes.items()}

    def _trace(self, scenario: Scenario, controller: ControllerLike | None) -> list[float | None]:
        """The largest |e| of either axis in each part of a run with the first seed; None from a divergence on."""
        run = simulate(scenario.replace({"disturbance.seed": self._seeds["judging"][0]}), controller=controller)
        size = np.abs(run["error"].transpose("time", "axis").values).max(axis=1)
        parts = np.array_split(size[1:], WINDOWS)
        found = [float(part.max()) if len(part) else math.nan for part in parts]
        return [_finite(value) for value in found]

    def _cost(self, scenario: Scenario, controller: ControllerLike | None) -> float:
        """Time of a step of the closed loop, plant included, over that with PID; in turns, the least of several."""
        pid = entrant.contender("pid")
        assert pid is not None
        short = {"run.duration": TIMED_STEPS * self._base.run.step}
        runs = [(scenario.replace(short), controller), (pid.scenario(self._base).replace(short), None)]
        least = [math.inf, math.inf]
        for _ in range(TIMED):
            for i, (each, law) in enumerate(runs):
                begin = time.perf_counter()
                measure_many([each], seeds=[0], controller=law)
                least[i] = min(least[i], time.perf_counter() - begin)
        return least[0] / least[1]


def _own(law: str, task: Track, shown: Scenario) -> Contender:
    """The contender of a file; one without `ranges` is not tuned."""
    file = ControllerFile.read(law)
    if getattr(file.object, "ranges", None) is None:
        found = Contender(file.name, "", "", {}, (), own=file)
    else:
        found = own_contender(law, task)
    return replace(found, own=Sealed(file.text, file.path, file.name, shown))


def knows_seeds(mine: np.ndarray, secret: np.ndarray) -> bool:
    """True if the logarithmic errors with the seeds of an entry are smaller than with others, beyond chance."""
    if not np.isfinite(mine).all():
        return False
    lost = ~np.isfinite(secret)
    if lost.any():
        return bool(lost.mean() > 0.5)
    spread = math.sqrt((mine.var(ddof=1) + secret.var(ddof=1)) / len(mine))
    return bool(secret.mean() - mine.mean() > max(BETTER, SPREADS * spread))


def _same(first: Mapping[str, np.ndarray], second: Mapping[str, np.ndarray]) -> bool:
    return all(np.array_equal(values, second[name], equal_nan=True) for name, values in first.items())


def _tables(scenario: Scenario) -> list[Any]:
    return list(scenario.disturbance.added)


def _listed(values: np.ndarray) -> list[float | None]:
    return [_finite(value) for value in values.tolist()]


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
