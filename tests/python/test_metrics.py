"""Figures of runs against signals whose figures are known, and what they tell about their origin."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mixed_order_game import ResultError, Simulator, read_model, run
from mixed_order_game.results.metrics import (
    Metrics,
    control_energy,
    overshoot,
    sampled_metrics,
    settling_time,
    told_figure,
)
from mixed_order_game.studies.sampler import Sampler, Settings


def test_settling_time_of_an_exponential() -> None:
    time = np.linspace(1.0, 11.0, 21)  # far too coarse but for the exponential in between
    error = 3.0 * np.exp(-0.7 * (time - 1.0))
    assert settling_time(time, error, 0.06) == pytest.approx(np.log(50.0) / 0.7, rel=1e-12)
    assert settling_time(time, error, 3.0) == 0.0
    assert np.isnan(settling_time(time, error, 1e-9))
    error[15] = 1.0  # leaves the band once more
    late = settling_time(time, error, 0.06)
    assert time[15] - 1.0 < late < time[16] - 1.0
    assert settling_time(np.array([0.0, 1.0]), np.array([1.0, 0.0]), 0.1) == 1.0


def test_what_did_not_settle_is_told_in_words() -> None:
    never = Metrics(np.nan, 0.1, np.nan, 1.0, 0.5, 3.0, 0.02)
    told = [told_figure(never, name, 3) for name in ("settling_time", "control_energy", "final_error")]
    assert told == ["not settled", "-", "0.5"]
    assert told_figure(None, "settling_time", 3) == "-"


def test_overshoot() -> None:
    deviation = np.zeros((4, 1, 3))
    deviation[:, 0, 0] = [10.0, 2.0, -3.0, -1.0]  # 3 beyond
    deviation[:, 0, 1] = [-4.0, -5.0, 1.0, 0.0]  # farther on its own side is none
    deviation[:, 0, 2] = [0.0, -2.0, 0.5, 0.0]  # starts at its equilibrium
    assert overshoot(deviation) == pytest.approx(0.3)
    assert overshoot(deviation[..., 1:]) == pytest.approx(0.5)
    assert overshoot(deviation[:2, :, :1]) == 0.0
    assert overshoot(np.zeros((3, 1, 1))) == 0.0
    assert overshoot(deviation[..., 2:]) == 0.0  # no scale


def test_control_energy() -> None:
    time = np.concatenate([np.linspace(0.0, 1.0, 400), np.linspace(1.1, 20.0, 190)])
    u = np.stack([np.exp(-3.0 * time), 2.0 * np.exp(-5.0 * time)], axis=-1)[:, np.newaxis, :]
    assert control_energy(time, u) == pytest.approx(1.0 / 6.0 + 4.0 / 10.0, rel=1e-3)


def test_windows() -> None:
    time = np.linspace(0.0, 10.0, 101)
    deviation = np.full((101, 2, 1), 0.5)
    deviation[:80] = 3.0
    found = sampled_metrics(time, deviation, None)
    assert found.final_error == 0.5
    assert np.isnan(found.control_energy)
    assert np.isnan(found.settling_time)
    assert found.band == pytest.approx(0.02 * np.hypot(3.0, 3.0))
    assert sampled_metrics(time, deviation, None, settle_time=7.0, band=1.0).final_error == 3.0
    assert sampled_metrics(time, deviation, None, band=1.0).settling_time == pytest.approx(7.96, abs=0.05)
    with pytest.raises(ResultError, match="no sample from 11 s on"):
        sampled_metrics(time, deviation, None, settle_time=11.0)
    assert found.as_json()["settling_time"] is None
    json.dumps(found.as_json(), allow_nan=False)


def test_of_a_result(fmu: Path) -> None:
    result = run(fmu)
    found = result.metrics
    assert 0.3 < found.settling_time < 1.0
    settled = result.nash_error <= found.band
    assert settled[result.time > found.settling_time].all()
    assert found.final_error == pytest.approx(result.largest_error(16.0), rel=1e-3)
    assert found.events == result["solver_events"][-1] > 0.0
    assert found.control_peak > np.abs(result.u).max()  # between the samples
    assert np.isnan(run(fmu, outputs=["x"], stop_time=1.0).metrics.events)


def test_of_samples_alone(fmu: Path) -> None:
    result = run(fmu, stop_time=4.0, step=0.001)
    names = [name for name in result.columns if name[0] in "xu" or name == "solver_events"]
    sampled = replace(result, columns={name: result[name] for name in names}).metrics
    judged = result.metrics
    for figure in ("settling_time", "overshoot", "control_energy", "control_peak", "final_error"):
        assert getattr(sampled, figure) == pytest.approx(getattr(judged, figure), rel=2e-3), figure


def test_equilibrium_that_moves(fmu: Path) -> None:
    changes = {5.0: {f"cost_linear[{i},1]": 0.0 for i in range(1, 6)}}
    result = run(fmu, stop_time=10.0, changes=changes, outputs=["x", "x_star"])
    assert 5.0 < result.metrics.settling_time < 7.0


def test_sampler_equals_the_simulator(fmu: Path) -> None:
    values = {"k1": 12.0, "a[1,3]": 0.5, "robust": True}
    settings = Settings(stop_time=3.0)
    with Sampler(fmu) as sampler, Simulator(fmu) as simulator:
        first, again = sampler.measure(values, settings), sampler.measure(values, settings)
        recorded = sampler.record(values, settings)
        other = sampler.measure({}, settings)
        result = simulator.run(start_values=values, stop_time=3.0)
    assert first == again == recorded.metrics
    assert first != other
    assert first == result.metrics
    np.testing.assert_array_equal(recorded.x, result.x)
    assert recorded.parameters == result.parameters


@pytest.mark.parametrize(
    "wrong",
    [
        {"stop_time": 0.0},
        {"step": -1.0},
        {"tolerance": float("nan")},
        {"settle_time": 21.0},
        {"band": 0.0},
    ],
)
def test_settings_that_make_no_sense(wrong: dict[str, float]) -> None:
    from mixed_order_game import SimulationError

    with pytest.raises(SimulationError, match=next(iter(wrong))):
        Settings(**wrong)


def test_changed_values(fmu: Path) -> None:
    result = run(fmu, start_values={"k1": 12.0, "k2": 1.0, "perturbed": False}, stop_time=0.1)
    assert result.changed == {"k1": 12.0, "perturbed": False}
    assert read_model(fmu).changed_values({"x0[1,1]": -5.0, "x0[1,2]": 7.0}) == {"x0[1,2]": 7.0}
