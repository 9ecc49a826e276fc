"""The linear loop from the FMU's variables against the paper's Kronecker expressions, and its rates."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mixed_order_game import GameError, read_model
from mixed_order_game.game.parameters import game_parameters
from mixed_order_game.theory import spectrum
from mixed_order_game.theory.game import read_game as read_game_file
from tests.conftest import COEFFICIENT_GAMES, GAMES, FmuOf
from tests.oracle import equilibrium, linear_loop
from tests.oracle.game import Game, read_game

NAMES = ["five_vehicles", *(path.stem for path in COEFFICIENT_GAMES)]
FIVE_VEHICLES = Path(__file__).resolve().parents[2] / "modelDescription/games/five_vehicles.toml"


def oracle_game(name: str) -> Game:
    return read_game(FIVE_VEHICLES if name == "five_vehicles" else GAMES / f"{name}.toml")


@pytest.mark.parametrize("name", NAMES)
def test_matches_the_oracle(name: str, fmu_of: FmuOf) -> None:
    game, other = game_parameters(read_model(fmu_of(name))), oracle_game(name)
    expected, _ = linear_loop.linear_loop(other, dimension=1)
    matrix = spectrum.linear_loop(game)
    np.testing.assert_allclose(matrix, expected, rtol=1e-14, atol=1e-12)
    assert spectrum.spectral_abscissa(matrix) == pytest.approx(linear_loop.spectral_abscissa(other))
    np.testing.assert_allclose(
        spectrum.nash_equilibrium(game), equilibrium.nash_equilibrium(other), atol=1e-12
    )
    m = equilibrium.strong_monotonicity_constant(other)
    assert spectrum.monotonicity_constant(game) == pytest.approx(m)
    N = other.players
    consensus = np.kron(linear_loop.laplacian(other.adjacency), np.eye(N)) + np.diag(other.adjacency.ravel())
    rate = other.k3 * np.linalg.eigvalsh(consensus).min()
    assert spectrum.consensus_rate(game) == pytest.approx(rate)
    np.testing.assert_allclose(game.dynamics_linear, other.dynamics_linear)
    np.testing.assert_allclose(game.dynamics_square, other.dynamics_square)
    np.testing.assert_allclose(game.y0, other.y0)


@pytest.mark.parametrize("seed", range(20))
def test_equilibria_of_random_costs_are_judged_as_by_the_oracle(seed: int) -> None:
    """Rows over ten decades, and one game in two with a cost that is concave in the own action."""
    random = np.random.default_rng(seed)
    other = oracle_game("interleaved_orders")
    N, D = other.players, other.dimension
    unit = 10.0 ** random.uniform(-5.0, 5.0, N)
    coupling = random.uniform(-0.3, 1.0, (N, N)) * (1.0 - np.eye(N))
    quadratic = random.uniform(0.1, 2.0, N) - coupling.sum(axis=1)
    if seed % 2:
        quadratic[seed % N] -= 2.5
    costs = {
        "cost_quadratic": quadratic * unit,
        "cost_linear": random.uniform(-1.0, 1.0, (N, D)) * unit[:, np.newaxis],
        "cost_coupling": coupling * unit[:, np.newaxis],
    }
    other = replace(other, **costs)
    game = replace(read_game_file(GAMES / "interleaved_orders.toml").parameters, **costs)
    if seed % 2:
        with pytest.raises(ArithmeticError, match=f"player {seed % N + 1} could lower"):
            equilibrium.nash_equilibrium(other)
        with pytest.raises(GameError, match=rf"player\[{seed % N + 1}\].cost is concave"):
            spectrum.nash_equilibrium(game)
        return
    x_star = equilibrium.nash_equilibrium(other)
    np.testing.assert_allclose(spectrum.nash_equilibrium(game), x_star, rtol=1e-9, atol=1e-9)


def test_no_unique_equilibrium_is_refused() -> None:
    game = read_game_file(GAMES / "interleaved_orders.toml").parameters
    flat = replace(game, cost_quadratic=np.zeros(game.players), cost_coupling=np.zeros((game.players,) * 2))
    with pytest.raises(GameError, match="no unique Nash equilibrium"):
        spectrum.nash_equilibrium(flat)


def test_prediction_matches_the_oracle(fmu_of: FmuOf) -> None:
    other = oracle_game("interleaved_orders")
    times, deviation = spectrum.predicted_deviation(
        game_parameters(read_model(fmu_of("interleaved_orders"))), 4.0, 100
    )
    size = other.players * other.dimension
    x = linear_loop.exact_solution(other, times)[:, :size].reshape(-1, other.players, other.dimension)
    np.testing.assert_allclose(deviation, x - equilibrium.nash_equilibrium(other), atol=1e-10)


def test_changed_parameters_change_the_loop(fmu: Path) -> None:
    model = read_model(fmu)
    loose = game_parameters(model, {"k1": 5.0, "k3": 5.0, "k4": 5.0})
    assert spectrum.spectral_abscissa(spectrum.linear_loop(game_parameters(model))) < 0.0
    assert spectrum.spectral_abscissa(spectrum.linear_loop(loose)) > 0.0
    assert game_parameters(model, {"a[1,2]": 0.5}).adjacency[1, 0] == 0.5


def test_decay_rate_of_an_exponential() -> None:
    times = np.linspace(1.0, 3.0, 50)
    assert spectrum.decay_rate(times, 7.0 * np.exp(-2.5 * times)) == pytest.approx(2.5)
