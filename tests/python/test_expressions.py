"""Games with expressions: trajectories and equilibria against formulas by hand, and what is refused."""

import ctypes
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.validation import validate_fmu
from scipy.integrate import solve_ivp
from scipy.optimize import root

import mixed_order_game as mog
from mixed_order_game.errors import GameError
from mixed_order_game.fmu.build import build_fmu
from tests.three_players import head

K = 0.2784645427610738
GAME = (
    head()
    + """[parameters]
price = { value = 12.0, min = 0.0, max = 100.0, description = "price at no demand" }
h = [5.0, 7.0, 6.0]
slope = 0.1
R = { value = [[0.0, 1.0, 0.0], [1.0, 0.0, 1.0], [0.0, 1.0, 0.0]], fixed = true }
[defaults]
cost = { linear = 0.25, expression = \"\"\"
    (x[i,1] - h[i])^2
    - price * x[i,1] * exp(-slope * sum(x[j,1] for j in 1..N))\"\"\" }
y0 = "x0"
z0 = "x0"
[[player]]
name = "a"
order = 1
x0 = 1.0
[[player]]
name = "b"
order = 2
x0 = 1.5
[player.dynamics]
linear = [[1, 0.3]]
expression = "sin(x[i,1]) * x[mod(i,N)+1,1] - 0.5 * v[i,1] * tanh(v[i,1]/0.1)"
[player.disturbance]
amplitude = 0.2
frequency = 3.0
expression = "0.3*cos(2*t) + exp(-t)"
[[player]]
name = "c"
order = 2
x0 = 0.5
[player.dynamics]
expression = "sum(R[i,j]*x[j]^3 for j in 1..N if j != i) / (1 + x[i]^2) - v[2] * log(2 + v[i]^2)"
"""
)
H = np.array([5.0, 7.0, 6.0])
A = np.array([[0.0, 1.0, 1.0], [1.0, 0.0, 0.5], [1.0, 0.5, 0.0]])
SECOND = np.array([False, True, True])


def own_gradients(y: np.ndarray, price: float = 12.0, slope: float = 0.1) -> np.ndarray:
    """d f_i / d x_i at row i of y, by hand."""
    own = np.diag(y) if y.ndim == 2 else y
    demand = np.exp(-slope * y.sum(axis=-1))
    return 2.0 * (own - H) - price * demand * (1.0 - slope * own) + 0.25


def rate(t: float, state: np.ndarray) -> np.ndarray:
    x, reference, y, W = state[:3], state[3:6], state[6:15].reshape(3, 3), state[15:].reshape(4, 3)
    gradient = own_gradients(y)
    shared = np.where(SECOND, x, reference)
    e = np.where(SECOND, reference + gradient, x - reference)
    S = np.array([np.exp(-((y - c) ** 2).sum(axis=1) / 25.0) for c in (-1.0, 0.0, 1.0, 2.0)])
    u = -np.where(SECOND, 20.0, 10.0) * e - (W * S).sum(axis=0) - 2.0 * np.tanh(K * 2.0 * e / 0.5)
    v = reference
    g = np.array(
        [
            0.0,
            0.3 * x[0] + np.sin(x[1]) * x[2] - 0.5 * v[1] * np.tanh(v[1] / 0.1),
            x[1] ** 3 / (1.0 + x[2] ** 2) - v[1] * np.log(2.0 + v[2] ** 2),
        ]
    )
    d = np.array([0.0, 0.2 * np.sin(3.0 * t) + 0.3 * np.cos(2.0 * t) + np.exp(-t), 0.0])
    driven = u + g + d
    y_rate = -50.0 * (A.sum(axis=1)[:, None] * y - A @ y + A * (y - shared))
    return np.concatenate(
        [
            np.where(SECOND, v, driven),
            np.where(SECOND, driven, -gradient),
            y_rate.ravel(),
            (5.0 * S * e).ravel(),
        ]
    )


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("expressions")
    game = folder / "sellers.toml"
    game.write_text(GAME, encoding="utf-8")
    return build_fmu(game, folder / "sellers.fmu")


