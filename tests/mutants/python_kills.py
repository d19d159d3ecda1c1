"""Mutants of the Python modules where a wrong number would matter: by mutmut, and from python.toml.

mutmut mutates what stands in functions. Kept of its mutants are those of numbers, operators, comparisons and keywords,
and of these a share by a hash of what they change; not texts, nor arguments and values turned into None, which fail at
once.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from compile_in import HERE, ROOT

sys.path.append(str(ROOT / "benchmarks"))

from sources import PACKAGES

FOLDER = ROOT / "build/mutants/python"
SHARE = 0.1
MODULES = [
    "fracgyro/analysis/confidence.py", "fracgyro/analysis/metrics.py", "fracgyro/rate/allan.py",
    "fracgyro/rate/bound.py", "fracgyro/rate/merit.py", "fracgyro/rate/units.py", "fracgyro/scenario/terms.py",
    "fracgyro/scenario/to_core.py",
    "fracgyro/study/sweep/effects.py", "fracgyro/study/tune/criteria.py", "fracgyro/study/tune/hold_out.py",
    "fracgyro_lab/comparison/rows.py", "fracgyro_lab/paper/claims.py", "fracgyro_lab/paper/step_cost.py",
]  # fmt: skip
# The tests that may kill: of the last files only the tests that run in this process, where a mutant is active.
TESTS: dict[str, list[str]] = {
    "metrics": [], "claims": [], "allan": [], "effects": [], "hold_out": [], "rate_figures": [], "lanes": [],
    "device": [], "setup": [], "kinds": [], "bound": [], "disturbance": [],
    "compare": [
        "test_ratios_are_paired_by_seed_and_have_no_value_where_a_run_diverged",
        "test_of_several_searches_the_best_counts_and_the_others_are_judged_too",
        "test_a_ratio_covers_all_pairs_of_searches",
        "test_an_error_is_less_or_more_only_where_the_interval_of_all_searches_leaves_one_out",
        "test_a_run_with_an_error_as_large_as_the_reference_is_lost",
        "test_nothing_is_a_multiple_of_what_breaks_a_limit",
        "test_the_front_is_what_no_trial_beats_in_error_and_chattering",
        "test_compare_json_has_what_others_rely_on",
    ],
    "indices": ["test_the_page_has_the_indices_and_a_spread_of_independent_points_only"],
    "joint": [
        "test_it_is_told_the_truth_unless_something_else_is_said",
        "test_noise_that_is_held_counts_with_its_density",
    ],
    "loop": [
        "test_metrics_of_an_si_run_are_those_of_the_nondimensional_one_in_si",
        "test_lyapunov_function_loses_exactly_what_equation_45_says",
        "test_equation_47_in_SI_units_is_equation_48_without_them",
    ],
    "rate": [
        "test_knowing_damping_and_stiffness_lowers_the_bound_where_the_speeds_differ",
        "test_the_bound_is_of_the_density_that_held_noise_has_and_the_start_does_not_matter",
        "test_without_noise_the_bound_is_0_and_a_motion_that_tells_nothing_apart_has_none",
    ],
    "temperature": [
        "test_errors_of_estimates_refer_to_the_warm_plant",
        "test_errors_of_estimates_refer_to_the_plant_of_their_time",
        "test_joint_is_given_the_fastest_drift_of_an_entry",
    ],
    "inspection": ["test_a_vibration_that_is_not_steady_and_covers_the_noise_is_named"],
    "volts": [
        "test_noise_of_the_amplifiers_and_steps_of_the_driver_are_told",
        "test_an_acceleration_shifts_the_gaps_by_the_common_mode",
    ],
    "firmware": ["test_what_float_cannot_hold_is_refused"],
    "law_rate": ["test_the_bound_is_of_the_motion_that_the_controller_brings_about"],
    "reproduce": [
        "test_the_best_order_is_found_where_it_is",
        "test_a_tie_within_the_noise_is_no_reproduction",
        "test_the_interval_of_a_mean_is_students",
    ],
    "tune": [
        "test_what_never_comes_about_is_infinite",
        "test_an_objective_that_is_none_is_refused_with_what_is_near",
        "test_a_diverged_run_counts_for_nothing_but_its_divergence",
        "test_a_limit_is_kept_when_met_exactly_and_the_excess_is_relative_to_it",
        "test_an_excess_without_end_stays_a_number_for_the_optimiser",
        "test_the_bootstrap_interval_of_a_shift_holds_the_shift",
    ],
}  # fmt: skip


def selected(folder: str, name: str) -> list[str]:
    file = f"{folder}/test_{name}.py"
    return [f"{file}::{test}" for test in TESTS[name]] or [file]


def path_of(file: str) -> str:
    """From the root: that of a file of a package."""
    return f"{PACKAGES[file.partition('/')[0]]}/{file}"


def prepare(modules: list[str]) -> None:
    """A project of the packages, the compiled module and the tests, as mutmut wants it, to mutate these modules."""
    shutil.rmtree(FOLDER, ignore_errors=True)
    for package in PACKAGES:
        shutil.copytree(ROOT / path_of(package), FOLDER / package, ignore=shutil.ignore_patterns("__pycache__"))
    installed = subprocess.run(
        [sys.executable, "-c", "import fracgyro._core as c; print(c.__file__)"],
        capture_output=True,
        text=True,
        check=True,
    )
    core = Path(installed.stdout.strip())
    for path in core.parent.iterdir():
        if path.is_dir() and path.name in ("include", "integrations"):
            shutil.copytree(path, FOLDER / "fracgyro" / path.name, dirs_exist_ok=True)
    shutil.copyfile(core, FOLDER / "fracgyro" / core.name)
    (FOLDER / "tests").mkdir()
    for path in (ROOT / "tests/python").glob("*.py"):
        shutil.copyfile(path, FOLDER / "tests" / path.name)
    shutil.copytree(ROOT / "examples/scenarios", FOLDER / "examples/scenarios")
    files = [test for name in TESTS for test in selected("tests", name)]
    options = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["pytest"]["ini_options"]
    (FOLDER / "pyproject.toml").write_text(
        f"[tool.mutmut]\nsource_paths = {list(PACKAGES)}\nonly_mutate = {modules}\n"
        f"pytest_add_cli_args_test_selection = {files}\n"
        'pytest_add_cli_args = ["-p", "no:xdist", "-p", "no:cacheprovider", "--hypothesis-seed=0"]\n'
        "timeout_constant = 10.0\ntrack_dependencies = false\nuse_git_change_detection = false\n"
        '[tool.pytest.ini_options]\nfilterwarnings = ["error"]\n'
        f"markers = {json.dumps(options['markers'])}\n",
        encoding="utf-8",
    )


def by_mutmut(modules: list[str], jobs: int) -> dict[str, tuple[str, str]]:
    """Status and diff of each mutant, by its name. Its own process: mutmut keeps its state in modules."""
    if not modules:
        return {}
    prepare(modules)
    # Without the editable installation, which would hide the mutated package.
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(HERE), *(p for p in sys.path if "site-packages" in p)]),
    }
    base = getattr(sys, "_base_executable", sys.executable)
    subprocess.run(
        [base, "-m", "python_kills", "run", "--max-children", str(jobs)], cwd=FOLDER, env=environment, check=True
    )
    reported = subprocess.run(
        [base, "-m", "python_kills", "report", *modules],
        cwd=FOLDER,
        env=environment,
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    found = {}
    for block in reported.split("\f")[1:]:
        name, status, diff = block.split("\n", 2)
        found[name] = (status, diff)
    return found


def of_a_kind_kept(module: Any, file: str, mutation: Any) -> bool:
    import libcst as cst

    before, after = mutation.original_node, mutation.mutated_node
    if isinstance(before, cst.BaseString | cst.FormattedString | cst.Call | cst.Assign | cst.AnnAssign | cst.Lambda):
        return False
    function = mutation.contained_by_top_level_function
    if not isinstance(function, cst.FunctionDef):
        return False
    empty = cst.Module([])
    words = "|".join([file, function.name.value, *(empty.code_for_node(node) for node in (before, after))])
    return int(hashlib.sha256(words.encode()).hexdigest()[:8], 16) < SHARE * 2**32


def mutmut() -> None:
    """mutmut's own command on fewer of its mutants; `report` prints their status and diffs."""
    import mutmut.mutation.file_mutation as files

    create = files.create_mutations

    def fewer(filename: str, *arguments: Any, **named: Any) -> Any:
        module, mutations, *rest = create(filename, *arguments, **named)
        return module, [m for m in mutations if of_a_kind_kept(module, filename, m)], *rest

    files.create_mutations = fewer
    from mutmut.__main__ import cli
    from mutmut.mutation.data import SourceFileMutationData
    from mutmut.mutation.diff_apply import get_diff_for_mutant
    from mutmut.stats import status_by_exit_code

    if sys.argv[1] != "report":
        cli()
        return
    for name in sys.argv[2:]:
        data = SourceFileMutationData(path=Path(name))
        data.load()
        for key, code in data.exit_code_by_key.items():
            status = status_by_exit_code[code]
            killed = status in ("killed", "timeout", "segfault", "suspicious")
            print(f"\f{key}\n{'killed' if killed else status}\n{'' if killed else get_diff_for_mutant(key)}", end="")


