"""Constants of the analysis against brute force on the oracle's equations and Kronecker products."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from mixed_order_game.errors import GameError
from mixed_order_game.game.parts import toml_of_game
from mixed_order_game.theory.constants import (
    LoopConstants,
    dynamics_bound,
    dynamics_constants,
    loop_constants,
)
from mixed_order_game.theory.game import AnalysedGame, read_game, without_square
from mixed_order_game.theory.graph import consensus_blocks, is_connected
from mixed_order_game.theory.lyapunov import identity_right_side, scaled_identity
from tests.conftest import COEFFICIENT_GAMES, GAMES, FmuOf
from tests.oracle import equilibrium, linear_loop
from tests.oracle import game as oracle
from tests.oracle import paper_equations as paper

FIVE_VEHICLES = Path(__file__).resolve().parents[2] / "modelDescription/games/five_vehicles.toml"
PATHS = [FIVE_VEHICLES, *COEFFICIENT_GAMES]

FloatArray = NDArray[np.float64]


@pytest.fixture(params=PATHS, ids=lambda path: path.stem)
def path(request: pytest.FixtureRequest) -> Path:
    return Path(request.param)


@pytest.fixture
def game(path: Path) -> AnalysedGame:
    return read_game(path)


@pytest.fixture
def constants(game: AnalysedGame) -> LoopConstants:
    return loop_constants(game.parameters)


def kronecker(adjacency: FloatArray) -> FloatArray:
    """L (x) I + A_0, (N^2, N^2)."""
    laplacian = linear_loop.laplacian(adjacency)
    return np.asarray(np.kron(laplacian, np.eye(len(adjacency))) + np.diag(adjacency.ravel()))


def gradient_rows(other: oracle.Game) -> FloatArray:
    """B (N D, N^2 D): the Jacobian of [grad_i f_i(y_i)]_i by complex step."""
    N, D = other.players, other.dimension
    columns = []
    for column in range(N * N * D):
        y = np.zeros(N * N * D, dtype=complex)
        y[column] = 1e-30j
        gradient = paper.gradient_at_estimates(
            y.reshape(N, N, D), other.cost_quadratic, other.cost_linear, other.cost_coupling
        )
        columns.append(gradient.imag.ravel() / 1e-30)
    return np.array(columns).T


def test_reader_matches_the_oracle(path: Path, game: AnalysedGame) -> None:
    other, p = oracle.read_game(path), game.parameters
    arrays = ["order", "x0", "v0", "z0", "y0", "adjacency", "cost_quadratic", "cost_linear", "cost_coupling"]
    arrays += ["dynamics_linear", "dynamics_square"]
    for name in (*arrays, "k1", "k2", "k3", "k4", "delta", "epsilon", "W_max"):
        np.testing.assert_array_equal(getattr(p, name), getattr(other, name))
    np.testing.assert_array_equal(game.centers, other.centers)
    assert (game.beta, game.width, game.title) == (other.beta, other.width, other.title)
    bound = np.abs(other.disturbance_bias) + np.abs(other.disturbance_amplitude)
    np.testing.assert_array_equal(p.disturbance_bound, bound)


@pytest.mark.parametrize("name", ["five_vehicles", "interleaved_orders", "vector_centers"])
def test_reader_of_fmus_matches_that_of_files(name: str, fmu_of: FmuOf) -> None:
    path = FIVE_VEHICLES if name == "five_vehicles" else GAMES / f"{name}.toml"
    of_file, of_fmu = read_game(path), read_game(fmu_of(name), {"k3": 77.0, "beta": 3.0})
    assert of_fmu.parameters.k3 == 77.0
    assert of_fmu.beta == 3.0
    np.testing.assert_array_equal(of_fmu.centers, of_file.centers)
    np.testing.assert_array_equal(of_fmu.parameters.x0, of_file.parameters.x0)
    np.testing.assert_array_equal(of_fmu.parameters.dynamics_linear, of_file.parameters.dynamics_linear)


def test_written_game_reads_back(game: AnalysedGame, tmp_path: Path) -> None:
    copy = tmp_path / "copy.toml"
    copy.write_text(toml_of_game(game.tables), encoding="utf-8")
    assert read_game(copy).tables == game.tables
    copy.write_text(toml_of_game(without_square(game.tables)), encoding="utf-8")
    linear = read_game(copy)
    assert not linear.parameters.dynamics_square.any()
    np.testing.assert_array_equal(linear.parameters.dynamics_linear, game.parameters.dynamics_linear)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("k1 = 10.0", ""),
        ("[1, 2], [2, 3]", "[1, 9], [2, 3]"),
        ("x0 = [-5.0, 8.0]", "x0 = [-5.0, 8.0, 1.0]"),
        ("dimension = 2", "dimension = ["),
    ],
)
def test_bad_games_are_refused(old: str, new: str, tmp_path: Path) -> None:
    text = FIVE_VEHICLES.read_text(encoding="utf-8")
    assert old in text
    bad = tmp_path / "bad.toml"
    bad.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(GameError, match=r"bad\.toml"):
        read_game(bad)
    with pytest.raises(GameError, match="expected an FMU"):
        read_game(tmp_path / "bad.txt")


def test_monotonicity_and_lipschitz_constants(path: Path, constants: LoopConstants) -> None:
    other = oracle.read_game(path)
    N, D = other.players, other.dimension
    assert constants.monotonicity == pytest.approx(equilibrium.strong_monotonicity_constant(other))
    jacobian = equilibrium.pseudo_gradient_jacobian(other, np.zeros((N, D))).reshape(N, D, N * D)
    norms = [np.linalg.norm(jacobian[i], 2) for i in range(N)]
    np.testing.assert_allclose(constants.lipschitz, norms)
    assert constants.pseudo_gradient_norm == pytest.approx(np.linalg.norm(jacobian.reshape(N * D, -1), 2))
    assert constants.pseudo_gradient_norm <= np.sqrt(N) * constants.largest_lipschitz * (1 + 1e-12)


def test_consensus_eigenvalues_are_those_of_the_kronecker_matrix(constants: LoopConstants) -> None:
    A = constants.parameters.adjacency
    expected = np.linalg.eigvalsh(kronecker(A))
    np.testing.assert_allclose(np.sort(constants.eigenvalues.ravel()), expected, atol=1e-12)
    assert constants.slowest_consensus > 0.0
    assert is_connected(A)


def test_disconnected_graph_has_a_zero_eigenvalue() -> None:
    adjacency = np.zeros((4, 4))
    adjacency[0, 1] = adjacency[1, 0] = adjacency[2, 3] = adjacency[3, 2] = 1.0
    assert not is_connected(adjacency)
    assert np.linalg.eigvalsh(consensus_blocks(adjacency)).min() == pytest.approx(0.0, abs=1e-14)


def test_norms_of_the_estimates(path: Path, constants: LoopConstants) -> None:
    """b, ||B_s M||, max y'E B y and ||2 p E h - B'|| with all D coordinates, against dense matrices."""
    other = oracle.read_game(path)
    N, D = other.players, other.dimension
    B = gradient_rows(other)
    M = np.kron(kronecker(other.adjacency), np.eye(D))
    E = np.kron(np.ones((N, 1)), np.eye(N * D))
    second = np.repeat(~other.first_order, D)
    if second.any():
        H_1 = B[second]
        assert constants.hessian_norm == pytest.approx(np.linalg.norm(H_1, 2))
        assert constants.paper_b == pytest.approx(np.linalg.norm(H_1, 2) * np.linalg.norm(M, 2))
        assert constants.exact_b == pytest.approx(np.linalg.norm(H_1 @ M, 2))
        assert constants.exact_b <= constants.paper_b * (1 + 1e-12)
    assert constants.largest_lipschitz == pytest.approx(np.linalg.norm(B, 2))
    EB = E @ B
    assert constants.estimate_pull == pytest.approx(np.linalg.eigvalsh(0.5 * (EB + EB.T))[-1])
    assert constants.estimate_pull <= np.sqrt(N) * constants.largest_lipschitz * (1 + 1e-12)
    for p in (0.003, 0.1, 2.0):
        dense = np.linalg.norm(2.0 * p * EB @ E - B.T, 2)
        assert constants.estimate_coupling(p) == pytest.approx(dense)
        assert dense <= constants.largest_lipschitz * (1.0 + 2.0 * p * N) * (1 + 1e-12)


def test_scaled_identity_is_the_best_pair(constants: LoopConstants) -> None:
    """No random P has a larger lambda_min(Q) / ||P||; the solution for Q = I ties and P = p I attains."""
    M = kronecker(constants.parameters.adjacency)
    if len(M) > 70:
        pytest.skip("the dense check is for small games")
    pair = scaled_identity(constants.slowest_consensus, 0.3)
    best = pair.smallest_Q / pair.largest_P
    assert best == pytest.approx(2.0 * np.linalg.eigvalsh(M)[0])
    random = np.random.default_rng(5)
    for _ in range(20):
        R = random.standard_normal(M.shape)
        P = R @ R.T + random.uniform(0.0, 30.0) * np.eye(len(M))
        assert np.linalg.eigvalsh(P @ M + M @ P)[0] <= best * np.linalg.norm(P, 2) * (1 + 1e-12)
    blocks, other = identity_right_side(constants.parameters.adjacency)
    for P, block in zip(blocks, consensus_blocks(constants.parameters.adjacency), strict=True):
        np.testing.assert_allclose(P @ block + block @ P, np.eye(len(P)), atol=1e-12)
    assert other.smallest_Q / other.largest_P == pytest.approx(best)
    assert other.smallest_P / other.largest_P <= 1.0


def test_dynamics_constants_bound_every_difference(path: Path, game: AnalysedGame) -> None:
    """g_i(x) - g_i(y_i) over random points of the balls, and its parts, never exceed their bounds."""
    other, p = oracle.read_game(path), game.parameters
    N, D = other.players, other.dimension
    x_star = equilibrium.nash_equilibrium(other)
    first = other.first_order
    r_x, r_y = 3.0, 5.0
    c = dynamics_constants(p, r_x, r_y)
    bound = dynamics_bound(p, r_y)
    random = np.random.default_rng(11)

    def g(x: FloatArray) -> FloatArray:
        return np.asarray(
            paper.unknown_dynamics(x, other.dynamics_linear, other.dynamics_square, other.dynamics_gain)
        )

    def point(radius: float) -> FloatArray:
        direction = random.standard_normal((N, D))
        return np.asarray(x_star + radius * random.uniform() ** 0.2 * direction / np.linalg.norm(direction))

    for _ in range(300):
        x, y = point(r_x), point(r_y)
        assert np.all(np.abs(g(y)) <= bound * (1 + 1e-12))
        norms = np.linalg.norm(g(x) - g(y), axis=1)
        assert np.all(norms <= c.lipschitz * np.linalg.norm(x - y) * (1 + 1e-12))
        xbar = x.copy()
        xbar[first] = point(r_x)[first]
        if np.linalg.norm(xbar - x_star) > r_x:
            continue
        tracking = float(np.linalg.norm(x - xbar))
        assert np.linalg.norm((g(x) - g(xbar))[first]) <= c.first_tracking * tracking * (1 + 1e-12) + 1e-12
        assert np.linalg.norm((g(x) - g(xbar))[~first]) <= c.second_tracking * tracking * (1 + 1e-12) + 1e-12
        estimates = np.array([point(r_y) for _ in range(N)])
        differences = np.array([g(xbar)[i] - g(estimates[i])[i] for i in range(N)])
        size = np.linalg.norm(estimates - xbar)
        assert np.linalg.norm(differences[first]) <= c.first_estimates * size * (1 + 1e-12)
        assert np.linalg.norm(differences[~first]) <= c.second_estimates * size * (1 + 1e-12)


def test_a_square_has_no_global_lipschitz_constant() -> None:
    eta = dynamics_constants(read_game(FIVE_VEHICLES).parameters).lipschitz
    np.testing.assert_array_equal(eta, [1.0, np.inf, 3.0, 4.0, 5.0])
