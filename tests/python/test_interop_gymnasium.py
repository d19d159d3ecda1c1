"""Environments of Gymnasium: their gyroscope is that of simulate, seeds are reproducible, and many are as one."""

from __future__ import annotations

import copy
import pickle
import re
import tomllib
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import fracgyro as fg
import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium", reason="gymnasium, which the extra interop brings, is not installed")
EnvSpec = gymnasium.envs.registration.EnvSpec
environments = fg.interop.gymnasium

# With a power of two as the limit, a force equals that of its action to the last bit.
PAPER = fg.Scenario.paper().replace({"controller.force_limit": 4096.0, "run.duration": 0.5})
SCENARIOS = {
    "paper": PAPER,
    "moving rate, noise, delay": PAPER.replace(
        {
            "rate.kind": "noise",
            "rate.amplitude": 50.0,
            "rate.frequency": 100.0,
            "device.position_noise": 1e-12,
            "device.velocity_noise": 1e-9,
            "device.delay": 2,
        }
    ),
    "positions only, SI": fg.Scenario.shipped("dual_mass").replace(
        {"controller.kind": "pid", "controller.force_limit": 1.0, "run.duration": 20.0, "run.units": "SI"}
    ),
}
scenarios = pytest.mark.parametrize("scenario", SCENARIOS.values(), ids=SCENARIOS)


@scenarios
@pytest.mark.parametrize("kind", ["Tracking", "RateSensing"])
def test_gymnasium_has_no_complaint(kind: str, scenario: fg.Scenario) -> None:
    from gymnasium.utils.env_checker import check_env

    made = gymnasium.make(f"fracgyro/{kind}-v0", scenario=scenario)
    assert made.unwrapped.task == getattr(environments, kind)(scenario).task
    check_env(made.unwrapped)


@scenarios
def test_under_the_forces_of_a_run_the_gyroscope_moves_as_in_the_run_bit_for_bit(scenario: fg.Scenario) -> None:
    env = environments.Tracking(scenario)
    observation, info = env.reset(seed=5)
    run = fg.simulate(env.scenario)
    assert env.scenario.disturbance.seed != scenario.disturbance.seed
    place = "measured_position" if "measured_position" in run else "position"
    speed = place.replace("position", "velocity")
    sensed = scenario.device.sensing == "full"
    assert len(observation) == (10 if sensed else 8)
    forces = run["control"].values / env.force_limit
    rate = scenario.plant.angular_rate
    for n, force in enumerate(forces):
        np.testing.assert_array_equal(observation[:2], run[place].values[n])
        np.testing.assert_array_equal(observation[2:4], run["reference"].values[n])
        if sensed:
            np.testing.assert_array_equal(observation[8:], run[speed].values[n])
        np.testing.assert_array_equal(info["error"], run["error"].values[n])
        if "angular_rate" in run:
            rate = float(run["angular_rate"].values[n]) * scenario.plant.scales.rate
        assert info["angular_rate"] == pytest.approx(rate, rel=1e-15)
        observation, reward, lost, ended, info = env.step(force)
        assert (lost, ended) == (False, n + 1 >= scenario.run.steps)
        x, y = info["error"].tolist()
        assert reward == -(x * x + y * y)


def test_the_reference_and_its_derivatives_are_what_is_to_be_followed() -> None:
    env = environments.Tracking(PAPER)
    observation, _ = env.reset(seed=0)
    r = PAPER.reference
    for n in range(200):
        phase = np.array(r.frequency) * 1e-3 * n + np.array(r.phase)
        a, f = np.array(r.amplitude), np.array(r.frequency)
        followed = [a * np.sin(phase), a * f * np.cos(phase), -a * f**2 * np.sin(phase)]
        np.testing.assert_allclose(observation[2:8], np.hstack(followed), rtol=0, atol=1e-12)
        observation, *_ = env.step(np.zeros(2))


def test_a_seed_repeats_its_episodes_and_another_has_others() -> None:
    env, action = environments.RateSensing(SCENARIOS["moving rate, noise, delay"]), np.array([0.5, -0.5, 0.1])

    def episodes(seed: int) -> list[Any]:
        found = []
        for each in (seed, None):
            first, info = env.reset(seed=each)
            observation, reward, *_ = env.step(action)
            seeds = env.scenario.disturbance.seed, env.scenario.rate.seed
            found.append([first.tolist(), info["angular_rate"], observation.tolist(), reward, *seeds])
        return found

    (a, b), again, (other, _) = episodes(3), episodes(3), episodes(4)
    assert again == [a, b]
    for one, another in ((a, b), (a, other)):
        assert all(x != y for x, y in zip(one, another, strict=True))


