"""How many eigenvalues have positive real parts, against those of the loop assembled by hand."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from mixed_order_game import SimulationError
from mixed_order_game.files.reading import toml_of
from mixed_order_game.game.definition import with_defaults
from mixed_order_game.game.new import Recipe, new_game
from mixed_order_game.game.parameters import GameParameters, parameters_of
from mixed_order_game.theory import growing_modes
from tests.oracle.linear_loop import laplacian


def random_game(seed: int) -> GameParameters:
    """Gains of players' own from slow to fast, every other graph directed, coordinates that interact."""
    random = np.random.default_rng(seed)
    N, D = int(random.integers(3, 9)), int(random.integers(1, 3))
    game = parameters_of(with_defaults(toml_of(new_game(Recipe(N, D, graph="ring", seed=seed)))))
    scale = 10.0 ** random.uniform(-1.5, 1.5, 4)
    gains = [scale[k] * 10.0 ** random.uniform(-0.3, 0.3, N) for k in range(4)]
    return replace(
        game,
        k1=10.0 * gains[0],
        k2=gains[1],
        k3=30.0 * gains[2],
        k4=10.0 * gains[3],
        adjacency=game.adjacency * (random.uniform(0.2, 2.0, (N, N)) if seed % 2 else 1.0),
        jacobian=random.normal(size=(N * D, N * D)) + 2.0 * np.eye(N * D),
    )


def matrix_by_hand(game: GameParameters) -> NDArray[np.float64]:
    """M of (x | z or v | y) by Kronecker products."""
    N, D, h = game.players, game.dimension, game.jacobian
    assert h is not None
    a, k2, k3, k = (np.asarray(each) for each in (game.adjacency, game.k2, game.k3, game.regulation))
    first = np.diag(np.repeat(game.first_order.astype(float), D))
    second, zero = np.eye(N * D) - first, np.zeros((N * D, N * N * D))
    K = np.diag(np.repeat(k, D))
    own = np.vstack([np.kron(np.eye(N)[i], h[i * D : (i + 1) * D]) for i in range(N)])  # on y_i
    gain = np.diag(np.repeat(k2, D)) @ (first + K @ second)
    K3 = np.diag(np.repeat(k3, N * D))
    consensus = K3 @ np.kron(np.kron(laplacian(a), np.eye(N)) + np.diag(a.ravel()), np.eye(D))
    everyone = np.kron(np.ones((N, 1)), np.eye(N * D))
    pull = K3 @ np.kron(np.diag(a.ravel()), np.eye(D)) @ everyone
    return np.block(
        [
            [-K @ first, K @ first + second, zero],
            [np.zeros((N * D, N * D)), -K @ second, -gain @ own],
            [pull @ second, pull @ first, -consensus],
        ]
    )


def test_as_many_as_the_eigenvalues_of_the_loop_by_hand() -> None:
    counts = []
    for seed in range(9, 28):
        game = random_game(seed)
        eigenvalues = np.linalg.eigvals(matrix_by_hand(game))
        counts.append(int((eigenvalues.real > 0.0).sum()))
        assert growing_modes.growing_modes(game) == counts[-1], seed
        if not counts[-1]:
            found = growing_modes.stability(game)
            assert found.stable
            assert 1.0 <= -eigenvalues.real.max() / found.rate <= 1.02
    assert counts.count(0) >= 5
    assert max(counts) >= 10


def test_what_is_not_decided_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    game = random_game(0)
    assert game.jacobian is not None
    singular = replace(game, jacobian=np.ones_like(game.jacobian))
    with pytest.raises(SimulationError, match="an eigenvalue is 0 to rounding"):
        growing_modes.growing_modes(singular)
    apart = replace(game, adjacency=np.zeros_like(game.adjacency))
    told = growing_modes.stability(apart)
    assert told.stable is None
    assert "the graph is not connected: some estimates are corrected by nothing" in told.told
    with pytest.raises(SimulationError, match="the time for computing was over at"):
        growing_modes.growing_modes(game, time_limit=0.0)
    monkeypatch.setattr(growing_modes, "LARGEST", 2)
    with pytest.raises(SimulationError, match="players, more than 2"):
        growing_modes.growing_modes(game)
