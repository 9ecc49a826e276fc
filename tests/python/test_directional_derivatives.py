"""fmi2GetDirectionalDerivative, called by fmpy, against complex-step derivatives of the oracle."""

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from numpy.typing import NDArray

from tests.conftest import COEFFICIENT_GAMES, GAMES, FmuOf
from tests.oracle import closed_loop
from tests.oracle import paper_equations as paper
from tests.oracle.equilibrium import nash_equilibrium
from tests.oracle.game import FloatArray, Game, read_game

NAMES = ["five_vehicles", *(path.stem for path in COEFFICIENT_GAMES)]
START = 0.3
STOPS = (0.31, 0.8)
TOLERANCE = 1e-9  # of an unknown's largest derivative, at least of 1
STEP = 1e-30

Numbers = NDArray[Any]
Values = dict[str, Any]
Derivatives = dict[str, dict[str, float]]  # by known, then by unknown


class Connected:
    """An instance of an FMU with its model description."""

    def __init__(self, slave: FMU2Slave, path: Path) -> None:
        self.slave = slave
        description = fmpy.read_model_description(str(path))
        self.references = {each.name: each.valueReference for each in description.modelVariables}
        self.real = {each.name for each in description.modelVariables if each.type == "Real"}
        self.causality = {each.name: each.causality for each in description.modelVariables}
        self.running = self._dependencies([*description.outputs, *description.derivatives])
        self.initial = self._dependencies(description.initialUnknowns)
        self.states = [each.variable.derivative.name for each in description.derivatives]
        assert description.coSimulation.providesDirectionalDerivative

    @staticmethod
    def _dependencies(unknowns: Sequence[Any]) -> dict[str, set[str]]:
        return {each.variable.name: {known.name for known in each.dependencies} for each in unknowns}

    def get(self, names: Sequence[str]) -> FloatArray:
        return np.array(self.slave.getReal([self.references[name] for name in names]))

    def derivatives(self, unknowns: Sequence[str], knowns: Sequence[str]) -> Derivatives:
        references = [self.references[name] for name in unknowns]
        return {
            known: dict(
                zip(
                    unknowns,
                    self.slave.getDirectionalDerivative(references, [self.references[known]], [1.0]),
                    strict=True,
                )
            )
            for known in knowns
        }


@contextmanager
def connected(path: Path, folder: Path) -> Iterator[Connected]:
    description = fmpy.read_model_description(str(path))
    fmpy.extract(str(path), unzipdir=folder)
    slave = FMU2Slave(
        guid=description.guid,
        modelIdentifier="MixedOrderGame",
        unzipDirectory=str(folder),
        instanceName="derivatives",
    )
    slave.instantiate()
    slave.setupExperiment(startTime=START)
    slave.enterInitializationMode()
    yield Connected(slave, path)
    slave.terminate()
    slave.freeInstance()


def oracle_game(name: str, fmu_of: FmuOf) -> tuple[Game, Path]:
    path = GAMES / f"{name}.toml"
    if not path.exists():
        path = GAMES.parents[2] / "modelDescription" / "games" / f"{name}.toml"
    return read_game(path), fmu_of(name)


def named(stem: str, values: Numbers) -> Values:
    return {
        f"{stem}[{','.join(str(k + 1) for k in index)}]": value for index, value in np.ndenumerate(values)
    }


def states(game: Game, state: Numbers, wrap: str = "{}") -> Values:
    """Of a state vector, or of its rate, by the FMU's names."""
    parts = closed_loop.unpack(game, state)
    all_of = {**named("x", parts.x), **named("y", parts.y), **named("W", parts.W)}
    for name, value in named("", parts.p).items():
        player = int(re.split(r"[\[,]", name)[1]) - 1
        all_of[("z" if game.first_order[player] else "v") + name] = value
    return {wrap.format(name): value for name, value in all_of.items()}


def equilibrium(game: Game) -> Numbers:
    """x* by one linear solve: P is affine in x."""
    zero = np.zeros_like(game.x0)

    def pseudo_gradient(x: Numbers) -> Numbers:
        return paper.pseudo_gradient(x, game.cost_quadratic, game.cost_linear, game.cost_coupling).ravel()

    offset = pseudo_gradient(zero)
    columns = [pseudo_gradient(unit.reshape(zero.shape)) - offset for unit in np.eye(zero.size)]
    return np.linalg.solve(np.stack(columns, axis=1), -offset).reshape(zero.shape)


def unknowns_of(
    game: Game, t: Any, state: Numbers, on_sphere: NDArray[np.bool_], d_ext: Numbers, x_star: Numbers
) -> Values:
    """States, their rates, outputs and x_star by the FMU's names."""
    x = closed_loop.unpack(game, state).x
    return {
        **states(game, state),
        **states(game, closed_loop.state_rate(game, t, state, on_sphere, d_ext), "der({})"),
        **named("u", closed_loop.signals(game, state).u),
        **named("x_star", x_star),
        "nash_error": np.sqrt(np.sum((x - x_star) ** 2)),
    }


def imaginary(values: Values) -> dict[str, float]:
    return {name: float(np.imag(value) / STEP) for name, value in values.items()}


