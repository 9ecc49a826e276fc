"""Plants and unknown dynamics as Python functions, against the oracle's run of the whole game."""

# ruff: noqa: ARG001, ARG005 - not every plant depends on all that it is given

import json
import math
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from typer.testing import CliRunner

import mixed_order_game as mog
from mixed_order_game.cli.app import app
from mixed_order_game.errors import ExperimentError, GameError, ModelError, SimulationError, VariableError
from mixed_order_game.fmu.plants import PlantFunctions

Floats = NDArray[np.float64]
REFERENCES = Path(__file__).resolve().parents[1] / "reference"
STOP = 1.0


def vehicle(number: int) -> Callable[..., Floats]:
    """The plant of vehicle 3, 4 or 5 as the paper has it: g_i = i x_i, d_i = i sin(i t)."""
    return lambda t, x, v, u: u + number * x + number * np.sin(number * t)


def unknown_dynamics(t: float, x: Floats, v: Floats) -> Floats:
    return np.array([x[1], [x[1, 0] ** 2 + x[2, 0], x[1, 1]], 3.0 * x[2], 4.0 * x[3], 5.0 * x[4]])


@pytest.fixture(scope="module")
def simulator() -> Iterator[mog.Simulator]:
    with mog.Simulator("five_vehicles") as loaded:
        yield loaded


def difference(result: mog.Result, begin: float = 0.0, case: str = "five_vehicles") -> float:
    """Of the actions from the oracle's, every 0.1 s."""
    with np.load(REFERENCES / f"{case}.npz") as file:
        t, x = file["t"], file["x"]
    times = t[(t >= begin) & (t <= result.time[-1] + 1e-9)]
    found = result.x[np.searchsorted(result.time, times - 1e-9)]
    return float(np.abs(found - x[np.searchsorted(t, times - 1e-9)]).max())


@pytest.mark.parametrize("step", [0.1, 0.02])
def test_a_plant_moves_as_in_the_game_whatever_the_step(step: float, simulator: mog.Simulator) -> None:
    result = simulator.run(plant={4: vehicle(4)}, stop_time=STOP, step=step)
    whole = simulator.run(stop_time=STOP, step=step)
    assert difference(result) < 2e-4
    assert np.abs(result.v - whole.v)[:, 3:].max() < 2e-3
    late = result.time > 0.5
    assert np.abs(result.u - whole.u)[late].max() < 1e-4 * np.abs(whole.u).max()
    assert np.abs(result.nash_error - whole.nash_error).max() < 2e-4
    assert result.metrics.overshoot == pytest.approx(whole.metrics.overshoot, rel=1e-4)
    assert result.metrics.control_energy == pytest.approx(whole.metrics.control_energy, rel=1e-4)
    assert result.parameters["x[4,2]"] == -8.0
    assert result.changed == {}
    assert result.columns.keys() == whole.columns.keys()


def test_players_of_both_orders_at_once_with_their_starts(simulator: mog.Simulator) -> None:
    starts: dict[str, float | bool] = {"x0[3,1]": 2.0, "v0": 0.5, "x0[1,1]": 1.0, "robust": False}
    plants = {number: vehicle(number) for number in (3, 5)}
    result = simulator.run(plant=plants, start_values=starts, stop_time=STOP, step=0.05)
    whole = simulator.run(start_values=starts, stop_time=STOP, step=0.05)
    assert np.abs(result.x - whole.x).max() < 2e-4
    assert result.x[0, 2].tolist() == [2.0, 8.0]
    assert result.v[0, 4].tolist() == [0.5, 0.5]
    assert result.changed.keys() >= {"x[3,1]", "x0[1,1]", "v[5,2]", "v0[4,1]"}


def test_players_keep_gains_of_their_own() -> None:
    game = mog.Game("five_vehicles")
    game.player(3)["gains"] = {"k1": 7.0}
    game.player(4)["gains"] = {"k4": 30.0, "delta": 5.0, "epsilon": 0.02}
    plants = {number: vehicle(number) for number in (3, 4, 5)}
    result = mog.run(game, plant=plants, stop_time=0.3, step=0.05)
    whole = mog.run(game, stop_time=0.3, step=0.05)
    assert np.abs(result.x - whole.x).max() < 2e-4


