"""Graphs that switch and disturbances from files, down to what the FMU does with them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mixed_order_game import Model, Simulator, default_game, read_model
from mixed_order_game.fmu.schedule import (
    Disturbance,
    GraphSchedule,
    ScheduleError,
    graph_schedule,
    read_disturbance,
    read_graph_schedule,
    write_disturbance,
    write_graph_schedule,
)
from mixed_order_game.game.graphs import graph_of_text
from tests.oracle.closed_loop import initial_state, state_rate, unpack
from tests.oracle.game import read_game
from tests.oracle.simulate import simulate


@pytest.fixture(scope="module")
def model(fmu: Path) -> Model:
    return read_model(fmu)


TOML = """
[[graph]]
time = 0.0
edges = [[1, 2], [2, 3, 0.5], [3, 4], [4, 5]]

[[graph]]
time = 0.5
graph = "star"
"""


def test_toml(tmp_path: Path, model: Model) -> None:
    path = tmp_path / "switching.toml"
    path.write_text(TOML)
    schedule = read_graph_schedule(path, model)
    start = schedule.start_values()
    assert len(start) == 10
    assert start["a[2,3]"] == 0.5
    assert start["a[1,5]"] == 0.0
    changes = schedule.changes(20.0)
    assert list(changes) == [0.5]
    assert {name for name, value in changes[0.5].items() if value} == {f"a[1,{j}]" for j in range(2, 6)}
    assert schedule.changes(0.5) == {}
    assert schedule.start_values(1.0) == changes[0.5]


def test_period(tmp_path: Path, model: Model) -> None:
    path = tmp_path / "switching.toml"
    path.write_text("period = 2.0\n" + TOML)
    schedule = read_graph_schedule(path, model)
    assert list(schedule.changes(5.0)) == [0.5, 2.0, 2.5, 4.0, 4.5]
    assert schedule.start_values(2.1)["a[2,3]"] == 0.5
    with pytest.raises(ScheduleError, match="more than 1000000 graphs"):
        schedule.changes(1e9)


def test_csv(tmp_path: Path, model: Model) -> None:
    path = tmp_path / "switching.csv"
    path.write_text('time,"a[1,2]","a[1,3]"\n0.25,0,1\n0.5,,0.5\n')
    schedule = read_graph_schedule(path, model)
    assert schedule.start_values() == {}
    assert schedule.changes(1.0) == {0.25: {"a[1,2]": 0.0, "a[1,3]": 1.0}, 0.5: {"a[1,3]": 0.5}}
    again = write_graph_schedule(tmp_path / "again.csv", schedule)
    assert read_graph_schedule(again, model) == schedule
    assert again.read_text().splitlines()[0] == '"time","a[1,2]","a[1,3]"'


def test_fmu_follows_the_schedule(fmu: Path, tmp_path: Path, model: Model) -> None:
    """After the switch the run is the one of the new graph from the state reached, and not before."""
    (tmp_path / "switching.toml").write_text(TOML)
    schedule = read_graph_schedule(tmp_path / "switching.toml", model)
    with Simulator(fmu) as simulator:
        switched = simulator.run(
            start_values=schedule.start_values(), changes=schedule.changes(1.0), stop_time=1.0, tolerance=1e-9
        )
        first = simulator.run(start_values=schedule.start_values(), stop_time=1.0, tolerance=1e-9)
        by_hand = {f"a[{i},{j}]": float(i == 1) for i in range(1, 6) for j in range(i + 1, 6)}
        hand = simulator.run(
            start_values=schedule.start_values(), changes={0.5: by_hand}, stop_time=1.0, tolerance=1e-9
        )
    before = switched.time <= 0.5
    np.testing.assert_allclose(switched.x[before], first.x[before], atol=1e-7)
    assert np.abs(switched.x[~before] - first.x[~before]).max() > 1e-3
    np.testing.assert_array_equal(switched.x, hand.x)


def test_from_graphs(model: Model) -> None:
    graphs = {0.0: graph_of_text("1-2 2-3 3-4 4-5", 5), 1.0: graph_of_text("1-5 5-2 2-4 4-3", 5)}
    schedule = graph_schedule(model, graphs)
    assert schedule.start_values()["a[1,2]"] == 1.0
    assert schedule.changes(2.0)[1.0]["a[1,2]"] == 0.0


def test_disturbance(fmu: Path, tmp_path: Path, model: Model) -> None:
    path = tmp_path / "gust.csv"
    path.write_text('time,"d_ext[1,2]","d_ext[4,1]"\n0.2,30,-5\n0.4,0,0\n')
    held = read_disturbance(path, model)
    assert held(0.1).tolist() == np.zeros((5, 2)).tolist()
    assert held(0.2)[0, 1] == 30.0
    assert held(0.2 - 1e-12)[3, 0] == 0.0
    assert held(0.39)[0, 1] == 30.0
    assert held(7.0)[0, 1] == 0.0
    straight = read_disturbance(path, model, linear=True)
    assert straight(0.3)[0, 1] == pytest.approx(15.0)
    assert straight(0.3)[3, 0] == pytest.approx(-2.5)
    assert straight(0.1)[0, 1] == 0.0

    def by_hand(time: float) -> np.ndarray:
        push = np.zeros((5, 2))
        if 0.2 - 1e-9 <= time < 0.4 - 1e-9:
            push[0, 1], push[3, 0] = 30.0, -5.0
        return push

    with Simulator(fmu) as simulator:
        from_file = simulator.run(stop_time=0.8, inputs=held)
        expected = simulator.run(stop_time=0.8, inputs=by_hand)
        without = simulator.run(stop_time=0.8)
    np.testing.assert_array_equal(from_file.x, expected.x)
    assert np.abs(from_file.x - without.x).max() > 1e-2


def pulse(path: Path) -> Path:
    """Two rows between the samples at 1 and 1.02 s."""
    path.write_text('time,"d_ext[1,1]"\n1.005,1000\n1.015,0\n')
    return path


def test_every_row_acts_between_two_samples(fmu: Path, tmp_path: Path, model: Model) -> None:
    inputs = read_disturbance(pulse(tmp_path / "pulse.csv"), model)
    push = np.zeros((5, 2))
    push[0, 0] = 1000.0
    game = read_game(default_game())
    expected = simulate(
        game, [1.02], rtol=1e-9, breakpoints=[(1.005, {"d_ext": push}), (1.015, {"d_ext": 0.0})]
    )
    with Simulator(fmu) as simulator:
        result = simulator.run(stop_time=1.1, inputs=inputs)
        late = simulator.run(start_time=1.01, stop_time=1.02, inputs=inputs)
        without = simulator.run(start_time=1.01, stop_time=1.02)
    assert len(result.time) == 56
    assert result["x[1,1]"][51] == pytest.approx(expected.x[0, 0, 0], abs=1e-4)
    assert result["x[1,1]"][51] == pytest.approx(8.03, abs=0.01)
    assert late.x[-1, 0, 0] - without.x[-1, 0, 0] > 3.0  # the row before the start is in force there


def test_jumps_at_every_sample(fmu: Path) -> None:
    """Inputs that change every 20 ms, against the oracle stopped at each change."""
    times = np.arange(0.02, 0.6, 0.02)
    pushes = [np.outer(np.arange(1, 6), [1.0, -2.0]) * np.cos(7.0 * time) for time in times]
    expected = simulate(
        read_game(default_game()),
        [0.6],
        rtol=1e-9,
        breakpoints=[(time, {"d_ext": push}) for time, push in zip(times, pushes, strict=True)],
    )

    def by_hand(time: float) -> np.ndarray:
        row = np.searchsorted(times, time + 1e-9) - 1
        return pushes[row] if row >= 0 else np.zeros((5, 2))

    with Simulator(fmu) as simulator:
        result = simulator.run(stop_time=0.6, inputs=by_hand)
        without = simulator.run(stop_time=0.6)
    assert np.abs(result.x[-1] - expected.x[-1]).max() < 1e-4
    assert np.abs(without.x[-1] - expected.x[-1]).max() > 1e-2


def test_straight_between_rows(fmu: Path, tmp_path: Path, model: Model) -> None:
    """The FMU gets the slope, not a staircase: the oracle's rates under a ramp from 1.005 to 1.015 s."""
    ramp = read_disturbance(pulse(tmp_path / "ramp.csv"), model, linear=True)
    game = replace(read_game(default_game()), robust=False)
    inside = np.zeros((5, 2), dtype=np.bool_)
    state, begin = initial_state(game), 0.0
    for end in (1.005, 1.015, 1.02):
        state = solve_ivp(
            lambda t, y: np.asarray(state_rate(game, t, y, inside, np.asarray(ramp(t)))),
            (begin, np.nextafter(end, 0.0)),
            state,
            rtol=1e-9,
            atol=1e-10,
        ).y[:, -1]
        begin = end
    with Simulator(fmu) as simulator:
        result = simulator.run(
            start_values={"robust": False}, stop_time=1.02, inputs=ramp, tolerance=1e-9, outputs=["x"]
        )
    np.testing.assert_allclose(result.x[-1], unpack(game, state).x, rtol=0.0, atol=1e-5)


