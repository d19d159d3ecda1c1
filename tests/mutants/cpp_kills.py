"""Which C++ mutants the tests kill: the C++ tests that come by a mutant first, then the Python tests that do.

The Python tests run in processes forked from one that has imported everything and run nothing; each activates its
mutant by a variable of the compiled module.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib.machinery
import importlib.util
import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from importlib.abc import MetaPathFinder
from pathlib import Path
from typing import Any

import pytest
from compile_in import ROOT
from compiled import BUILD, module, tests

# Those whose tests run in this process and come by the core.
PYTHON = [
    "bounded", "claims", "compensation", "composite", "conventional", "device", "disturbance", "dynamic_sliding",
    "fixed_time", "fractional", "integral_sliding", "internal_model", "joint", "kernel", "kinds", "lanes", "law_rate",
    "linear_term", "lock_in", "loop", "lqg", "metrics", "modes", "motion_filter", "network", "pickoffs",
    "plant_and_loop", "prescribed", "rate_means", "reference_kinds", "resonant", "settings", "temperature", "trim",
    "user_controller", "user_plant", "volts",
]  # fmt: skip
LONGEST = 20.0  # s of tests for one mutant, the quickest first
STUCK = 600.0  # s of waiting for nothing
MANY = 8192  # equal to the constant in switch.hpp


# -- C++ tests -----------------------------------------------------------------------------------------------


def reached_by_cpp_tests() -> list[tuple[float, Path, set[int]]]:
    """Seconds of the processor, program, and the mutants that it comes by; the quickest first."""
    found = []
    for program in tests():
        report = BUILD / f"{program.name}.reached"
        report.unlink(missing_ok=True)
        before = os.times().children_user
        subprocess.run([program, "--gtest_brief=1"], check=True, env={**os.environ, "FRACGYRO_REACHED": str(report)})
        numbers = report.read_text().split() if report.is_file() else []  # none where it includes no mutated header
        found.append((os.times().children_user - before, program, set(map(int, numbers))))
    return sorted(found)


def killed_by_cpp_tests(mutants: Iterable[int], jobs: int) -> set[int]:
    reached = reached_by_cpp_tests()

    def dies(number: int) -> bool:
        for seconds, program, numbers in reached:
            if number in numbers:
                limit = f"--cpu={5 + round(5 * seconds)}"  # processor time, so that a busy machine kills no mutant
                command = ["prlimit", limit, str(program), "--gtest_brief=1", "--gtest_fail_fast"]
                env = {**os.environ, "FRACGYRO_MUTANT": str(number)}
                try:
                    done = subprocess.run(command, env=env, timeout=STUCK, capture_output=True)
                except subprocess.TimeoutExpired:
                    return True
                if done.returncode:
                    return True
        return False

    with ThreadPoolExecutor(jobs) as pool:
        numbers = list(mutants)
        return {number for number, dead in zip(numbers, pool.map(dies, numbers), strict=True) if dead}


# -- Python tests --------------------------------------------------------------------------------------------


class WithMutants(MetaPathFinder):
    """fracgyro._core is the module with the mutants."""

    def find_spec(self, name: str, path: Any, target: Any = None) -> importlib.machinery.ModuleSpec | None:
        return importlib.util.spec_from_file_location(name, module()) if name == "fracgyro._core" else None


def quietly(arguments: list[str], plugins: list[Any] | None = None) -> int:
    with open(os.devnull, "w") as nothing, contextlib.redirect_stdout(nothing), contextlib.redirect_stderr(nothing):
        fixed = ["-q", "-p", "no:cacheprovider", "-p", "no:xdist", "--hypothesis-seed=0", "--no-header", "--no-summary"]
        return int(pytest.main([*fixed, *arguments], plugins))


def forked(task: Callable[[], int], limit: float) -> int:
    """The process that does the task; it dies at the limit, in seconds of the processor."""
    process = os.fork()
    if process == 0:
        resource.setrlimit(resource.RLIMIT_CPU, (int(limit) + 1, int(limit) + 1))
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, 1)
        os.dup2(nothing, 2)
        code = 1
        try:
            code = task()
        finally:
            os._exit(code)
    return process


class Recorder:
    """By test: how long it takes and the mutants that it comes by."""

    def __init__(self, reached: Any) -> None:
        self.reached, self.found = reached, {}

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Any:
        ctypes.memset(self.reached, 0, MANY)
        start = time.process_time()
        yield
        numbers = [i for i, byte in enumerate(bytes(self.reached)) if byte]
        self.found[item.nodeid] = (time.process_time() - start, numbers)


def killed_by_python_tests(mutants: set[int], jobs: int) -> tuple[set[int], set[int]]:
    """Those killed, and those that no Python test comes by."""
    os.chdir(ROOT)
    os.environ["HYPOTHESIS_STORAGE_DIRECTORY"] = str(BUILD / "hypothesis")
    sys.meta_path.insert(0, WithMutants())
    files = [f"tests/python/test_{name}.py" for name in PYTHON]
    assert quietly(["--collect-only", *files]) == 0
    library = ctypes.CDLL(str(module()))
    active = ctypes.c_int.in_dll(library, "fracgyro_mutant")
    reached = (ctypes.c_ubyte * MANY).in_dll(library, "fracgyro_reached")
    report = BUILD / "python.reached"

    def record() -> int:
        recorder = Recorder(reached)
        code = quietly(files, [recorder])
        report.write_text(json.dumps(recorder.found))
        return code

    _, status = os.waitpid(forked(record, 590), 0)
    assert status == 0, "the Python tests fail without any mutant"
    durations: dict[str, tuple[float, list[int]]] = json.loads(report.read_text())
    by_mutant: dict[int, list[str]] = {number: [] for number in mutants}
    spent = dict.fromkeys(mutants, 0.0)
    for test, (seconds, numbers) in sorted(durations.items(), key=lambda entry: entry[1][0]):
        for number in mutants.intersection(numbers):
            if spent[number] + seconds < LONGEST or not by_mutant[number]:
                by_mutant[number].append(test)
                spent[number] += seconds

    def run(number: int) -> int:
        active.value = number
        return quietly(["-x", *by_mutant[number]])

    killed: set[int] = set()
    running: dict[int, int] = {}

    def wait() -> None:
        process, status = os.wait()
        number = running.pop(process)
        if status:
            killed.add(number)
        else:
            print(f"mutant {number} survives {len(by_mutant[number])} Python tests", flush=True)

    for number in sorted(mutants, key=lambda n: spent[n]):
        if by_mutant[number]:
            if len(running) >= jobs:
                wait()
            running[forked(partial(run, number), 30 + 10 * spent[number])] = number
    while running:
        wait()
    return killed, {number for number in mutants if not by_mutant[number]}