def test_many_environments_have_the_numbers_of_single_ones_that_begin_again() -> None:
    from gymnasium.vector import SyncVectorEnv

    limits = {"error_limit": 0.7, "rate_range": 300.0}
    short = PAPER.replace({"run.duration": 0.05})
    for kind, options in (("Tracking", {"error_limit": 0.7}), ("RateSensing", limits)):
        many = gymnasium.make_vec(
            f"fracgyro/{kind}-v0", num_envs=3, vectorization_mode="vector_entry_point", scenario=short, **options
        )
        single = SyncVectorEnv([lambda kind=kind, options=options: getattr(environments, kind)(short, **options)] * 3)
        assert (many.observation_space, many.action_space) == (single.observation_space, single.action_space)
        assert many.metadata["autoreset_mode"] == single.metadata["autoreset_mode"]
        (ours, info), (theirs, expected) = many.reset(seed=7), single.reset(seed=7)
        ends = np.zeros((3, 2), dtype=int)
        many.action_space.seed(0)
        for n in range(200):
            np.testing.assert_array_equal(ours, theirs)
            np.testing.assert_array_equal(info["error"], np.stack(list(expected["error"])))
            np.testing.assert_array_equal(info["angular_rate"], expected["angular_rate"])
            actions = many.action_space.sample() * [[0.01], [1.0], [0.01]] if n < 120 else np.ones((3, 3))
            actions = actions[:, : many.single_action_space.shape[0]]
            ours, rewards, lost, ended, info = many.step(actions)
            theirs, *found, expected = single.step(actions)
            for one, other in zip((rewards, lost, ended), found, strict=True):
                np.testing.assert_array_equal(one, other)
            ends += np.stack([lost, ended], axis=1)
        assert (ends.sum(axis=0) > 0).all(), "nothing ended early, or nothing lasted"
        assert many.unwrapped.scenarios[1] == single.envs[1].unwrapped.scenario


def test_an_episode_that_is_lost_is_worth_that_loss_for_all_that_was_left() -> None:
    env = environments.Tracking(PAPER, error_limit=0.6)
    env.reset(seed=0)
    left, lost = 500, False
    while not lost:
        left -= 1
        _, reward, lost, ended, info = env.step(np.ones(2))
        assert lost == (np.abs(info["error"]).max() > 0.6)
    assert not ended
    assert left > 100
    assert reward == pytest.approx(-2 * 0.36 * (left + 1))


def test_a_rate_that_is_found_costs_nothing_and_one_that_is_not_its_square() -> None:
    env = environments.RateSensing(PAPER, rate_range=200.0)
    _, info = env.reset(seed=0)
    share = info["angular_rate"] / 200.0
    assert 0.1 < abs(share) < 1.0
    assert env.step(np.array([0.0, 0.0, share]))[1] == pytest.approx(0.0, abs=1e-30)
    assert env.step(np.array([0.0, 0.0, share - 0.5 * np.sign(share)]))[1] == pytest.approx(-0.25)
    assert env.step([0.0, 0.0, 7.0])[1] == pytest.approx(-((1.0 - share) ** 2))  # cut to 1
    rates = [env.reset()[1]["angular_rate"] for _ in range(200)]
    assert -200.0 < min(rates) < -150.0
    assert 150.0 < max(rates) < 200.0


def test_the_model_that_is_offered_predicts_the_next_sample() -> None:
    quiet = PAPER.replace({"disturbance.kind": "none"})
    env = environments.Tracking(quiet)
    observation, _ = env.reset(seed=0)
    a, b, _, _ = env.plant_matrices
    for action in np.random.default_rng(0).uniform(-1, 1, (50, 2)):
        state = np.hstack([observation[:2], observation[8:]])
        observation, *_ = env.step(action)
        found = np.hstack([observation[:2], observation[8:]])
        np.testing.assert_allclose(a @ state + b @ (4096.0 * action), found, rtol=0, atol=1e-11)
    assert np.array_equal(environments.TrackingVector(2, quiet).plant_matrices[0], a)