def test_rows_at_a_large_time(model: Model) -> None:
    begin = 1.76e9
    values = np.ones((1, model.players, model.dimension))
    assert Disturbance(np.array([begin + 1.0]), values)(begin + 0.5).max() == 0.0


@pytest.mark.parametrize(
    ("time", "value", "told"),
    [([1.0, 1.0], 0.0, "do not go up"), ([0.0, 1.0], np.nan, "finite"), ([0.0], 0.0, "are not")],
)
def test_rows_that_cannot_be(time: list[float], value: float, told: str) -> None:
    with pytest.raises(ScheduleError, match=told):
        Disturbance(np.array(time), np.full((2, 5, 2), value))


def test_disturbance_round_trip(tmp_path: Path, model: Model) -> None:
    rng = np.random.default_rng(5)
    time, values = np.cumsum(rng.random(7)), rng.normal(size=(7, 5, 2))
    path = write_disturbance(tmp_path / "noise.csv", time, values)
    again = read_disturbance(path, model)
    assert isinstance(again, Disturbance)
    np.testing.assert_array_equal(again.time, time)
    np.testing.assert_array_equal(again.values, values)
    with pytest.raises(ScheduleError, match="are not"):
        write_disturbance(tmp_path / "noise.csv", time, values[0])


@pytest.mark.parametrize(
    ("name", "text", "told"),
    [
        ("a.csv", "", "the first line must name time"),
        ("a.csv", 'time,"a[1,2]"\n', "no rows"),
        ("a.csv", "time,a[1,2]\n0,1\n", "the name a[1 is cut at its comma"),
        ("a.csv", "time,k1\n0,1\n", "the column k1 is not an edge"),
        ("a.csv", 'time,"a[1,2]","a[1,2]"\n0,1,1\n', "every variable once"),
        ("a.csv", 'time,"a[1,9]"\n0,1\n', "there is no variable a[1,9]"),
        ("a.csv", 'time,"a[1,2]"\n0,x\n', "row 2: 'x' is not a number"),
        ("a.csv", 'time,"a[1,2]"\n0,nan\n', "row 2: 'nan' is not finite"),
        ("a.csv", 'time,"a[1,2]"\n0,-1\n', "a[1,2] is -1, expected a number of at least 0"),
        ("a.csv", 'time,"a[1,2]"\n0,1,2\n', "row 2 has 3 cells, the header has 2"),
        ("a.csv", 'time,"a[1,2]"\n1,1\n1,0\n', "the times do not go up at row 3"),
        ("a.csv", 'time,"a[1,2]"\n,1\n', "the times do not go up at row 2"),
        ("a.csv", 'time,"a[1,2]"\n0,"1\n', "cannot be read"),
        ("a.toml", "[[graph", "cannot be read"),
        ("a.toml", "", "a table [[graph]] for every switch"),
        ("a.toml", "graph = 3", "a table [[graph]] for every switch"),
        ("a.toml", "[[graph]]\ntime = 0", "either edges or graph"),
        ("a.toml", '[[graph]]\ngraph = "ring"', "the time of graph 1 must be a number"),
        ("a.toml", '[[graph]]\ntime = 0\ngraph = "all"', "728 graphs"),
        ("a.toml", '[[graph]]\ntime = 0\ngraph = "circle"', "no kind of graph"),
        ("a.toml", "[[graph]]\ntime = 0\nedges = [[1]]", "not a list of [i, j]"),
        ("a.toml", "[[graph]]\ntime = 0\nedges = [[1, 6]]", "no new edge of 5 players"),
        ("a.toml", "[[graph]]\ntime = 0\nedges = [[1, 2], [2, 1]]", "no new edge"),
        ("a.toml", "[[graph]]\ntime = 0\nedges = [[1, true]]", "two players"),
        ("a.toml", '[[graph]]\ntime = 0\ngraph = "ring"\nx = 1', "unknown key x"),
        ("a.toml", 'period = 0\n[[graph]]\ntime = 0\ngraph = "ring"', "the period 0 s is not longer"),
        (
            "a.toml",
            '[[graph]]\ntime = 1\ngraph = "ring"\n[[graph]]\ntime = 0\ngraph = "ring"',
            "times of the schedule",
        ),
        ("a.txt", "", "must end in .toml or .csv"),
    ],
)
def test_schedules_that_cannot_be(name: str, text: str, told: str, tmp_path: Path, model: Model) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(ScheduleError) as error:
        read_graph_schedule(tmp_path / name, model)
    assert told in str(error.value)
    assert name in str(error.value)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("time,d_ext[1,1]\n0,1\n", "the name d_ext[1 is cut at its comma"),
        ('time,"k1"\n0,1\n', "k1 is not an external disturbance"),
        ('time,"d_ext[1,1]"\n0,\n', "a cell is empty"),
    ],
)
def test_disturbances_that_cannot_be(text: str, told: str, tmp_path: Path, model: Model) -> None:
    (tmp_path / "d.csv").write_text(text)
    with pytest.raises(ScheduleError) as error:
        read_disturbance(tmp_path / "d.csv", model)
    assert told in str(error.value)
    for path in (tmp_path / "none.csv", tmp_path / "d.txt"):
        with pytest.raises(ScheduleError):
            read_disturbance(path, model)


def test_empty_schedule() -> None:
    with pytest.raises(ScheduleError, match="names no graph"):
        GraphSchedule(())