def test_the_fmu_is_led_along_the_predicted_and_along_the_found_path(
    simulator: mog.Simulator, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where both end the FMU holds p as it was predicted or found, and x as the integral of p."""
    ends = {"predicted": 0, "found": 0}
    close = partial(np.testing.assert_allclose, rtol=1e-10, atol=1e-10)
    solved, accept = PlantFunctions._solved, PlantFunctions._accept

    def held(plants: PlantFunctions) -> tuple[Floats, Floats]:
        p = plants._p_inputs.read(plants._slave).reshape(plants._shape)
        return p, plants._x_inputs.read(plants._slave).reshape(-1, plants._shape[1])

    def checked_solved(self: PlantFunctions, k: int, time: float, guess: Floats, bound: Floats) -> Floats:
        (p, x), (begin, p_before, x_before) = held(self), self._past[0]
        close(p[k], guess)
        if len(self._past) > 1:  # the cubic with the rate of the last point, through that before and p
            points = np.array([self._past[1][0], time]) - begin
            rest = np.array([self._past[1][1], p]) - p_before - points[:, None, None] * self._rate
            square = np.linalg.solve(points[:, None] ** [2, 3], rest.reshape(2, -1))[0].reshape(p.shape)
            h = time - begin
            path = h * p_before + h**2 / 2.0 * self._rate + h**3 / 3.0 * square
            np.testing.assert_allclose(x, x_before + path[self._second], rtol=0.0, atol=1e-11)
            ends["predicted"] += 1
        return solved(self, k, time, guess, bound)

    def checked_accept(self: PlantFunctions, time: float, after: float) -> None:
        accept(self, time, after)
        (p, x), (_, p_found, x_found) = held(self), self._past[0]
        close(p, p_found)
        close(x, x_found)
        ends["found"] += 1

    monkeypatch.setattr(PlantFunctions, "_solved", checked_solved)
    monkeypatch.setattr(PlantFunctions, "_accept", checked_accept)
    simulator.run(plant={number: vehicle(number) for number in (3, 4)}, stop_time=0.05, step=0.05)
    assert ends["predicted"] > 0
    assert ends["found"] > 20


def test_a_push_in_the_plant_is_met(simulator: mog.Simulator) -> None:
    def pushed(t: float, x: Floats, v: Floats, u: Floats) -> Floats:
        return vehicle(4)(t, x, v, u) + (80.0 if 0.513 <= t < 0.7 else 0.0)

    row = np.zeros((5, 2))
    row[3] = 80.0
    rows = mog_disturbance([0.513, 0.7], [row, 0.0 * row])
    result = simulator.run(plant={4: pushed}, stop_time=STOP, step=0.1)
    whole = simulator.run(inputs=rows, stop_time=STOP, step=0.1)
    assert np.abs(whole.x - simulator.run(stop_time=STOP, step=0.1).x).max() > 1e-3
    assert np.abs(result.x - whole.x).max() < 2e-4


def mog_disturbance(times: list[float], rows: list[Floats]) -> Any:
    from mixed_order_game.fmu.schedule import Disturbance

    return Disturbance(np.array(times), np.array(rows))


def test_a_game_with_an_external_plant_runs_with_a_function(tmp_path: Path) -> None:
    """Gains of its own, few variables, from any time on."""
    game = mog.Game("five_vehicles")
    game["expose"] = "outputs"
    game.player(4)["gains"] = {"k4": 30.0, "epsilon": 0.1}
    start = 1.7e9
    whole = mog.run(game, stop_time=start + 0.5, start_time=start, step=0.05)
    player = game.player(4)
    for key in ("dynamics", "disturbance", "x0", "v0"):
        player.pop(key, None)
    player["plant"] = "external"
    path = game.write(tmp_path / "external.toml")
    starts = {"x[4,1]": 0.0, "x[4,2]": -8.0}
    result = mog.run(
        path, plant={4: vehicle(4)}, start_values=starts, stop_time=start + 0.5, start_time=start, step=0.05
    )
    assert np.abs(result.x - whole.x).max() < 2e-4
    with pytest.raises(ModelError, match=r"give Python's run plant=\{4: f\}"):
        mog.run(path)
    with pytest.raises(ModelError, match="waits for the plant of player 4"):
        mog.validate(path)
    with pytest.raises(ExperimentError, match="no function of player 4, whose plant is external"):
        mog.run(path, plant={5: vehicle(5)})


def test_masses_drag_and_bounds_settle(simulator: mog.Simulator) -> None:
    """Gains of u above and below 1, where an exchange once a step would not settle."""
    for plant in (
        lambda t, x, v, u: 0.5 * u - v * np.abs(v),
        lambda t, x, v, u: np.clip(10.0 * u, -800.0, 800.0),
    ):
        result = simulator.run(plant={4: plant}, stop_time=1.5, step=0.1, outputs=["x"])
        assert np.abs(result.x - result.x_star)[-1].max() < 0.02


def test_feedback_gives_the_unknown_dynamics(simulator: mog.Simulator) -> None:
    game = mog.Game("five_vehicles")
    for number in range(1, 6):
        del game.player(number)["dynamics"]
    with mog.Simulator(game) as without:
        result = without.run(feedback=unknown_dynamics, stop_time=STOP, step=0.1)
        assert difference(result) < 2e-4
        assert difference(result, 0.9) < 1e-5
    mixed = simulator.run(
        plant={4: vehicle(4)}, feedback={1: lambda t, x, v: 0.5 * x[3] + math.sin(t)}, stop_time=0.5
    )
    game = mog.Game("five_vehicles")
    game.player(1)["dynamics"] = {"linear": [[2, 1.0], [4, 0.5]]}
    game.player(1)["disturbance"] = {"amplitude": 2.0, "frequency": 1.0}
    assert np.abs(mixed.x - game.run(stop_time=0.5).x).max() < 2e-4


def broken(t: float, *_: Floats) -> Floats:
    if t > 0.25:
        raise ZeroDivisionError("no road left")
    return np.zeros(2)


@pytest.mark.parametrize(
    ("arguments", "error", "said"),
    [
        ({"plant": {6: broken}}, ExperimentError, "has the player 6, expected a number from 1 to 5"),
        ({"plant": {4: 1.0}}, ExperimentError, "plant of player 4 is 1.0, expected a function"),
        ({"plant": broken}, ExperimentError, "expected functions by player"),
        ({"plant": {4: broken}}, SimulationError, r"player 4 at 0\.2\d* s: ZeroDivisionError: no road left"),
        ({"plant": {4: lambda t, x, v, u: x[0]}}, ExperimentError, r"at 0 s has the shape \(\), not \(2,\)"),
        ({"plant": {3: lambda t, x, v, u: v}}, ExperimentError, "rate \\[nan, nan\\], expected finite"),
        ({"plant": {4: lambda t, x, v, u: u - 30 * np.sign(v)}}, SimulationError, r"tanh\(s / width\)"),
        ({"plant": {4: broken}, "changes": {0.1: {"x[4,1]": 1.0}}}, ExperimentError, "set twice: by plant"),
        ({"plant": {4: broken}, "start_values": {"d_ext[4,1]": 1.0}}, VariableError, "no variable d_ext"),
        ({"plant": {4: broken}, "inputs": np.ones((5, 2))}, ExperimentError, "player 4, whose plant is"),
        ({"plant": {4: broken}, "feedback": {4: broken}}, ExperimentError, "player 4, whose plant is"),
        ({"feedback": {0: broken}}, ExperimentError, "has the player 0, expected a number from 1 to 5"),
        ({"feedback": {2: broken}}, SimulationError, r"feedback of player 2 at 0\.2\d* s: ZeroDivisionError"),
        ({"feedback": lambda t, x, v: -v}, ExperimentError, "player 1 at 0 s is .* as it has order 1"),
        ({"feedback": lambda t, x, v: x[0]}, ExperimentError, r"shape \(2,\), not \(5, 2\)"),
        ({"feedback": 3.0}, ExperimentError, "expected a function or functions by player"),
        ({"feedback": broken, "inputs": np.zeros((5, 2))}, ExperimentError, "both set d_ext"),
    ],
)
def test_what_is_refused(
    arguments: dict[str, Any], error: type[Exception], said: str, simulator: mog.Simulator
) -> None:
    with pytest.raises(error, match=said):
        simulator.run(stop_time=0.4, **arguments)


def test_a_bounded_control_is_refused_and_a_run_after_an_error_is_as_new(simulator: mog.Simulator) -> None:
    game = mog.Game("five_vehicles")
    game.player(4)["u_max"] = 50.0
    with pytest.raises(GameError, match="player 4 has u_max, which belongs to the plant"):
        mog.run(game, plant={4: vehicle(4)})
    with pytest.raises(SimulationError):
        simulator.run(plant={4: broken}, stop_time=0.4)
    again, once = (simulator.run(plant={4: vehicle(4)}, stop_time=0.1) for _ in range(2))
    for name, column in once.columns.items():
        np.testing.assert_array_equal(again[name], column, err_msg=name)


def test_the_command_takes_functions_from_files(tmp_path: Path) -> None:
    (tmp_path / "drag.py").write_text("def drag(v): return -0.5 * v\n")
    (tmp_path / "models.py").write_text(
        "import drag\n"
        "def vehicle(t, x, v, u): return u + drag.drag(v)\n"
        "def wind(t, x, v): return 0.3 * x\n"
        "mass = 2.0\n"
    )
    (tmp_path / "broken.py").write_text("import nothing_of_the_kind\n")

    def said(*options: str) -> str:
        arguments = ["run", "five_vehicles", "--stop-time", "0.2", "--json", *options]
        done = CliRunner(env={"COLUMNS": "200", "NO_COLOR": "1"}).invoke(app, arguments)
        return done.output if done.exit_code else str(json.loads(done.output)["metrics"]["final_error"])

    models = tmp_path / "models.py"
    direct = mog.run("five_vehicles", plant={4: lambda t, x, v, u: u - 0.5 * v}, stop_time=0.2)
    assert said("--plant", f"4={models}:vehicle") == str(direct.metrics.final_error)
    assert said("--plant", f"4={models}:vehicle", "--feedback", f"{models}:wind") != said(
        "--plant", f"4={models}:vehicle"
    )
    assert "models.py has no function mass: it has vehicle, wind" in said("--feedback", f"{models}:mass")
    assert "broken.py cannot be run: ModuleNotFoundError" in said("--feedback", f"{tmp_path}/broken.py:f")
    assert "there is no Python file" in said("--feedback", f"{tmp_path}/none.py:f")
    assert "'f' is no function of a file" in said("--feedback", "f")
    assert "'vehicle.py:f' is no player with its function" in said("--plant", "vehicle.py:f")
