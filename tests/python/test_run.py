"""Runs through fmpy: samples, inputs, changes on the way, reused instances, errors in the FMU's words."""

import os
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from mixed_order_game import (
    GameError,
    Result,
    SimulationError,
    Simulator,
    VariableError,
    default_game,
    load,
    read_model,
    run,
)
from mixed_order_game.fmu.build import shipped_game
from mixed_order_game.fmu.model import Value
from mixed_order_game.fmu.schedule import read_disturbance, read_graph_schedule
from mixed_order_game.names import parse_name
from mixed_order_game.results.metrics import JUDGED
from tests.conftest import FmuOf

OUTPUTS = ("x", "x_star", "nash_error", *JUDGED)


@pytest.fixture(scope="module")
def simulator(fmu: Path) -> Simulator:
    return Simulator(fmu)


def test_defaults(fmu: Path) -> None:
    result = run(fmu)
    assert result.time.shape == (1001,)
    assert result.time[[0, -1]].tolist() == [0.0, 20.0]
    assert result.x.shape == (1001, 5, 2)
    np.testing.assert_array_equal(result.x[0], [[-5, 8], [-4, -6], [1, 8], [0, -8], [-1, 10]])
    np.testing.assert_allclose(result.x_star, -0.5, atol=1e-12)
    assert result.largest_error(16.0) < 0.00125
    for signal in (result.v, result.z, result.u, result.phi, result.nn, result.W_norm2):
        assert signal.shape == (1001, 5, 2)
    stems = {parse_name(name)[0] for name in result.columns}
    assert stems == {
        *("x", "v", "u", "nash_error", "x_star", "z", "W_norm2", "phi", "nn", "cost", "consensus_error"),
        *("gradient_norm", "solver_steps", "solver_rhs_evaluations", "solver_events"),
        *JUDGED,
    }
    assert len(result.columns) == 87
    assert result.parameters["k1"] == 10.0
    assert result["solver_steps"][-1] > 100
    np.testing.assert_allclose(
        result.nash_error, np.linalg.norm(result.x + 0.5, axis=(1, 2)), rtol=1e-9, atol=1e-14
    )


def test_chosen_outputs(simulator: Simulator) -> None:
    result = simulator.run(stop_time=0.1, outputs=["y", "W", "x[1,2]", "cost"])
    assert result.y.shape == (6, 5, 5, 2)
    assert result.W.shape == (6, 5, 11, 2)
    assert "x[1,2]" in result.columns
    assert "x[1,1]" not in result.columns
    assert result.x_star.shape == (5, 2)
    assert np.all(result["cost[1]"] > 0.0)


def test_derivatives_when_named(simulator: Simulator) -> None:
    result = simulator.run(
        stop_time=0.02, step=1e-5, outputs=["x", "v", "der(x)", "der(v[4,1])"], tolerance=1e-10
    )
    rates = [name for name in result.columns if name.startswith("der(")]
    assert rates == [*(f"der(x[{i},{k}])" for i in range(1, 6) for k in (1, 2)), "der(v[4,1])"]
    for name in rates:
        difference = np.gradient(result[name[4:-1]], result.time)
        np.testing.assert_allclose(result[name][1:-1], difference[1:-1], rtol=1e-3, atol=1e-2, err_msg=name)
    with pytest.raises(VariableError, match=r"there is no variable der\(q\)"):
        simulator.run(outputs=["der(q)"])


def test_start_values(simulator: Simulator) -> None:
    values = {"x0[1,1]": 3.0, "k1": 20.0, "robust": False, "perturbed": False}
    result = simulator.run(start_values=values, stop_time=4.0)
    assert result.x[0, 0, 0] == 3.0
    assert {name: result.parameters[name] for name in values} == values
    assert result.largest_error(3.5) < 1e-6
    np.testing.assert_array_equal(result.phi, 0.0)


