"""Several independent searches of one problem, continued until their best values agree.

Each is CMA-ES (Hansen and Ostermeier 2001; the package `cmaes`) with restarts on the unit cube. It begins with a Latin
square of points of its own and with starts that all share; it descends from the best of the former, then from the best
of the latter, and rests. If the searches then disagree, those that lag descend from their own best as long as that
helps, and after that from another Latin square with twice the population, in turn.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from cmaes import CMA
from numpy.typing import NDArray

Point = NDArray[np.float64]  # in the unit cube
Descent = Generator[list[Point], list[float], None]  # proposes generations, and receives their values

AGREED = math.log(1.05)  # largest difference of the best values
GAIN = math.log(1.005)  # a descent ends when it has gained less than this
# Initial standard deviations: of descents from a Latin square, from known points, and from the search's own best. The
# last is wide because a descent may have ended on a ridge, which is sharp at a limit.
WIDE, CLOSE, NEAR = 0.2, 0.04, 0.1


@dataclass
class Sampler:
    """One search, whose best value so far is `best`."""

    size: int  # number of coordinates
    starts: Sequence[Point]
    seed: int
    best: float = math.inf
    trials: int = 0
    resting: bool = False
    _at: Point = field(init=False)
    _descents: int = 0

    def __post_init__(self) -> None:
        self._random = np.random.default_rng(self.seed)
        self._generations = self._search()
        self._points = next(self._generations)

    def run(self, measure: Callable[[list[Point]], list[float]], most: int) -> None:
        """Until it rests, or has made `most` trials."""
        self.resting = False
        while not self.resting and self.trials < most:
            points = self._points[: most - self.trials]
            values = measure([point[: self.size] for point in points])
            self.trials += len(points)
            least = int(np.argmin(values))
            if values[least] < self.best:
                self.best, self._at = values[least], points[least]
            if len(points) == len(self._points):
                self._points = self._generations.send(values)

    def _search(self) -> Descent:
        fresh, known = self._square(), [self._padded(start) for start in self.starts]
        values = yield [*known, *fresh]
        first = values[len(known) :]
        yield from self._descend(fresh[int(np.argmin(first))], WIDE)
        if known:
            yield from self._descend(known[int(np.argmin(values[: len(known)]))], CLOSE)
        while True:
            self.resting = True
            before = math.inf
            while before - self.best > AGREED / 2:
                before = self.best
                yield from self._descend(self._at, NEAR)
            self.resting = True
            fresh = self._square()
            values = yield fresh
            yield from self._descend(fresh[int(np.argmin(values))], WIDE, 2)

    def _descend(self, start: Point, deviation: float, times: int = 1) -> Descent:
        self._descents += 1
        size = len(start)
        population = times * (4 + int(3 * math.log(size)))
        bounds = np.array([[0.0, 1.0]] * size)
        seed = int(np.random.SeedSequence([self.seed, self._descents]).generate_state(1)[0])
        search = CMA(np.clip(start, 0.0, 1.0), deviation, bounds, seed=seed, population_size=population)
        patience = 2 + 3 * self.size
        best: list[float] = []
        while not search.should_stop():
            points = [search.ask() for _ in range(population)]
            values = yield points
            search.tell(list(zip(points, values, strict=True)))
            best.append(min([*best[-1:], *values]))
            if len(best) > patience and best[-1 - patience] - best[-1] < GAIN:
                return

    def _square(self) -> list[Point]:
        """Points of which each coordinate takes every part of its range once."""
        size = max(self.size, 2)
        count = 4 + 12 * self.size
        parts = np.argsort(self._random.random((size, count)), axis=1).T
        return list((parts + self._random.random((count, size))) / count)

    def _padded(self, start: Point) -> Point:
        """CMA-ES needs two coordinates: of a single one a second has no effect."""
        return np.append(start, 0.5) if len(start) == 1 else start


def converged(best: Sequence[float], agreed: float = AGREED) -> bool:
    """True if there are several values, and they agree."""
    return len(best) > 1 and max(best) - min(best) <= agreed


def search(
    measure: Callable[[int, list[Point]], list[float]],
    size: int,
    starts: Sequence[Point],
    seeds: Sequence[int],
    most: int,
    agreed: float = AGREED,
) -> list[Sampler]:
    """Searches with these seeds, run until they agree, or each lagging one has made `most` trials.

    `measure`: values, which are minimized, of points; also gets the number of the search. Agreement counts once every
    search rests: a start that all share makes equal values at first, which mean nothing.
    """
    samplers = [Sampler(size, starts, seed) for seed in seeds]
    left = list(range(len(samplers)))
    while left:
        for i in left:
            samplers[i].run(partial(measure, i), most)
        least = min(sampler.best for sampler in samplers)
        left = [i for i, s in enumerate(samplers) if s.best - least > agreed and s.trials < most]
    return samplers