def test_trajectory_is_that_of_the_formulas_by_hand(fmu: Path) -> None:
    result = mog.run(fmu, stop_time=6.0, step=0.05, tolerance=1e-8)
    x0 = np.array([1.0, 1.5, 0.5])
    start = np.concatenate([x0, [1.0, 0.0, 0.0], np.tile(x0, 3), np.zeros(12)])
    expected = solve_ivp(rate, (0.0, 6.0), start, "LSODA", result.time, rtol=1e-11, atol=1e-12).y[:3].T
    assert np.abs(result.x[:, :, 0] - expected).max() < 2e-6


def test_equilibrium_is_that_of_the_formulas_by_hand(fmu: Path) -> None:
    for changes in ({}, {"price": 20.0, "slope": 0.3}):
        result = mog.run(fmu, stop_time=0.01, start_values=changes)
        solved = root(
            own_gradients, np.ones(3), args=(changes.get("price", 12.0), changes.get("slope", 0.1)), tol=1e-14
        )
        assert np.abs(np.ravel(result.x_star) - solved.x).max() < 1e-10


def test_named_parameters_are_variables_with_their_bounds(fmu: Path) -> None:
    model = mog.read_model(fmu)
    assert {"price", "h[1]", "h[2]", "h[3]", "slope"} <= set(model.variables)
    assert not any(name.startswith("R[") for name in model.variables)  # fixed
    with pytest.raises(mog.MixedOrderGameError, match="price is -1, expected a number from 0 to 100"):
        mog.run(fmu, stop_time=0.01, start_values={"price": -1.0})


REFUSED = {
    "exp(": "the end stands there, expected a value",
    "x[9,1]": "the index of x is 9, expected 1 to 3",
    "foo * 2": '"foo" is no name here, expected one of x, v, t, i, l, N, D, order, pi, price, h, slope, R',
    "v[2,1]": "v stands there, which dynamics alone may depend on",
    "t": "t stands there, which disturbances alone may depend on",
    "x[i,1]^^2": '"^2" stands there, expected a value',
    "1e999": "the number 1e999 is out of range",
    "h[4]": "the index of h is 4, expected 1 to 3",
    "h": "h has 0 indices, expected 1",
    "x[i,1] > 1": "a condition stands where a number is expected",
    "abs(x[i,1], 2)": "abs has 2 arguments, expected 1",
    "if(x[i,1], 1, 2)": "a number stands where a condition is expected",
    "if(x[i,1] == 1, 1, 2)": "== stands between values that change in a run, expected < <= > >=",
    "mod(x[i,1], x[1,1])": "the second argument of mod changes in a run, expected",
    "square(x[i,1], 2)": "square stands there, which disturbances alone may depend on",
    "sum(x[j,1])": '")" stands there, expected "for" or an operator',
    "sine(x[i,1])": '"sine" is no function',
    "atan2(x[i,1])": "atan2 has 1 arguments, expected 2",
    "2 x[i,1]": '"x[i,1]" stands there, expected an operator or the end',
}


@pytest.mark.parametrize("text", REFUSED)
def test_texts_without_meaning_are_refused_where_they_stand(text: str, tmp_path: Path) -> None:
    head, rest = GAME.split('expression = """', 1)
    game = tmp_path / "bad.toml"
    game.write_text(head + f'expression = "{text}"' + rest.split('"""', 1)[1], encoding="utf-8")
    with pytest.raises(GameError) as refused:
        build_fmu(game, tmp_path / "bad.fmu")
    assert f"defaults.cost.expression, line {head.count(chr(10)) + 1}, column " in str(refused.value)
    assert REFUSED[text] in str(refused.value)


def test_a_cost_that_is_concave_is_refused(tmp_path: Path) -> None:
    head, rest = GAME.split('expression = """', 1)
    text = "-(x[i,1] - h[i])^2 + 0.1 * x[i,1] * cos(x[mod(i,N)+1,1])"
    game = tmp_path / "concave.toml"
    game.write_text(head + f'expression = "{text}"' + rest.split('"""', 1)[1], encoding="utf-8")
    with pytest.raises(GameError, match="concave in the player's own action"):
        build_fmu(game, tmp_path / "concave.fmu")


@pytest.fixture
def instance(fmu: Path, tmp_path: Path) -> Iterator[tuple[FMU2Slave, dict[str, int], Any]]:
    description = fmpy.read_model_description(str(fmu))
    fmpy.extract(str(fmu), unzipdir=tmp_path)
    slave = FMU2Slave(
        guid=description.guid,
        modelIdentifier="MixedOrderGame",
        unzipDirectory=str(tmp_path),
        instanceName="sellers",
    )
    slave.instantiate()
    slave.setupExperiment(startTime=0.0, tolerance=1e-8)
    slave.enterInitializationMode()
    yield slave, {each.name: each.valueReference for each in description.modelVariables}, description
    slave.freeInstance()