def test_reused_instance_equals_a_new_one(fmu: Path, simulator: Simulator) -> None:
    simulator.run(start_values={"k1": 17.0, "x0[2,2]": 1.0}, stop_time=0.5)
    with pytest.raises(VariableError):
        simulator.run(start_values={"nonsense": 1.0})
    again = simulator.run(stop_time=1.0)
    fresh = run(fmu, stop_time=1.0)
    for name, column in fresh.columns.items():
        np.testing.assert_array_equal(again[name], column, err_msg=name)


def test_samples(simulator: Simulator) -> None:
    assert simulator.run(stop_time=0.25, step=0.1).time.tolist() == [0.0, 0.1, 0.2, 0.25]
    assert simulator.run(stop_time=0.3, step=0.1).time == pytest.approx([0.0, 0.1, 0.2, 0.3], abs=1e-15)
    assert simulator.run(stop_time=0.3, step=5.0).time.tolist() == [0.0, 0.3]
    late = simulator.run(start_time=3.0, stop_time=4.0, step=0.5)
    assert late.time.tolist() == [3.0, 3.5, 4.0]
    np.testing.assert_array_equal(late.x[0, 0], [-5.0, 8.0])


TWO_PI = 2 * Fraction("3.14159265358979323846264338327950288419716939937510582097494459230781640628621")
UNIX = 1.76e9


def with_moved_phases(simulator: Simulator, start: float) -> dict[str, Value]:
    """Frequencies and phases with which a run from 0 equals one from start, reduced in fractions."""
    values: dict[str, Value] = {}
    for k, index in enumerate(simulator.model.indexed("disturbance_phase")):
        frequency, phase = 0.3 + 0.7 * k, 0.1 * k
        angle = Fraction(frequency) * Fraction(start) + Fraction(phase)
        values[f"disturbance_frequency[{index[0]},{index[1]}]"] = frequency
        values[f"disturbance_phase[{index[0]},{index[1]}]"] = float(angle - round(angle / TWO_PI) * TWO_PI)
    return values


def test_a_run_from_unix_time_is_one_from_zero(simulator: Simulator) -> None:
    for tolerance in (1e-4, 1e-6, 1e-10):

        def case(start: float, tolerance: float = tolerance) -> Result:
            return simulator.run(
                start_values=with_moved_phases(simulator, UNIX - start) | {"judge_from": start + 1.5},
                start_time=start,
                stop_time=start + 2.0,
                step=1.0 / 64.0,
                tolerance=tolerance,
            )

        late, moved = case(UNIX), case(0.0)
        np.testing.assert_array_equal(late.time, UNIX + moved.time)
        for name, column in moved.columns.items():
            np.testing.assert_array_equal(late[name], column, err_msg=f"{name} at {tolerance}")


def test_files_and_figures_of_a_run_from_unix_time(simulator: Simulator, tmp_path: Path) -> None:
    def case(start: float) -> Result:
        gust = tmp_path / "gust.csv"
        gust.write_text(f'time,"d_ext[1,1]"\n{start + 1.0!r},30\n{start + 1.25!r},0\n')
        graphs = tmp_path / "graphs.toml"
        graphs.write_text(
            'period = 0.5\n[[graph]]\ntime = 0.0\ngraph = "ring"\n[[graph]]\ntime = 0.25\ngraph = "star"\n'
        )
        schedule = read_graph_schedule(graphs, simulator.model)
        return simulator.run(
            start_values={
                **with_moved_phases(simulator, UNIX - start),
                **schedule.start_values(start),
                "judge_from": start + 1.5,
            },
            start_time=start,
            stop_time=start + 2.0,
            step=1.0 / 64.0,
            inputs=read_disturbance(gust, simulator.model),
            changes=schedule.changes(start + 2.0, start),
        )

    late, moved = case(UNIX), case(0.0)
    np.testing.assert_array_equal(late.x, moved.x)
    assert late.metrics == moved.metrics
    assert late.measured(settle_time=UNIX + 1.75) == moved.measured(settle_time=1.75)
    assert late.largest_error(UNIX + 1.5, UNIX + 2.0) == moved.largest_error(1.5, 2.0)
    assert late.window(UNIX + 1.0, UNIX + 1.25).sum() == 17
    assert "1760000000 to 1760000002 s" in repr(late)
    for suffix in (".csv", ".parquet"):
        np.testing.assert_array_equal(load(late.save(tmp_path / f"late{suffix}")).time, late.time)