def test_actions_beyond_the_space_are_cut_to_it() -> None:
    one, other = environments.Tracking(PAPER), environments.Tracking(PAPER)
    for env in (one, other):
        env.reset(seed=0)
    for far, near in (((9.0, -3.0), (1.0, -1.0)), ((0.5, -1e300), (0.5, -1.0))):
        np.testing.assert_array_equal(one.step(np.array(far))[0], other.step(np.array(near))[0])


# -- Refused input -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "error", "sentence"),
    [
        ({"scenario": 3}, TypeError, "scenario is 3: it must be a Scenario, one of paper, paper-printed, hardware"),
        (
            {"scenario": "hardwar"},
            fg.ScenarioError,
            '"hardwar" is neither a shipped scenario nor a file; did you mean hardware?',
        ),
        ({"scenario": "run.durance = 3"}, fg.ScenarioError, "run.durance is not a known field; did you mean"),
        ({"scenario": {"run": {"durance": 3}}}, fg.ScenarioError, "run.durance is not a known field; did you mean"),
        ({"max_episode_steps": 0}, ValueError, "max_episode_steps is 0: it must be an integer of at least 1"),
        (
            {"scenario": fg.Scenario.paper()},
            ValueError,
            "controller.force_limit is inf: it must be finite, as actions are fractions of it",
        ),
        ({"error_limit": 0.0}, ValueError, "error_limit is 0.0: it must be greater than 0"),
        ({"error_limit": "wide"}, TypeError, "error_limit is 'wide': it must be a number"),
        ({"rate_range": -1}, ValueError, "rate_range is -1: it must be greater than 0"),
        (
            {"scenario": PAPER.replace({"plant.angular_rate": 0.0})},
            ValueError,
            "plant.angular_rate is 0: rate_range must be given",
        ),
        ({"num_envs": 0}, ValueError, "num_envs is 0: it must be an integer of at least 1"),
        ({"num_envs": 2.0}, ValueError, "num_envs is 2.0: it must be an integer of at least 1"),
    ],
)
def test_a_wrong_argument_is_refused_in_one_sentence(
    arguments: dict[str, Any], error: type[Exception], sentence: str
) -> None:
    kind = environments.RateSensingVector if "num_envs" in arguments else environments.RateSensing
    with pytest.raises(error, match=f"^{re.escape(sentence)}"):
        kind(**arguments)


@pytest.mark.parametrize(
    ("action", "sentence"),
    [
        ([0.0, np.nan], "action is not finite: it must hold numbers from -1 to 1"),
        ([np.inf, 0.0], "action is not finite: it must hold numbers from -1 to 1"),
        ([0.0], "action has another size than the action space"),
        ([0.0, 0.0, 0.0], "action has another size than the action space"),
        ([], "action has another size than the action space"),
    ],
)
def test_a_wrong_action_is_refused_and_nothing_moves(action: list[float], sentence: str) -> None:
    one, many = environments.Tracking(PAPER), environments.TrackingVector(2, PAPER)
    one.reset(seed=0)
    many.reset(seed=0)
    with pytest.raises(ValueError, match=f"^{sentence}$"):
        one.step(np.array(action))
    with pytest.raises(ValueError, match=f"^{sentence}$"):
        many.step(np.array([action, action]))
    env = environments.Tracking(PAPER)
    env.reset(seed=0)
    np.testing.assert_array_equal(one.step(np.zeros(2))[0], env.step(np.zeros(2))[0])


def test_a_step_before_the_reset_is_refused_and_so_are_seeds_of_another_number() -> None:
    for env, action in ((environments.Tracking(PAPER), (2,)), (environments.TrackingVector(2, PAPER), (2, 2))):
        with pytest.raises(gymnasium.error.ResetNeeded, match="call reset before the first step"):
            env.step(np.zeros(action))
    with pytest.raises(ValueError, match="seed has 3 seeds: it must have one for each of 2 environments"):
        environments.TrackingVector(2, PAPER).reset(seed=[1, 2, 3])


