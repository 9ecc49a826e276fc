"""What the FMU says of its own run, against an independent one, whatever the communication step."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike

from mixed_order_game import Simulator, default_game, load, read_model, run
from mixed_order_game.fmu.parts import build_part
from mixed_order_game.results.metrics import JUDGED
from mixed_order_game.studies.sampler import Sampler, Settings
from tests.conftest import GAMES, FmuOf
from tests.oracle.game import read_game
from tests.oracle.judgement import judge

STOP, BAND = 0.8, 0.4
CHANGES: Mapping[str, Mapping[float, Mapping[str, float]]] = {
    "equilibrium": {0.5: {"cost_linear[1,1]": 2.0}},
    "control": {0.4003: {"k1": 14.0, "k4": 70.0}},
}


def _of_the_oracle(changed: Mapping[float, Mapping[str, float]]) -> dict[str, float]:
    game = read_game(GAMES / "two_scalar_players.toml")
    linear = game.cost_linear.copy()
    linear[0, 0] = 2.0
    changes: dict[float, dict[str, ArrayLike]] = {
        when: {"cost_linear": linear} if "cost_linear[1,1]" in values else dict(values)
        for when, values in changed.items()
    }
    found = vars(judge(game, STOP, changes=changes, band=BAND, judge_from=0.3))
    return {figure: float(value) for figure, value in found.items()}


@pytest.mark.parametrize("jump", CHANGES)
def test_every_communication_step_tells_what_fine_samples_do(fmu_of: FmuOf, jump: str) -> None:
    expected = _of_the_oracle(CHANGES[jump])
    with Simulator(fmu_of("two_scalar_players")) as simulator:
        runs = [
            simulator.run(
                stop_time=STOP,
                step=step,
                tolerance=1e-8,
                start_values={"judge_from": 0.3, "settling_band": BAND},
                changes=CHANGES[jump],
                outputs=["x"],
            )
            for step in (0.02, 0.001, STOP)
        ]
    for result in runs:
        for figure, value in expected.items():
            assert result[figure][-1] == pytest.approx(value, rel=1e-5, abs=1e-9), figure
    for figure in JUDGED:  # steps after a change end at a communication point
        assert runs[0][figure][-1] == pytest.approx(runs[1][figure][-1], rel=1e-7)
        assert runs[0][figure][-1] == pytest.approx(runs[2][figure][-1], rel=1e-7)


def test_a_run_settles_where_a_jump_of_the_equilibrium_ends_what_another_began(fmu_of: FmuOf) -> None:
    away, back = {"cost_linear[1,1]": 40.0}, {"cost_linear[1,1]": 1.21}
    with Simulator(fmu_of("two_scalar_players")) as simulator:
        for step in (0.02, STOP):
            result = simulator.run(
                stop_time=STOP,
                step=step,
                start_values={"settling_band": 4.0},
                changes={0.3: away, 0.32: back},
                outputs=["x"],
            )
            assert result["settling_time"][-1] == pytest.approx(0.32, abs=1e-12)
            assert result["settled"][-1] == 1.0


def test_a_run_settles_where_an_error_was_last_outside_within_a_step(fmu: Path) -> None:
    """The band ends a little below the error's largest peak of the last period of the disturbances."""
    with Simulator(fmu) as simulator:
        found = simulator.run(step=0.002, outputs=["nash_error"])
        late = np.flatnonzero(found.time > 17.5)
        top = late[np.argmax(found.nash_error[late])]
        around = slice(top - 1, top + 2)
        parabola = np.polyfit(found.time[around] - found.time[top], found.nash_error[around], 2)
        band = (1.0 - 1e-7) * float(found.nash_error[top])
        leaves = found.time[top] + np.roots(parabola - [0.0, 0.0, band]).max()
        settled = simulator.run(step=20.0, start_values={"settling_band": band}, outputs=["nash_error"])
    assert settled["settling_time"][-1] == pytest.approx(leaves, abs=1e-4)


def test_the_steps_that_follow_changes_are_judged_as_accurately_as_they_run(fmu_of: FmuOf) -> None:
    changes = {0.1 * k: {"k1": 6.0 + 6.0 * (k % 2), "k4": 15.0 + 20.0 * (k % 2)} for k in range(1, 8)}
    start = {"settling_band": BAND}
    with Simulator(fmu_of("two_scalar_players")) as simulator:
        loose, tight = (
            simulator.run(
                stop_time=STOP, step=0.1, tolerance=each, start_values=start, changes=changes, outputs=["x"]
            )
            for each in (1e-5, 1e-9)
        )
    for figure in JUDGED:
        assert loose[figure][-1] == pytest.approx(tight[figure][-1], rel=1e-4), figure


def test_samples_are_never_beyond(fmu: Path) -> None:
    result = run(fmu, stop_time=4.0, start_values={"judge_from": 0.0})
    largest_control = np.abs(result.u).max(axis=(1, 2))
    largest_error = np.abs(result.x - result.x_star).max(axis=(1, 2))
    assert np.all(result["control_peak"] >= np.maximum.accumulate(largest_control) * (1.0 - 1e-9))
    assert np.all(result["error_peak"] >= np.maximum.accumulate(largest_error) * (1.0 - 1e-9))
    assert result["control_peak"][-1] == pytest.approx(1328.137, rel=1e-5)  # 1250 by samples of 20 ms
    outside = result.nash_error > 0.02 * result.nash_error[0]
    np.testing.assert_array_equal(result["settled"], ~outside)
    np.testing.assert_allclose(result["settling_time"][outside], result.time[outside])
    assert np.all(np.diff(result["control_energy"]) > 0.0)
    assert result["control_energy"][0] == 0.0


def test_figures_of_a_result_do_not_depend_on_its_samples(fmu: Path, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    with Sampler(fmu) as sampler:
        fine, coarse = (sampler.run(stop_time=3.0, step=step) for step in (0.01, 3.0))
        found = sampler.measure({}, Settings(stop_time=3.0))
    assert fine.metrics == coarse.metrics == found
    assert fine.parameters["judge_from"] == pytest.approx(2.4)
    assert fine.changed == {}
    for suffix in (".csv", ".parquet"):
        assert load(coarse.save(tmp_path / f"run{suffix}")).metrics == found
    other = fine.measured(band=0.5, settle_time=1.0)  # which only samples can tell
    assert other.control_peak == found.control_peak
    assert other.band == 0.5
    with Sampler(fmu) as sampler:
        judged = sampler.measure({}, Settings(stop_time=3.0, band=0.5, settle_time=1.0))
    assert other.settling_time == pytest.approx(judged.settling_time, rel=1e-3)
    assert other.final_error == pytest.approx(judged.final_error, rel=1e-3)


def test_a_part_of_a_game_knows_its_control_only(tmp_path: Path) -> None:
    model = read_model(build_part(default_game(), [3], tmp_path / "vehicle.fmu"))
    assert {name for name in (*JUDGED, "judge_from", "settling_band") if name in model.variables} == {
        "control_energy",
        "control_peak",
    }
