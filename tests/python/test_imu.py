"""The noise model for navigation simulations: the measured terms, in their names and units, and nothing else."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from fracgyro.rate.allan import Allan, Estimate
from fracgyro.rate.imu import Noise, of_simulation
from fracgyro.rate.imu import imu_file as imu_file_of
from fracgyro.rate.inspection import Event
from fracgyro.rate.sensor import Output

TAU = 2.0 ** np.arange(5)
UNSEEN = Estimate(0.0, 0.0, 2e-5, True)
WHITE = Allan(
    TAU,
    1 / np.sqrt(TAU),
    TAU,
    TAU,
    Estimate(1e-4, 0.9e-4, 1.1e-4),
    UNSEEN,
    UNSEEN,
    UNSEEN,
    undecided=False,
    drifts=False,
    response_time=0.0,
    fitted=(1.0, 16.0),
    lines=(),
    events=(),
)
ALL = replace(
    WHITE,
    deviation=np.array([4.0, 2.0, 1.0, 2.0, 3.0]),
    bias_instability=Estimate(3e-6, 2e-6, 4e-6),
    rate_random_walk=Estimate(5e-7, 4e-7, 6e-7),
    response_time=0.02,
)


def imu_file(kind: Any, m: Any) -> tuple[str, str]:
    return imu_file_of(kind, [of_simulation(m)])


def measured(found: Allan) -> Any:
    return SimpleNamespace(allan=found, rest=Output(np.full((8, 100), 2e-3), 0.005), seeds=8)


def values(text: str) -> dict[str, float]:
    """Entries of a flat YAML file."""
    pairs = [line.partition("#")[0].partition(":") for line in text.splitlines()]
    return {name: float(value) for name, colon, value in pairs if colon}


def test_kalibr_gets_n_and_k_in_si_and_the_output_rate() -> None:
    name, text = imu_file("kalibr", measured(ALL))
    assert name == "imu.yaml"
    assert values(text) == {
        "update_rate": 200.0,
        "gyroscope_noise_density": 1e-4,  # rad/s/sqrt(Hz) is rad/sqrt(s): N, both two-sided
        "gyroscope_random_walk": 5e-7,
    }
    assert "response time is 0.02 s" in text
    assert "8 simulated records at rest, 0.5 s each" in text


def test_what_kalibr_asks_for_and_the_record_did_not_show_is_a_comment() -> None:
    text = imu_file("kalibr", measured(WHITE))[1]
    assert sorted(values(text)) == ["gyroscope_noise_density", "update_rate"]
    assert "# gyroscope_random_walk: not observed; at most 2e-05 rad/s^2/sqrt(Hz)" in text
    text = imu_file("kalibr", measured(replace(WHITE, angle_random_walk=None)))[1]
    assert sorted(values(text)) == ["update_rate"]
    assert "# gyroscope_noise_density: not observed" in text
    assert "response time" not in text


def profile(found: Allan) -> tuple[dict[str, Any], str]:
    name, text = imu_file("gnss-ins-sim", measured(found))
    assert name == "gnss_ins_sim.py"
    scope: dict[str, Any] = {}
    exec(text, scope)
    return scope["gyro_err"], text


def test_gnss_ins_sim_gets_a_profile_in_si() -> None:
    err, text = profile(ALL)
    assert list(err) == ["b", "b_drift", "b_corr", "arw"]
    assert all(each.shape == (3,) for each in err.values())
    assert err["b"][2] == pytest.approx(2e-3)
    assert err["arw"][2] == pytest.approx(1e-4)
    # The Allan deviation of Gauss-Markov noise is largest at 1.892 correlation times: 0.617 of the standard deviation.
    spread, time = err["b_drift"][2], err["b_corr"][2]
    tau = 4.0  # minimum of the record's deviation
    x = tau / time
    largest = spread * math.sqrt(2 / x * (1 - (3 - 4 * math.exp(-x) + math.exp(-2 * x)) / (2 * x)))
    assert largest == pytest.approx(0.664 * 3e-6, rel=2e-3)
    assert x == pytest.approx(1.892, rel=1e-3)
    assert "no rate random walk. Observed: 5e-07 rad/s/sqrt(s)" in text


def test_what_gnss_ins_sim_would_add_by_itself_is_switched_off_where_it_was_not_seen() -> None:
    err, text = profile(WHITE)
    assert err["b_drift"].tolist() == [0, 0, 0]
    assert err["b_corr"].tolist() == [math.inf] * 3
    assert "bias instability at most 4.13 deg/h; 0 disables a term, nan is to be replaced" in text
    assert "rate random walk" not in text
    assert np.isnan(profile(replace(WHITE, angle_random_walk=None))[0]["arw"]).all(), "to be filled in"


def test_kf_gins_gets_lines_in_its_units() -> None:
    name, text = imu_file("kf-gins", measured(ALL))
    assert name == "kf_gins.yaml"
    lines = {key: rest for key, _, rest in (line.partition(":") for line in text.splitlines()) if key[:1] != "#"}
    numbers = {
        key: [float(each) for each in rest.partition("#")[0].strip(" []").split(",")] for key, rest in lines.items()
    }
    assert numbers["arw"] == pytest.approx([1e-4 * 180 / math.pi * 60] * 3, rel=1e-5)  # deg/sqrt(h)
    assert numbers["gbstd"] == pytest.approx([3e-6 * 0.664 / 0.617 * 180 / math.pi * 3600] * 3, rel=2e-3)
    assert numbers["corrtime"] == pytest.approx([4.0 / 1.892 / 3600], rel=1e-3)
    text = imu_file("kf-gins", measured(WHITE))[1]
    assert "# gbstd: bias instability not observed" in text


def test_three_axes_keep_their_own_numbers_where_the_file_has_room_and_else_the_largest_counts() -> None:
    def axis(walk: float, bias: float) -> Noise:
        return Noise(replace(ALL, angle_random_walk=Estimate(walk, walk, walk)), 0.005, bias, "on a test")

    axes = [axis(1e-4, 1e-3), axis(3e-4, 2e-3), axis(2e-4, 3e-3)]
    assert values(imu_file_of("kalibr", axes)[1])["gyroscope_noise_density"] == 3e-4
    scope: dict[str, Any] = {}
    exec(imu_file_of("gnss-ins-sim", axes)[1], scope)
    assert scope["gyro_err"]["arw"].tolist() == [1e-4, 3e-4, 2e-4]
    assert scope["gyro_err"]["b"].tolist() == [1e-3, 2e-3, 3e-3]


@pytest.mark.parametrize("kind", ["kalibr", "gnss-ins-sim", "kf-gins"])
def test_what_something_in_the_record_spoils_is_not_filled_in(kind: Any) -> None:
    spike = Event("spike", 50.0, 50.0, 1.0, spoils=True)
    text = imu_file_of(kind, [Noise(replace(ALL, events=(spike,)), 0.005, 0.0, "on a test")])[1]
    assert "# Not noise: at 50 s the rate is 57.3 deg/s off." in text
    assert "0.0001" not in text
    assert "1e-04" not in text
    if kind == "gnss-ins-sim":
        scope: dict[str, Any] = {}
        exec(text, scope)
        assert np.isnan(scope["gyro_err"]["arw"]).all()
        assert np.isnan(scope["gyro_err"]["b_drift"]).all()