def test_derivatives_along_parameters_are_those_of_differences(
    instance: tuple[FMU2Slave, dict[str, int], Any],
) -> None:
    slave, references, description = instance
    unknowns = [each.variable.name for each in description.initialUnknowns]
    knowns = [
        "price",
        "h[2]",
        "slope",
        "x0[1,1]",
        "x0[3,1]",
        "v0[2,1]",
        "y0[2,3,1]",
        "dynamics_gain[3]",
        "time",
    ]
    declared = {
        each.variable.name: {known.name for known in each.dependencies}
        for each in description.initialUnknowns
    }
    for known in knowns:
        derivatives = np.array(
            slave.getDirectionalDerivative(
                [references[name] for name in unknowns], [references[known]], [1.0]
            )
        )
        for name, derivative in zip(unknowns, derivatives, strict=True):
            assert derivative == 0.0 or known in declared[name], (name, known)
        if known == "time":
            continue
        at, h = slave.getReal([references[known]])[0], 1e-5

        def values(number: float, known: str = known) -> np.ndarray:
            slave.setReal([references[known]], [number])
            return np.array(slave.getReal([references[name] for name in unknowns]))

        expected = (values(at + h) - values(at - h)) / (2.0 * h)
        values(at)
        assert np.abs(derivatives - expected).max() < 1e-6 * (1.0 + np.abs(expected).max()), known


def test_derivatives_along_states_are_those_of_differences(fmu: Path, tmp_path: Path) -> None:
    description = fmpy.read_model_description(str(fmu))
    fmpy.extract(str(fmu), unzipdir=tmp_path)
    model = FMU2Model(
        guid=description.guid,
        modelIdentifier="MixedOrderGame",
        unzipDirectory=str(tmp_path),
        instanceName="me",
    )
    model.instantiate()
    model.setupExperiment(startTime=0.0)
    model.enterInitializationMode()
    model.exitInitializationMode()
    model.enterContinuousTimeMode()
    rows = [each.variable.valueReference for each in description.derivatives]
    columns = [each.variable.derivative.valueReference for each in description.derivatives]
    declared = [{known.valueReference for known in each.dependencies} for each in description.derivatives]
    rng = np.random.default_rng(4)
    state = rng.uniform(-1.0, 2.0, len(rows))

    def rates(at: np.ndarray) -> np.ndarray:
        model.setContinuousStates((ctypes.c_double * len(at))(*at), len(at))
        return np.array(model.getReal(rows))

    for column, reference in enumerate(columns):
        rates(state)
        derivatives = np.array(model.getDirectionalDerivative(rows, [reference], [1.0]))
        step = np.zeros(len(state))
        step[column] = 1e-6
        expected = (rates(state + step) - rates(state - step)) / 2e-6
        assert np.abs(derivatives - expected).max() < 1e-5 * (1.0 + np.abs(expected).max())
        assert all(reference in declared[row] for row in np.flatnonzero(derivatives))
    model.freeInstance()


def test_saved_states_continue_bit_for_bit(instance: tuple[FMU2Slave, dict[str, int], Any]) -> None:
    slave, references, _ = instance
    slave.exitInitializationMode()
    wanted = [references[name] for name in ("x[1,1]", "x[3,1]", "v[2,1]", "u[2,1]", "nash_error", "cost[2]")]
    slave.doStep(0.0, 0.7)
    saved = slave.getFMUstate()
    content = slave.serializeFMUstate(saved)
    slave.setReal([references["price"]], [15.0])
    slave.doStep(0.7, 0.5)
    first = slave.getReal(wanted)
    slave.setFMUstate(slave.deSerializeFMUstate(content, saved))
    assert slave.getReal([references["price"]]) == [12.0]
    slave.setReal([references["price"]], [15.0])
    slave.doStep(0.7, 0.5)
    assert slave.getReal(wanted) == first


def test_the_archive_has_no_finding(fmu: Path) -> None:
    assert validate_fmu(str(fmu)) == []