# -- Written out ---------------------------------------------------------------------------------------------


def listed() -> list[dict[str, Any]]:
    """id, file, original (which occurs once), replacement, and the tests that may kill it."""
    return list(tomllib.loads((HERE / "python.toml").read_text(encoding="utf-8"))["mutant"])


def edited(entry: dict[str, Any]) -> str:
    text = (ROOT / path_of(entry["file"])).read_text(encoding="utf-8")
    if text.count(entry["original"]) != 1:
        raise ValueError(
            f"mutant {entry['id']}: its original occurs {text.count(entry['original'])} times in {entry['file']}: "
            f"{entry['original']}"
        )
    return text.replace(entry["original"], entry["replacement"])


def killed_listed(entries: list[dict[str, Any]], jobs: int) -> dict[str, bool]:
    """By id."""

    def dies(entry: dict[str, Any]) -> bool:
        edited(entry)
        files = [test for name in entry["tests"] for test in selected("tests/python", name)]
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:xdist", "-p", "edit", *files]
        environment = {**os.environ, "FRACGYRO_EDIT": entry["id"], "PYTHONPATH": str(HERE)}
        done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
        if done.returncode not in (0, 1):
            raise RuntimeError(f"mutant {entry['id']}: pytest ended with {done.returncode}\n{done.stdout}{done.stderr}")
        return done.returncode == 1

    with ThreadPoolExecutor(jobs) as pool:
        return {entry["id"]: dead for entry, dead in zip(entries, pool.map(dies, entries), strict=True)}


def module_of(file: str) -> str:
    return file.removesuffix(".py").replace("/", ".")


if __name__ == "__main__":
    mutmut()
