"""Check of the bits that this installation computes: the published parity hashes, recomputed.

The paper's corrected scenario, its noise included, over 100 units of time. Run in double, its answers (forces and
estimates) are hashed; then the controller in single precision answers the same motion. The kernel design, the noise,
the plant and the controller all enter, so one bit of difference anywhere shows. benchmarks/parity.py has every other
target answer too.
"""

from __future__ import annotations

import platform
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..scenario import Scenario
from ..simulation.simulate import simulate
from .compilers import Number
from .replay import parity_hash
from .targets import MOTION, answered, answers

SCENARIO = Scenario.paper().replace({"run.duration": 100.0})
PUBLISHED: Mapping[Number, str] = {
    "double": "27bd53614655d09b4e44bcdcfed6ac810246da064905f7e782d263b58bddcce4",
    "float": "a8fe01ca5582e78660d6fb42685f831c2a9058ac2b83c4063d10da28da907abd",
}


@dataclass(frozen=True)
class SelfCheck:
    """Result of `selfcheck`. `hashes`: computed by this installation; `published`: the expected ones.

    >>> sorted(fg.selfcheck().hashes)
    ['double', 'float']
    """

    version: str
    python: str
    numpy: str
    compiler: str
    processor: str
    lanes: str
    hashes: Mapping[Number, str]
    published: Mapping[Number, str] = field(default_factory=lambda: PUBLISHED)

    @property
    def sound(self) -> bool:
        """True if the hashes equal the published ones."""
        return self.hashes == self.published


def selfcheck() -> SelfCheck:
    """Recomputes the published parity hashes, to check that this installation computes the same bits as every other.

    >>> fg.selfcheck().sound
    True
    """
    motion, found = parity_run()
    hashes: dict[Number, str] = {
        "double": parity_hash(SCENARIO, found),
        "float": parity_hash(SCENARIO, answers("python", SCENARIO, "float", motion)),
    }
    return SelfCheck(
        version=version("fracgyro"),
        python=platform.python_version(),
        numpy=np.__version__,
        compiler=_core.compiler,
        processor=processor(),
        lanes=", ".join(f"{8 * count} bytes" for count in _core.lane_counts()),
        hashes=hashes,
    )


def parity_run() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The run of SCENARIO: its motion and its answers, one row for each step."""
    run = simulate(SCENARIO)
    steps = run.sizes["time"]

    def columns(names: list[str]) -> NDArray[np.float64]:
        return np.hstack([run[name].values.reshape(steps, -1) for name in names])

    return columns(MOTION), columns([channel.name for channel in answered(SCENARIO)])


def processor() -> str:
    """Name of the processor, from the system."""
    info = Path("/proc/cpuinfo")
    if info.is_file():
        for line in info.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return f"{line.partition(':')[2].strip()}, {platform.machine()}"
    return platform.processor() or platform.machine()