def test_samples_at_unix_time(simulator: Simulator) -> None:
    for step in (0.02, 0.1, 0.3):
        late = simulator.run(start_time=UNIX, stop_time=UNIX + 3.0, step=step, outputs=["x[1,1]"])
        assert len(late.time) == round(3.0 / step) + 1
        np.testing.assert_allclose(np.diff(late.time), step, atol=3e-7)
    assert simulator.run(start_time=UNIX + 0.3, step=5.0, outputs=["x[1,1]"]).time[-1] == UNIX + 20.3
    with pytest.raises(
        SimulationError, match="step = 1e-08 s is below the resolution of times at 1760000000"
    ):
        simulator.run(start_time=UNIX, stop_time=UNIX + 1e-4, step=1e-8)


def test_tolerance_is_used(simulator: Simulator) -> None:
    exact = simulator.run(stop_time=2.0, tolerance=1e-11)
    errors = [
        np.abs(simulator.run(stop_time=2.0, tolerance=tolerance).x - exact.x).max()
        for tolerance in (1e-4, 1e-6, 1e-8)
    ]
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 1e-4


def test_inputs_as_function_and_arrays(simulator: Simulator) -> None:
    rng = np.random.default_rng(7)
    constant = rng.normal(size=(5, 2))
    by_function = simulator.run(stop_time=0.4, inputs=lambda _: constant)
    by_array = simulator.run(stop_time=0.4, inputs=constant)
    by_rows = simulator.run(stop_time=0.4, inputs=np.broadcast_to(constant, (21, 5, 2)))
    by_value = simulator.run(
        stop_time=0.4,
        start_values={f"d_ext[{i + 1},{k + 1}]": constant[i, k] for i in range(5) for k in range(2)},
    )
    without = simulator.run(stop_time=0.4)
    for other in (by_array, by_rows, by_value):
        np.testing.assert_array_equal(by_function.x, other.x)
    assert np.abs(by_function.x - without.x).max() > 1e-3


def test_inputs_act_from_the_beginning_of_their_step(simulator: Simulator) -> None:
    rows = np.zeros((11, 5, 2))
    rows[5:, 0, 0] = 50.0
    off = simulator.run(stop_time=1.0, step=0.1)
    on = simulator.run(stop_time=1.0, step=0.1, inputs=rows)
    difference = np.abs(on.x[:, 0, 0] - off.x[:, 0, 0])
    assert difference[:6].max() < 1e-4
    assert difference[6] > 1e-2


def test_changes_on_the_way(simulator: Simulator) -> None:
    options = {"stop_time": 1.0, "step": 0.1, "tolerance": 1e-9}
    base = simulator.run(**options)  # type: ignore[arg-type]
    # A change between two samples, and one at a sample that rounding hides.
    changed = simulator.run(changes={0.35: {"k1": 30.0}, 0.1 + 0.2: {"k2": 1.0}}, **options)  # type: ignore[arg-type]
    np.testing.assert_allclose(changed.x[:4], base.x[:4], rtol=0.0, atol=1e-7)
    assert np.abs(changed.x[4:] - base.x[4:]).max() > 1e-6