def compare(actual: Derivatives, expected: Derivatives, declared: dict[str, set[str]]) -> None:
    unknowns = list(declared)
    computed = np.array([[column[name] for name in unknowns] for column in actual.values()])
    oracle = np.array([[expected[known][name] for name in unknowns] for known in actual])
    scale = 1.0 + np.max(np.abs(oracle), axis=0)
    worst = np.unravel_index(np.argmax(np.abs(computed - oracle) / scale), oracle.shape)
    assert np.all(np.abs(computed - oracle) <= TOLERANCE * scale), (
        list(actual)[int(worst[0])],
        unknowns[int(worst[1])],
        computed[worst],
        oracle[worst],
    )
    is_declared = np.array([[known in declared[name] for name in unknowns] for known in actual])
    assert not np.any(computed[~is_declared])
    assert not np.any(oracle[~is_declared])


@pytest.mark.parametrize("name", NAMES)
def test_in_a_run(name: str, fmu_of: FmuOf, tmp_path: Path) -> None:
    game, path = oracle_game(name, fmu_of)
    with connected(path, tmp_path) as instance:
        instance.slave.exitInitializationMode()
        knowns = [*instance.states, *named("d_ext", game.x0), "time"]
        time = START
        for stop in STOPS:
            instance.slave.doStep(time, stop - time)
            time = stop
            actual = instance.derivatives(list(instance.running), knowns)
            compare(actual, _expected_in_a_run(game, time, instance), instance.running)


def _expected_in_a_run(game: Game, t: float, instance: Connected) -> Derivatives:
    size = closed_loop.initial_state(game).size
    order = states(game, np.arange(size))  # positions in the oracle's state
    state = np.empty(size)
    state[list(order.values())] = instance.get(list(order))
    W = closed_loop.unpack(game, state).W
    now = closed_loop.signals(game, state)
    norm2 = np.sum(W * W, axis=1)
    on_sphere = game.robust & (np.abs(norm2 / game.W_max - 1.0) < 1e-9) & (now.e * now.nn >= 0.0)
    x_star = nash_equilibrium(game)
    d_ext = np.zeros_like(game.x0)
    expected: Derivatives = {}
    for name, position in order.items():
        moved = state.astype(np.complex128)
        moved[position] += 1j * STEP
        expected[name] = imaginary(unknowns_of(game, t, moved, on_sphere, d_ext, x_star))
    # on the sphere the FMU divides by W_max where the paper has w'w: equal there, but not in the derivative
    for player, entry in zip(*np.nonzero(on_sphere), strict=True):
        w = W[player, :, entry]
        push = 2.0 * game.beta * now.e[player, entry] * now.nn[player, entry]
        excess = push / norm2[player, entry] ** 2 * np.outer(w, w)
        for m, k in np.ndindex(excess.shape):
            known, unknown = (f"W[{player + 1},{neuron + 1},{entry + 1}]" for neuron in (k, m))
            expected[known][f"der({unknown})"] -= excess[m, k]
    complex_state = state.astype(np.complex128)
    for position, name in enumerate(named("d_ext", d_ext)):
        moved = np.zeros(d_ext.size, dtype=np.complex128)
        moved[position] = 1j * STEP
        expected[name] = imaginary(
            unknowns_of(game, t, complex_state, on_sphere, moved.reshape(d_ext.shape), x_star)
        )
    expected["time"] = imaginary(unknowns_of(game, t + 1j * STEP, complex_state, on_sphere, d_ext, x_star))
    return expected


@pytest.mark.parametrize("name", NAMES)
def test_in_initialization_mode(name: str, fmu_of: FmuOf, tmp_path: Path) -> None:
    game, path = oracle_game(name, fmu_of)
    with connected(path, tmp_path) as instance:
        knowns = [
            each
            for each in sorted(instance.real)
            if instance.causality[each] in ("parameter", "input", "independent")
        ]
        actual = instance.derivatives(list(instance.initial), knowns)
        expected = {known: _expected_initially(game, known) for known in knowns}
        compare(actual, expected, instance.initial)
        instance.slave.exitInitializationMode()


def _expected_initially(game: Game, known: str) -> dict[str, float]:
    stem, *rest = re.split(r"[\[\],]", known.removesuffix("]"))
    index = tuple(int(part) - 1 for part in rest)
    t = START + 1j * STEP if known == "time" else START + 0j
    d_ext = np.zeros(game.x0.shape, dtype=np.complex128)
    if stem == "d_ext":
        d_ext[index] = 1j * STEP
    moved = _moved(game, stem, index)
    p = np.where(moved.first_order[:, np.newaxis], moved.z0, moved.v0)
    W = np.zeros((game.players, game.neurons, game.dimension), dtype=np.complex128)
    state = closed_loop.pack(moved.x0, p, moved.y0, W)
    inside = np.zeros(game.x0.shape, dtype=np.bool_)
    return imaginary(unknowns_of(moved, t, state, inside, d_ext, equilibrium(moved)))


def _moved(game: Game, stem: str, index: tuple[int, ...]) -> Game:
    """The game with one parameter moved along the imaginary axis."""
    field = {"rho": "width", "center": "centers", "a": "adjacency"}.get(stem, stem)
    if not hasattr(game, field):
        return game
    if not index:
        return replace(game, **{field: getattr(game, field) + 1j * STEP})
    array = getattr(game, field).astype(np.complex128)
    array[index] += 1j * STEP
    if stem == "a":
        array[index[::-1]] += 1j * STEP
    return replace(game, **{field: array})


def test_fmpy_accepts_the_dependencies(fmu: Path) -> None:
    description = fmpy.read_model_description(str(fmu), validate=True)
    kinds = {kind for each in description.derivatives for kind in each.dependenciesKind or ["(none)"]}
    assert kinds == {"constant", "tunable", "dependent"}
