"""Cost of a step of the Gymnasium environments; writes benchmarks/results/environments.md."""

from __future__ import annotations

import statistics
import time
from typing import Any

import fracgyro as fg
import gymnasium
import numpy as np
from machine import command, machine, on_one_core, write

MEASURES_CODE = True
DEPENDS_ON = ["sliding_mode"]

ROUNDS, STEPS = 15, 5000
BUDGET = 10.0  # us
PAPER = fg.Scenario.paper().replace({"controller.force_limit": 1000.0})
NOISY = PAPER.replace(
    {"device.position_noise": 1e-12, "device.velocity_noise": 1e-9, "rate.kind": "sine", "rate.amplitude": 10.0}
    | {"rate.frequency": 100.0}
)


def many(count: int) -> Any:
    return fg.interop.gymnasium.TrackingVector(count, PAPER)


def main() -> None:
    on_one_core()
    single: dict[str, Any] = {
        "`Tracking`": fg.interop.gymnasium.Tracking(PAPER),
        "`Tracking`, moving rate and noisy sensors": fg.interop.gymnasium.Tracking(NOISY),
        "`RateSensing`": fg.interop.gymnasium.RateSensing(PAPER),
        "`Tracking` from `gymnasium.make`, with its checks": gymnasium.make("fracgyro/Tracking-v0", scenario=PAPER),
    }
    vectors = {count: many(count) for count in (1, 8, 64, 1000)}
    times: dict[Any, list[float]] = {name: [] for name in (*single, *vectors)}
    for _ in range(ROUNDS + 1):
        for name, env in (single | vectors).items():
            env.reset(seed=0)
            action = np.zeros(env.action_space.shape)
            begin = time.perf_counter()
            for _ in range(STEPS):
                env.step(action)
            times[name].append(1e6 * (time.perf_counter() - begin) / STEPS)
    median = {name: statistics.median(each[1:]) for name, each in times.items()}
    best = {name: min(each[1:]) for name, each in times.items()}
    write(
        "environments",
        [
            "# Environments of Gymnasium\n",
            f"Made by `{command()}`.\n",
            f"Machine: {machine('gymnasium')}; on one core.\n",
            f"One step, from loops of {STEPS:,}, median and best of {ROUNDS}, in turn; the budget is {BUDGET:g} us:\n",
            "| environment | median | best |",
            "|---|---|---|",
            *(f"| {name} | {median[name]:.2f} us | {best[name]:.2f} us |" for name in single),
            "\n`TrackingVector`, one step of all, and of one of them:\n",
            "| environments | median | best | each |",
            "|---|---|---|---|",
            *(
                f"| {count:,} | {median[count]:.1f} us | {best[count]:.1f} us | {1e3 * median[count] / count:,.0f} ns |"
                for count in vectors
            ),
        ],
    )
    if any(median[name] > BUDGET for name in single):
        raise SystemExit("a step takes longer than the budget")


if __name__ == "__main__":
    main()
