"""The finished trials of a tuning in a database, from which a killed tuning continues on any machine.

A search is determined by the values of its trials, so it is repeated with those that the database holds. Optuna's
tables are used, as its tools can read them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from fracgyro.scenario import ScenarioError
from fracgyro.study.folder import digest

if TYPE_CHECKING:
    import optuna

Values = dict[str, Any]
Found = list[Any]  # result of a trial, as JSON has it


class Journal:
    """Trials by their gains. Without a study it is empty, and keeps nothing."""

    def __init__(self, name: str, study: optuna.Study | None) -> None:
        self._name, self._study = name, study
        self._held: dict[str, Found] = {}
        if study is None:
            return
        from optuna.trial import TrialState

        for trial in study.get_trials(deepcopy=False, states=(TrialState.COMPLETE,)):
            held = trial.user_attrs
            point = digest(held.get("gains", {}))
            if held.get("hash") != self._seal(point, held.get("found")):
                raise ScenarioError(f"trial {trial.number} of {name} in the database is damaged: delete this study")
            self._held[point] = held["found"]

    def found(self, values: Mapping[str, Any]) -> Found | None:
        """Result of the trial of these gains, if the database has it."""
        return self._held.get(digest(dict(values)))

    def keep(self, values: Values, found: Found) -> None:
        if self._study is None:
            return
        from optuna.trial import create_trial

        held = {"gains": values, "found": found, "hash": self._seal(digest(values), found)}
        self._study.add_trial(create_trial(value=float(found[0]), user_attrs=held))

    def _seal(self, point: str, found: Found | None) -> str:
        return digest({"study": self._name, "point": point, "found": found})


@contextmanager
def opened(address: str | None, parts: Mapping[str, Any]) -> Iterator[Journal]:
    """The journal of the tuning that `parts` determine. Raises ScenarioError if the database fails."""
    name = f"fracgyro-{digest(dict(parts))}"
    if address is None:
        yield Journal(name, None)
        return
    import optuna  # here, as a worker without a database starts in half of the time
    from fracgyro.study.tune.search import storage_at, usable

    level = optuna.logging.get_verbosity()
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    storage = None
    try:
        storage = storage_at(address)
        with usable(address):
            study = optuna.create_study(storage=storage, study_name=name, direction="minimize", load_if_exists=True)
            yield Journal(name, study)
    finally:
        optuna.logging.set_verbosity(level)
        if storage is not None:
            storage.remove_session()
            storage.engine.dispose()