def test_names_without_indices_and_texts_as_on_the_command(simulator: Simulator) -> None:
    singly = {f"a[{i},{j}]": 2.0 for i in range(1, 6) for j in range(i + 1, 6)}
    times = {"stop_time": np.float64(0.4), "step": np.array(0.1)}
    changed = simulator.run(start_values=singly, changes={0.2: singly | {"k1": 5.0}}, **times)  # type: ignore[arg-type]
    by_kind = simulator.run(
        start_values={"a": 2.0},
        changes={0.2: {"a": 2.0, "k1": 5.0}},
        outputs="x, nash_error",
        **times,  # type: ignore[arg-type]
    )
    np.testing.assert_array_equal(by_kind.x, changed.x)
    assert by_kind.parameters == changed.parameters
    assert set(by_kind.columns) == {name for name in changed.columns if name.split("[")[0] in OUTPUTS}


def test_costs_changed_on_the_way_move_the_equilibrium(simulator: Simulator) -> None:
    values = {"robust": False, "perturbed": False}
    changes = {5.0: {f"cost_linear[{i},1]": 0.0 for i in range(1, 6)}}
    result = simulator.run(start_values=values, stop_time=10.0, changes=changes)
    np.testing.assert_allclose(result.x_star, [[0.0, -0.5]] * 5, atol=1e-12)
    assert result["x_star[1,1]"][0] == pytest.approx(-0.5)
    assert result.largest_error(9.5) < 1e-6


def test_progress(simulator: Simulator) -> None:
    times: list[float] = []
    simulator.run(stop_time=0.1, progress=times.append)
    assert times == pytest.approx([0.02, 0.04, 0.06, 0.08, 0.1])


def test_interrupted_run_leaves_the_simulator_usable(simulator: Simulator) -> None:
    def stop(_: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulator.run(progress=stop)
    assert simulator.run(stop_time=0.1).time[-1] == 0.1


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"stop_time": "5"}, "stop_time is '5', expected a number"),
        ({"start_time": None}, "start_time is None, expected a number"),
        ({"step": [0.1]}, "step is [0.1], expected a number"),
        ({"tolerance": True}, "tolerance is True, expected a number"),
        ({"changes": {"1": {"k1": 1.0}}}, "the time of a change is '1', expected a number"),
        ({"stop_time": 0.0}, "stop_time = 0 s is not after start_time = 0 s"),
        ({"stop_time": float("nan")}, "stop_time = nan"),
        ({"step": 0.0}, "step = 0 s is not positive"),
        ({"step": 1e-9}, "samples"),
        ({"tolerance": 0.0}, "tolerance = 0 is not between 0 and 1"),
        ({"inputs": "gust.csv"}, "inputs is not an array of numbers"),
        ({"inputs": [[1.0], [1.0, 2.0]]}, "inputs is not an array of numbers"),
        ({"inputs": lambda _: "x"}, "inputs(0) is not an array of numbers"),
        ({"inputs": [[1.0]]}, "inputs has the shape (1, 1), not (5, 2) or (1001, 5, 2)"),
        ({"inputs": [[float("nan")] * 2] * 5}, "inputs must be finite"),
        ({"inputs": lambda _: [0.0]}, "inputs(0) has the shape (1,), not (5, 2)"),
        (
            {"inputs": np.zeros((5, 2)), "changes": {1.0: {"d_ext[2,1]": 1.0}}},
            "d_ext[2,1] is set twice: by inputs and by start_values or changes",
        ),
        ({"changes": {20.0: {"k1": 1.0}}}, "the change at 20 s is outside [0, 20) s"),
    ],
)
def test_options_that_make_no_sense(options: dict[str, object], told: str, simulator: Simulator) -> None:
    with pytest.raises(SimulationError) as error:
        simulator.run(**options)  # type: ignore[arg-type]
    assert told in str(error.value)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"start_values": {"k5": 1.0}}, "there is no variable k5; did you mean k"),
        ({"start_values": {"x[1,1]": 1.0}}, "cannot be set"),
        ({"outputs": ["nothing"]}, "there is no variable nothing"),
        ({"changes": {1.0: {"x0[1,1]": 1.0}}}, "cannot be set during a run"),
    ],
)
def test_variables_that_cannot_be_used(options: dict[str, object], told: str, simulator: Simulator) -> None:
    with pytest.raises(VariableError) as error:
        simulator.run(**options)  # type: ignore[arg-type]
    assert told in str(error.value)