def test_the_guide_prints_what_it_says() -> None:
    page = (Path(__file__).resolve().parents[2] / "docs/gymnasium.md").read_text(encoding="utf-8")
    code, printed, more = re.findall(r"^```(?:python|text)\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)
    names: dict[str, Any] = {}
    with redirect_stdout(StringIO()) as said:
        exec(compile(code, "gymnasium.md", "exec"), names)
    assert said.getvalue() == printed
    exec(compile(more, "gymnasium.md", "exec"), names)
    assert names["rewards"].shape == (64,)


# -- Configured by text, and copied


def test_a_scenario_is_given_by_its_name_its_path_its_text_or_a_dict(tmp_path: Path) -> None:
    scenario = fg.Scenario.shipped("hardware")
    scenario.save(tmp_path / "a = b.toml")
    tables = tomllib.loads(scenario.to_toml())
    forms = ["hardware", str(tmp_path / "a = b.toml"), tmp_path / "a = b.toml", scenario.to_toml(), tables]
    for form in forms:
        for kind in ("Tracking", "RateSensing"):
            env = gymnasium.make(f"fracgyro/{kind}-v0", scenario=form)
            assert env.unwrapped.task == getattr(environments, kind)(scenario).task
    envs = gymnasium.make_vec("fracgyro/Tracking-v0", num_envs=2, scenario="hardware")
    assert envs.unwrapped.task == environments.Tracking(scenario).task


@pytest.mark.parametrize("given", ["paper", SCENARIOS["positions only, SI"], {"plant": {"angular_rate": 50.0}}, None])
@pytest.mark.parametrize("name", ["Tracking", "RateSensing"])
def test_what_made_an_environment_can_be_written_as_json_and_makes_it_again(name: str, given: Any) -> None:
    tables = {"controller": {"force_limit": 1000.0}}
    given = {**given, **tables} if isinstance(given, dict) else "hardware" if given == "paper" else given
    made = gymnasium.make(f"fracgyro/{name}-v0", scenario=given, error_limit=3.0)
    spec = EnvSpec.from_json(made.spec.to_json())
    again = gymnasium.make(spec)
    assert again.unwrapped.task == made.unwrapped.task
    assert made.spec.max_episode_steps == made.unwrapped.task.scenario.run.steps == again.spec.max_episode_steps
    several = gymnasium.make_vec(spec, num_envs=2)
    assert several.unwrapped.task == made.unwrapped.task
    assert gymnasium.make_vec(EnvSpec.from_json(several.spec.to_json())).unwrapped.task == made.unwrapped.task


def test_without_an_error_limit_an_episode_of_any_environment_ends_where_an_error_exceeds_ten() -> None:
    for kind in ("Tracking", "RateSensing"):
        one, several = getattr(environments, kind)(PAPER), getattr(environments, f"{kind}Vector")(2, PAPER)
        assert one.task == several.task
        assert one.task.error_limit == 10.0


def test_episodes_are_as_short_as_they_are_asked_to_be() -> None:
    one = gymnasium.make("fracgyro/Tracking-v0", scenario=PAPER, max_episode_steps=7)
    several = gymnasium.make_vec("fracgyro/Tracking-v0", num_envs=2, scenario=PAPER, max_episode_steps=7)
    assert one.spec.max_episode_steps == several.spec.max_episode_steps == 7
    one.reset(seed=1)
    several.reset(seed=1)
    for step in range(1, 8):
        assert one.step(np.zeros(2))[3] == (step == 7)
        assert several.step(np.zeros((2, 2)))[3].tolist() == [step == 7] * 2
    assert environments.Tracking(PAPER, max_episode_steps=10**6).task == environments.Tracking(PAPER).task


@scenarios
@pytest.mark.parametrize("copied", [copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))], ids=["copy", "pickle"])
def test_a_copy_of_an_environment_goes_on_by_itself(copied: Any, scenario: fg.Scenario) -> None:
    one = gymnasium.make("fracgyro/RateSensing-v0", scenario=scenario)
    several = environments.TrackingVector(3, scenario)
    for env, action in ((one, np.full(3, 0.1)), (several, np.full((3, 2), 0.1))):
        fresh = copied(env)
        for each in (env, fresh):
            np.testing.assert_array_equal(each.reset(seed=4)[0], env.reset(seed=4)[0])
        for _ in range(5):
            env.step(action)
        other = copied(env)
        ahead = [env.step(action) for _ in range(5)]
        for expected in ahead:
            for a, b in zip(other.step(action)[:4], expected[:4], strict=True):
                np.testing.assert_array_equal(a, b)
        np.testing.assert_array_equal(other.reset()[0], env.reset()[0])  # the next episode is the same one
