"""The search: Optuna proposes trials, `measure_many` measures them, a database stores them.

Trial n is drawn by a sampler seeded with (tune.seed, n) from the results of the previous batches. A study that was
killed therefore resumes with the same results; trials that were proposed but not measured are measured first.
"""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import optuna
from optuna.samplers import BaseSampler, CmaEsSampler, NSGAIISampler, TPESampler
from optuna.trial import TrialState
from pydantic import TypeAdapter
from sqlalchemy import URL, make_url
from sqlalchemy.exc import SAWarning, SQLAlchemyError

from ...scenario import ScenarioError
from ..folder import digest
from ..space import Dimension
from .criteria import Measured, Score, score
from .plan import Plan, rounded

WORST = 1e3  # reported to Optuna for an objective without a value; infeasible trials of cmaes are at least this
SCORE = TypeAdapter(Score)


@dataclass(frozen=True)
class Trial:
    """A point of the space and its score."""

    number: int
    values: dict[str, Any]  # by field
    score: Score


class Search:
    """A study in its database, which runs up to the plan's number of trials."""

    def __init__(self, plan: Plan, study: optuna.Study, base: Measured, *, resume: bool) -> None:
        self._plan, self._study, self._resumed = plan, study, resume
        file = plan.file
        self.limits = [constraint.limit(base) for constraint in file.constraint]
        for constraint, limit in zip(file.constraint, self.limits, strict=True):
            if not math.isfinite(limit):
                raise ScenarioError(
                    f"the constraint on {constraint.metric} has at_most_base, but the base scenario's "
                    f"{constraint.label} is not finite: it must have at_most"
                )
        self.base = score(base, file.objective, file.constraint, self.limits)

    def finished(self) -> list[Trial]:
        """Finished trials, in order. Raises ScenarioError for a damaged trial."""
        with _undamaged(self._resumed):
            trials = self._study.get_trials(deepcopy=False, states=(TrialState.COMPLETE,))
            return [self._finished(trial) for trial in trials]

    def _finished(self, stored: optuna.trial.FrozenTrial) -> Trial:
        values, file = stored.user_attrs["values"], self._plan.file
        found = SCORE.validate_python(stored.user_attrs["score"])
        sizes = len(found.objectives), len(found.constraints), len(found.excess)
        numbers = (*found.objectives, *found.constraints, *found.excess, found.diverged)
        point = {d.field: _value(d, stored.params[d.field]) for d in self._plan.dimensions}
        same = json.loads(json.dumps(point)) == values  # JSON has lists instead of tuples
        wanted = len(file.objective), len(file.constraint), len(file.constraint)
        sealed = self._seal(stored.number, values, stored.user_attrs["score"], stored.values)
        if not same or sizes != wanted or any(map(math.isnan, numbers)) or stored.user_attrs["hash"] != sealed:
            raise ValueError(f"trial {stored.number}")
        return Trial(stored.number, values, found)

    def _seal(self, number: int, point: dict[str, Any], found: dict[str, Any], told: Sequence[float]) -> str:
        """The hash of a finished trial of this study."""
        return digest({"study": self._plan.hash, "number": number, "point": point, "score": found, "told": list(told)})

    def run(self, progress: Callable[[int], object]) -> None:
        """Runs batches up to the plan's number of trials; `progress` is called with numbers of runs."""
        while batch := self._next_batch():
            measured = self._plan.measure([point for _, point in batch], progress)
            with _undamaged(self._resumed):
                for (trial, point), found in zip(batch, measured, strict=True):
                    self._tell(trial, point, found)

    def _next_batch(self) -> list[tuple[optuna.Trial, dict[str, Any]]]:
        """Trials and their points: first those proposed but not measured before a kill, then new ones."""
        with _undamaged(self._resumed):
            return self._batch()

    def _batch(self) -> list[tuple[optuna.Trial, dict[str, Any]]]:
        study = self._study
        trials = study.get_trials(deepcopy=False)
        if not trials and (base := self._plan.base_values()):
            study.enqueue_trial(self._suggested(base))
        left = [t for t in trials if t.state == TrialState.RUNNING]
        number = sum(t.state != TrialState.WAITING for t in trials)
        first, size = left[0].number if left else number, self._plan.batch
        # The first trial, the base scenario if possible, is a separate batch.
        end = 1 + -(-first // size) * size if first else 1
        batch = []
        for trial in left:
            study.sampler = self._sampler(trial.number, 0)
            again = optuna.Trial(study, trial._trial_id)
            batch.append((again, self._point(again)))
        for n in range(number, min(end, self._plan.file.tune.trials)):
            study.sampler = self._sampler(n, 0)
            new = study.ask()
            batch.append((new, self._point(new)))
        return batch

    def _sampler(self, number: int, part: int) -> BaseSampler:
        tune = self._plan.file.tune
        seed = int(np.random.SeedSequence([tune.seed, number, part]).generate_state(1)[0])
        if tune.sampler == "cmaes":
            return CmaEsSampler(seed=seed, popsize=self._plan.batch, warn_independent_sampling=False)
        if tune.sampler == "nsga2":
            return NSGAIISampler(seed=seed, population_size=self._plan.batch)
        return TPESampler(seed=seed, multivariate=True)

    def _point(self, trial: optuna.Trial) -> dict[str, Any]:
        """The values of the trial, drawn now if it has none."""
        point: dict[str, Any] = {}
        for part, d in enumerate(self._plan.dimensions, start=1):
            self._study.sampler = self._sampler(trial.number, part)
            log = d.scale == "log"
            suggested: float
            if d.choices is not None:
                suggested = trial.suggest_categorical(d.field, range(len(d.choices)))
            elif d.integer:
                suggested = trial.suggest_int(d.field, int(d.low), int(d.high), log=log)
            else:
                suggested = trial.suggest_float(d.field, d.low, d.high, log=log)
            point[d.field] = _value(d, suggested)
        return point

    def _suggested(self, values: dict[str, Any]) -> dict[str, Any]:
        """The values in Optuna's form, which has the index of a choice."""
        choices = {d.field: d.choices for d in self._plan.dimensions if d.choices is not None}
        return {field: choices[field].index(v) if field in choices else v for field, v in values.items()}

    def _tell(self, trial: optuna.Trial, point: dict[str, Any], measured: Measured | None) -> None:
        file = self._plan.file
        if measured is None:  # an invalid scenario counts as diverged
            nothing = (math.inf,) * len(file.constraint)
            found = Score((math.inf,) * len(file.objective), nothing, (0.0,) * len(nothing), 1.0)
        else:
            found = score(measured, file.objective, file.constraint, self.limits)
        undefined = sum(not math.isfinite(value) for value in found.objectives)
        limits = {"diverged": found.diverged, "undefined": float(undefined)}
        # Square roots, as samplers add them: constraints with little and much variation then have similar weight.
        roots = [math.sqrt(over) if over > 0 else over for over in found.excess]
        limits |= {f"{i} {c.label}": root for i, (c, root) in enumerate(zip(file.constraint, roots, strict=True))}
        trial.set_user_attr("values", point)
        trial.set_user_attr("score", asdict(found))
        # Logarithms of ratios; otherwise the objective with the largest spread dominates tpe's hypervolume.
        values = [_log(ratio) if math.isfinite(ratio) else WORST for ratio in ratios(found, self.base)]
        if file.tune.sampler == "cmaes":
            # cmaes has no constraints and uses only ranks: infeasible trials follow, smallest excess first.
            if not found.feasible:
                values = [WORST * (1 + sum(max(excess, 0.0) for excess in limits.values()))]
        else:
            there = trial.constraints  # some exist after a kill at this point
            for name, excess in limits.items():
                if name not in there:
                    trial.set_constraint(name, excess)
        trial.set_user_attr("hash", self._seal(trial.number, point, asdict(found), values))
        self._study.tell(trial, values)


@contextmanager
def opened(plan: Plan, address: str | None, base: Measured, *, resume: bool) -> Iterator[Search]:
    """The study in the database at `address`, created if needed; in memory without an address.

    Raises ScenarioError if the database cannot be used, or if it already has the study and `resume` is false.
    """
    level = optuna.logging.get_verbosity()
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    storage = None
    try:
        storage = None if address is None else storage_at(address)
        with usable(address):
            with _undamaged(resume):
                study = optuna.create_study(
                    storage=storage,
                    study_name=f"fracgyro-{plan.hash}",
                    directions=["minimize"] * len(plan.file.objective),
                    load_if_exists=resume,
                )
            yield Search(plan, study, base, resume=resume)
    except optuna.exceptions.DuplicatedStudyError:
        raise ScenarioError(f"{_safe(address)} already has this study: finish it with --resume") from None
    finally:
        optuna.logging.set_verbosity(level)
        if storage is not None:
            storage.remove_session()
            storage.engine.dispose()


@contextmanager
def usable(address: str | None) -> Iterator[None]:
    """Raises ScenarioError if the database fails."""
    try:
        yield
    except (SQLAlchemyError, optuna.exceptions.StorageInternalError) as error:
        raise ScenarioError(f"{_safe(address)} cannot be used: {_words(error.__cause__ or error, address)}") from None


def storage_at(address: str) -> optuna.storages.RDBStorage:
    """The database, with its tables. Raises ScenarioError if it cannot be opened."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", SAWarning)  # unknown options of the driver
            return optuna.storages.RDBStorage(address)
    except (SQLAlchemyError, SAWarning, ImportError, RuntimeError, TypeError, ValueError) as error:
        raise ScenarioError(f"{_safe(address)} cannot be opened as a database: {_words(error, address)}") from None


def _safe(address: str | None) -> str:
    """The address without user, password and options, which may contain a password."""
    if address is None:
        return "memory"
    try:
        url = make_url(address)
    except (SQLAlchemyError, ValueError):
        return "tune.storage"  # an invalid address may still contain a password
    return URL.create(url.drivername, None, None, url.host, url.port, url.database).render_as_string()


def study_text(plan: Plan) -> str:
    """The study's text with the safe address of its storage, for a report."""
    address = plan.file.tune.storage
    if address is None or _safe(address) == address:
        return plan.text
    return plan.text.replace(address, _safe(address)) if address in plan.text else "Its storage may hold a password."


def _words(error: BaseException, address: str | None) -> str:
    """First line of the error, without the parts that `_safe` removes."""
    words = str(error).partition("\n")[0]
    if address is None:
        return words
    words = words.replace(address, _safe(address))
    with suppress(SQLAlchemyError, ValueError):
        url = make_url(address)
        values = [value for found in url.query.values() for value in ((found,) if isinstance(found, str) else found)]
        for secret in filter(None, [url.password, *values]):
            words = words.replace(str(secret), "***")
    return words


@contextmanager
def _undamaged(resume: bool) -> Iterator[None]:
    """Raises ScenarioError for any failure of Optuna on a damaged database."""
    try:
        yield
    except (SQLAlchemyError, optuna.exceptions.StorageInternalError, optuna.exceptions.DuplicatedStudyError):
        raise
    except Exception as error:
        if not resume:
            raise
        raise ScenarioError(
            "the trials in the study's database are damaged: start the study again in another folder"
        ) from error


def _value(dimension: Dimension, suggested: float) -> Any:
    """Optuna's suggestion as a value of the field."""
    if dimension.choices is not None:
        return dimension.choices[int(suggested)]
    return int(suggested) if dimension.integer else rounded(dimension, suggested)


def front(trials: Sequence[Trial]) -> list[Trial]:
    """Pareto front: feasible trials that no other feasible trial dominates, by increasing first objective."""
    feasible = [trial for trial in trials if trial.score.feasible]
    values = np.array([trial.score.objectives for trial in feasible])
    kept: list[Trial] = []
    for i, trial in enumerate(feasible):
        better = (values <= values[i]).all(axis=1) & (values < values[i]).any(axis=1)
        twin = (values[:i] == values[i]).all(axis=1)  # found before
        if not better.any() and not twin.any():
            kept.append(trial)
    return sorted(kept, key=lambda trial: trial.score.objectives)


def ratios(found: Score, base: Score) -> list[float]:
    """Objectives relative to the base scenario; unscaled if the base value is not positive and finite."""
    pairs = zip(found.objectives, base.objectives, strict=True)
    return [value / (own if 0 < own < math.inf else 1.0) for value, own in pairs]


def choose(members: Sequence[Trial], base: Score) -> Trial:
    """The trial with the smallest product of `ratios`, if possible among those that are nowhere worse than the base."""

    def rank(trial: Trial) -> tuple[bool, float]:
        found = ratios(trial.score, base)
        return not (max(found) <= 1 and min(found) < 1), sum(map(_log, found))

    return min(members, key=rank)


def _log(ratio: float) -> float:
    return math.log(max(ratio, 1e-300))