def test_the_fmus_own_words(simulator: Simulator) -> None:
    cut = {"a[1,2]": 0.0, "a[2,3]": 0.0}
    with pytest.raises(SimulationError, match="connected"):
        simulator.run(start_values=cut)
    assert simulator.run(start_values={**cut, "allow_disconnected": True}, stop_time=0.1).time[-1] == 0.1


def test_divergence_is_an_error(simulator: Simulator) -> None:
    unstable = {"robust": False, "perturbed": True, "x0[2,1]": 1000.0, "k1": 0.1}
    with pytest.raises(SimulationError):
        simulator.run(start_values=unstable, stop_time=20.0)
    assert simulator.run(stop_time=0.1).time[-1] == 0.1


def test_two_simulators_at_once(fmu: Path, fmu_of: FmuOf) -> None:
    with Simulator(fmu) as one, Simulator(fmu_of("interleaved_orders")) as two, Simulator(fmu) as three:
        two.run(stop_time=0.2)
        first, third = one.run(stop_time=0.2), three.run(stop_time=0.2)
    np.testing.assert_array_equal(first.x, third.x)


def test_games_in_place_of_an_fmu(fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As the command takes them: a game file, a game of the package by its name, the paper's for nothing."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    expected = run(fmu, stop_time=0.1)
    for game in ((), ("five_vehicles",), (str(default_game()),), (default_game(),)):
        np.testing.assert_array_equal(run(*game, stop_time=0.1).x, expected.x)
    assert read_model("opinion_formation").players == read_model(shipped_game("opinion_formation")).players
    with pytest.raises(GameError, match=r"there is no game six_vehicles; did you mean five_vehicles or .*\?"):
        run("six_vehicles")
    with pytest.raises(GameError, match=r"game\.txt ends in \.txt, expected an FMU \(\.fmu\), a game file"):
        Simulator("game.txt")
    with pytest.raises(GameError, match="is a folder, expected an FMU"):
        run(tmp_path)


def test_closed_simulator(fmu: Path) -> None:
    with Simulator(fmu) as one:
        assert one._folder is not None
        assert one._folder.exists() == (os.name == "nt")  # elsewhere the files go as soon as they are loaded
        one.run(stop_time=0.1)
        one.run(stop_time=0.1)
    assert not one._folder.exists()
    one.close()
    with pytest.raises(SimulationError, match="closed"):
        one.run()


def test_fmu_for_another_machine(fmu: Path, tmp_path: Path) -> None:
    import zipfile

    other = tmp_path / "other.fmu"
    with zipfile.ZipFile(fmu) as source, zipfile.ZipFile(other, "w") as target:
        for name in source.namelist():
            target.writestr(name.replace("linux64", "vax"), source.read(name))
    with pytest.raises(SimulationError, match="cannot be loaded"):
        Simulator(other)


def test_a_fine_start_adds_samples_and_changes_none(fmu: Path) -> None:
    plain = run(fmu, stop_time=2.0, tolerance=1e-9)
    fine = run(fmu, stop_time=2.0, tolerance=1e-9, fine_start=True)
    assert np.isin(plain.time, fine.time).all()
    assert fine.time[1] == pytest.approx(2e-6)
    assert len(fine.time) > len(plain.time) + 200
    shared = np.isin(fine.time, plain.time)
    np.testing.assert_allclose(fine.x[shared], plain.x, atol=1e-6)
    late = run(fmu, start_time=1.76e9, stop_time=1.76e9 + 1.0, fine_start=True)
    assert np.diff(late.time).min() > 0.0
