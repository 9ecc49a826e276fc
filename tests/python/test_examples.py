"""The example games have the equilibria of the costs in their sources, and reach them through the FMU."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import root

from mixed_order_game import Simulator, build_fmu, read_model
from mixed_order_game.game.check import check_game
from mixed_order_game.game.new import Recipe, new_game
from mixed_order_game.game.parameters import game_parameters
from mixed_order_game.theory.spectrum import linear_loop, monotonicity_constant, spectral_abscissa
from tests.games_by_hand import BY_HAND
from tests.oracle.equilibrium import nash_equilibrium, strong_monotonicity_constant
from tests.oracle.game import read_game

FloatArray = NDArray[np.float64]
GAMES = Path(__file__).resolve().parents[2] / "modelDescription" / "games"


def five_vehicles(x: FloatArray, i: int) -> FloatArray:
    others = {1: [2], 2: [3], 3: [2], 4: [2, 5], 5: [1]}[i + 1]
    near = sum(np.sum((x[i] - x[j - 1]) ** 2, axis=-1) for j in others)
    return (i + 1) * (np.sum(x[i] ** 2, axis=-1) + np.sum(x[i], axis=-1) + 1.0) + near


def energy_consumption(x: FloatArray, i: int) -> FloatArray:
    wished = (50.0, 55.0, 60.0, 65.0, 70.0)[i]
    price = 0.04 * x.sum(axis=0) + 5.0
    return np.sum((x[i] - wished) ** 2 + price * x[i], axis=-1)


def cournot_two_markets(x: FloatArray, i: int) -> FloatArray:
    k, m = (0.5, 0.6, 0.7, 0.8, 0.9, 1.0)[i], (2.0, 3.0, 2.5, 4.0, 3.5, 5.0)[i]
    price = np.array([30.0, 24.0]) - 0.5 * x.sum(axis=0)
    return k * np.sum(x[i] ** 2, axis=-1) + m * np.sum(x[i], axis=-1) - np.sum(price * x[i], axis=-1)


def mobile_sensors(x: FloatArray, i: int) -> FloatArray:
    watched = np.array([(-6, 5), (1, 7), (7, 3), (5, -5), (-1, -6), (-7, -2)])
    place = np.array([(-3, 2), (0, 4), (3, 2), (3, -2), (0, -4), (-3, -2)])
    neighbours = ((i - 1) % 6, (i + 1) % 6)
    kept = sum(np.sum((x[i] - x[j] - (place[i] - place[j])) ** 2, axis=-1) for j in neighbours)
    return np.sum((x[i] - watched[i]) ** 2, axis=-1) + 0.5 * kept


LITERATURE: dict[str, tuple[int, int, Callable[[FloatArray, int], FloatArray]]] = {
    "five_vehicles": (5, 2, five_vehicles),
    "energy_consumption": (5, 1, energy_consumption),
    "cournot_two_markets": (6, 2, cournot_two_markets),
    "mobile_sensors": (6, 2, mobile_sensors),
}
COEFFICIENTS = [*LITERATURE, "opinion_formation"]
NAMES = [*COEFFICIENTS, *BY_HAND]


def own_gradients(cost: Callable[[FloatArray, int], FloatArray], x: FloatArray) -> FloatArray:
    """df_i/dx_i by complex step: exact to rounding, and shares nothing with the game files."""
    gradient = np.empty_like(x)
    for i, k in np.ndindex(*x.shape):
        shifted = x.astype(np.complex128)
        shifted[i, k] += 1e-30j
        gradient[i, k] = np.imag(cost(shifted, i)) / 1e-30  # type: ignore[arg-type]
    return gradient


@pytest.fixture(scope="module")
def fmu_of_example(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    folder, built = tmp_path_factory.mktemp("examples"), dict[str, Path]()

    def build(name: str) -> Path:
        if name not in built:
            built[name] = build_fmu(GAMES / f"{name}.toml", folder / f"{name}.fmu")
        return built[name]

    return build


def test_every_example_is_tested() -> None:
    assert {path.stem for path in GAMES.glob("*.toml")} == {*NAMES}


@pytest.mark.parametrize("name", NAMES)
def test_begins_with_its_source_and_mapping(name: str) -> None:
    text = (GAMES / f"{name}.toml").read_text(encoding="utf-8")
    head = text.split("title =")[0]
    assert all(line.startswith("#") for line in head.splitlines())
    assert "Decided here" in head
    if name != "five_vehicles":
        assert "# Source: " in head
        assert "# Mapping: " in head


@pytest.mark.parametrize("name", list(LITERATURE))
def test_equilibrium_is_that_of_the_costs_in_the_literature(
    name: str, fmu_of_example: Callable[[str], Path]
) -> None:
    players, dimension, cost = LITERATURE[name]
    shape = (players, dimension)

    def gradients(x: FloatArray) -> FloatArray:
        return own_gradients(cost, x.reshape(shape)).ravel()

    found = root(gradients, np.zeros(players * dimension), tol=1e-12)
    assert np.abs(found.fun).max() < 1e-9
    expected = found.x.reshape(shape)
    np.testing.assert_allclose(nash_equilibrium(read_game(GAMES / f"{name}.toml")), expected, atol=1e-9)
    with Simulator(fmu_of_example(name)) as simulator:
        result = simulator.run(stop_time=0.02, outputs=["x", "cost"])
    np.testing.assert_allclose(result.x_star, expected, atol=1e-9)


@pytest.mark.parametrize("name", list(LITERATURE))
def test_gradients_are_those_of_the_costs_in_the_literature(name: str) -> None:
    """Not only at the equilibrium: terms of the other players are all that the mapping drops."""
    players, dimension, cost = LITERATURE[name]
    game = read_game(GAMES / f"{name}.toml")
    x = np.random.default_rng(5).uniform(-10.0, 10.0, (players, dimension))
    differences = x[:, np.newaxis] - x[np.newaxis]
    mapped = (
        2.0 * game.cost_quadratic[:, np.newaxis] * x
        + game.cost_linear
        + 2.0 * np.einsum("ij,ijl->il", game.cost_coupling, differences)
    )
    np.testing.assert_allclose(mapped, own_gradients(cost, x), rtol=1e-12, atol=1e-10)


def test_energy_consumption_has_the_equilibrium_that_its_file_tells() -> None:
    x = nash_equilibrium(read_game(GAMES / "energy_consumption.toml"))
    np.testing.assert_allclose(x.ravel(), [41.54, 46.44, 51.34, 56.24, 61.14], atol=0.005)
    assert strong_monotonicity_constant(read_game(GAMES / "energy_consumption.toml")) == pytest.approx(2.04)


def test_quantities_of_the_cournot_game_are_positive() -> None:
    assert nash_equilibrium(read_game(GAMES / "cournot_two_markets.toml")).min() > 0.0


def test_opinions_balance_between_conviction_and_neighbours() -> None:
    game = read_game(GAMES / "opinion_formation.toml")
    assert len(game.order) == 30
    assert (game.cost_coupling == game.cost_coupling.T).all()
    assert ((game.cost_coupling > 0.0) == (game.adjacency > 0.0)).all()
    inner = -0.5 * game.cost_linear[:, 0] / game.cost_quadratic
    laplacian = np.diag(game.cost_coupling.sum(axis=1)) - game.cost_coupling
    expected = np.linalg.solve(np.diag(game.cost_quadratic) + laplacian, game.cost_quadratic * inner)
    np.testing.assert_allclose(nash_equilibrium(game)[:, 0], expected, atol=1e-9)


def test_opinion_formation_is_the_game_that_its_file_says_it_is() -> None:
    """As far as the network goes: its random numbers are those of the recipe in the comments."""
    text = (GAMES / "opinion_formation.toml").read_text(encoding="utf-8")
    recipe = Recipe(30, 1, "mixed", "small-world:4:0.1", 6, "Opinion formation of thirty people")
    made = new_game(recipe)
    assert text[text.index("[[player]]") :] == made[made.index("[[player]]") :]


@pytest.mark.parametrize("name", COEFFICIENTS)
def test_is_valid_stable_and_converges_through_the_fmu(
    name: str, fmu_of_example: Callable[[str], Path]
) -> None:
    assert check_game(GAMES / f"{name}.toml") == ()
    fmu = fmu_of_example(name)
    model = read_model(fmu)
    game = game_parameters(model)
    assert monotonicity_constant(game) > 0.0
    if game.players < 10:  # large loops take long; the run below shows what their eigenvalues would
        assert spectral_abscissa(linear_loop(game)) < -0.5
    late_time = 0.8 * model.stop_time
    with Simulator(fmu) as simulator:
        robust = simulator.run(outputs=["x", "W_norm2", "nash_error"])
        plain = simulator.run(
            start_values={"robust": False, "perturbed": False}, outputs=["x"], tolerance=1e-10
        )
        bare = simulator.run(start_values={"robust": False}, outputs=["x"])
    expected = nash_equilibrium(read_game(GAMES / f"{name}.toml"))
    late = robust.window(late_time, np.inf)
    assert np.abs(robust.x[late] - expected).max() < 0.01
    assert np.abs(plain.x[-1] - expected).max() < 1e-6
    assert robust.W_norm2.max() <= game.W_max * (1.0 + 1e-9)
    assert bare.largest_error(late_time) > 20.0 * robust.largest_error(late_time)


def test_powers_solve_the_linear_system_of_the_source(fmu_of_example: Callable[[str], Path]) -> None:
    h, price, utility = (
        np.array(row) for row in ([1, 0.8, 0.6, 0.9], [1, 0.8, 0.6, 0.9], [2.5, 2, 1.6, 2.2])
    )
    received = np.linalg.solve(np.ones((4, 4)) + 7.0 * np.eye(4), 8.0 * utility * h / price - 0.5)
    result = Simulator(fmu_of_example("power_control")).run(stop_time=0.02)
    np.testing.assert_allclose(result.x_star.ravel(), received / h, atol=1e-12)


@pytest.mark.parametrize("name", BY_HAND)
def test_with_expressions_is_valid_and_converges_through_the_fmu(
    name: str, fmu_of_example: Callable[[str], Path]
) -> None:
    """To the point that the source's formulas have by hand, which test_general_games compares."""
    assert check_game(GAMES / f"{name}.toml") == ()
    with Simulator(fmu_of_example(name)) as simulator:
        robust = simulator.run(outputs=["x", "nash_error"])
        late_time = 0.8 * robust.time[-1]
        late = robust.window(late_time, np.inf)
        assert np.abs(robust.x[late] - robust.x_star).max() < 0.01
        if name == "two_hundred_households":  # which takes long
            return
        off = {"robust": False, "perturbed": False}
        plain = simulator.run(start_values=off, outputs=["x"], tolerance=1e-10)
        bare = simulator.run(start_values={"robust": False}, outputs=["x", "nash_error"])
    assert np.abs(plain.x[-1] - plain.x_star).max() < 1e-6
    assert bare.largest_error(late_time) > 10.0 * robust.largest_error(late_time)
