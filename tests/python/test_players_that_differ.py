"""Players that differ, against the oracle: own gains and networks, initial weights, directed graphs."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

import mixed_order_game as mog
from mixed_order_game.game.parameters import game_parameters, parameters_of
from mixed_order_game.studies.claims.verdict import Verdict
from mixed_order_game.studies.tune import TuneError, tune
from mixed_order_game.studies.validate import validate
from mixed_order_game.theory import spectrum
from mixed_order_game.theory.analysis import analyse
from mixed_order_game.theory.constants import loop_constants
from mixed_order_game.theory.findings import Analysis
from mixed_order_game.theory.lyapunov import identity_right_side
from tests.oracle import linear_loop
from tests.oracle.game import Game, game_from_table
from tests.oracle.simulate import simulate

GAME = """
title = "Four players in the plane, three neurons"
dimension = 2
[gains]
k1 = 8.0
k2 = 0.9
k3 = 30.0
k4 = 25.0
beta = 20.0
delta = 3.0
epsilon = 0.1
[rbf]
centers = [-1.0, 0.2, 1.3]
width = 3.0
W_max = 2.0
[graph]
edges = [[1, 2], [2, 3, 0.7], [3, 4, 1.4], [4, 1]]
[[player]]
name = "first"
order = 1
x0 = [0.8, -1.1]
z0 = [0.3, 0.2]
cost = { quadratic = 1.2, linear = [0.4, -0.7], coupling = [[2, 0.5]] }
dynamics = { linear = [[1, [0.5, -0.4]], [3, [0.2, 0.3]]], square = [[2, [0.05, 0.04]]] }
disturbance = { amplitude = [0.9, 1.1], frequency = [2.0, 3.0], phase = [0.1, -0.4], bias = [0.2, -0.3] }
[[player]]
name = "second"
order = 2
x0 = [-0.6, 1.4]
v0 = [0.25, -0.35]
cost = { quadratic = 1.7, linear = [-0.6, 0.9], coupling = [[1, 0.3], [3, 0.6]] }
dynamics = { linear = [[2, [0.6, 0.7]]] }
disturbance = { amplitude = [1.4, 0.8], frequency = [1.5, 2.5], bias = [-0.1, 0.15] }
[[player]]
name = "third"
order = 1
x0 = [1.5, 0.45]
z0 = [-0.2, 0.55]
cost = { quadratic = 2.1, linear = [0.8, 0.35], coupling = [[4, 0.2]] }
dynamics = { linear = [[3, [-0.3, 0.8]]] }
disturbance = { amplitude = [1.2, 0.7], frequency = [2.2, 1.8] }
[[player]]
name = "fourth"
order = 2
x0 = [0.1, -0.5]
cost = { quadratic = 1.1, linear = [0.1, -0.2], coupling = [[1, 0.4]] }
disturbance = { amplitude = 1.0, frequency = 1.2, phase = 0.5 }
"""

OWN_GAINS = {
    "z0 = [0.3, 0.2]\n": "gains = { k1 = 12.0, k3 = 45.0, epsilon = 0.05 }\n",
    "v0 = [0.25, -0.35]\n": "gains = { k4 = 18.0, k2 = 1.3, beta = 35.0 }\n",
    "z0 = [-0.2, 0.55]\n": "gains = { k3 = 21.0, delta = 4.5 }\n",
}
OWN_NETWORKS = {
    "z0 = [0.3, 0.2]\n": "rbf = { W_max = 0.6 }\n",
    "v0 = [0.25, -0.35]\n": "rbf = { centers = [-0.5, 0.4, 0.9], width = 2.2 }\n",
}
INITIAL_WEIGHTS = {
    "z0 = [0.3, 0.2]\n": "W0 = [0.3, [0.1, -0.6], -0.2]\n",
    "v0 = [0.25, -0.35]\n": "W0 = [[0.0, 0.9], [-0.4, 0.2], [0.5, 0.1]]\n",
}
DIRECTED = {"edges = [[1, 2], [2, 3, 0.7], [3, 4, 1.4], [4, 1]]": (
    "directed = true\nedges = [[1, 2], [2, 3, 0.7], [3, 4, 1.4], [4, 1], [1, 3, 0.5]]"
)}  # fmt: skip
GAMES = {
    "own gains": (OWN_GAINS,),
    "own networks": (OWN_NETWORKS,),
    "initial weights": (INITIAL_WEIGHTS,),
    "directed": (DIRECTED,),
    "all": (OWN_GAINS, OWN_NETWORKS, INITIAL_WEIGHTS, DIRECTED),
}


def text_of(*changes: dict[str, str]) -> str:
    text = GAME
    for change in changes:
        for line, added in change.items():
            assert text.count(line) == 1
            text = text.replace(line, added if line.startswith("edges") else line + added)
    return text


def oracle_of(text: str) -> Game:
    return game_from_table(tomllib.loads(text))


@pytest.fixture(scope="module", params=list(GAMES))
def case(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Game, Path]:
    text = text_of(*GAMES[request.param])
    path = tmp_path_factory.mktemp("differing") / "game.toml"
    path.write_text(text, encoding="utf-8")
    return oracle_of(text), mog.build_fmu(path, path.with_suffix(".fmu"))


def test_runs_are_those_of_the_oracle(case: tuple[Game, Path]) -> None:
    game, fmu = case
    times = np.linspace(0.0, 3.0, 31)
    expected = simulate(game, times, rtol=1e-10, atol=1e-11)
    outputs = ["x", "v", "z", "u", "y", "W", "W_norm2", "solver_events"]
    result = mog.run(fmu, stop_time=3.0, step=0.1, tolerance=1e-8, outputs=outputs)
    for signal in ("x", "u", "y", "W", "W_norm2"):
        wanted = getattr(expected, signal)
        largest = max(1.0, float(np.abs(wanted).max()))
        np.testing.assert_allclose(getattr(result, signal), wanted, rtol=0.0, atol=2e-5 * largest)
        np.testing.assert_allclose(getattr(result, signal)[-1], wanted[-1], rtol=0.0, atol=2e-6 * largest)
    np.testing.assert_allclose(np.nan_to_num(result.v), expected.v, rtol=0.0, atol=2e-5)
    assert result["solver_events"][-1] == expected.switch_count


def test_the_linear_loop_is_that_of_the_papers_expressions(case: tuple[Game, Path]) -> None:
    other, fmu = case
    game = game_parameters(mog.read_model(fmu))
    expected, _ = linear_loop.linear_loop(other, dimension=1)
    matrix = spectrum.linear_loop(game)
    np.testing.assert_allclose(matrix, expected, rtol=1e-14, atol=1e-12)
    N = other.players
    consensus = np.kron(linear_loop.laplacian(other.adjacency), np.eye(N)) + np.diag(other.adjacency.ravel())
    k3 = np.repeat(np.broadcast_to(other.k3, (N, 1)), N, axis=0)
    assert spectrum.consensus_rate(game) == pytest.approx(np.linalg.eigvals(k3 * consensus).real.min())


def test_constants_of_a_directed_graph_are_those_of_its_matrices() -> None:
    c = loop_constants(parameters_of(tomllib.loads(text_of(DIRECTED))))
    other = oracle_of(text_of(DIRECTED))
    N = other.players
    M = np.kron(linear_loop.laplacian(other.adjacency), np.eye(N)) + np.diag(other.adjacency.ravel())
    assert not np.allclose(M, M.T)
    assert c.slowest_consensus == pytest.approx(np.linalg.eigvalsh(0.5 * (M + M.T)).min())
    assert c.fastest_consensus == pytest.approx(np.linalg.norm(M, 2))
    h = linear_loop.gradient_coefficients(other)
    B_s = np.vstack([np.kron(np.eye(N)[i], h[i]) for i in np.flatnonzero(~other.first_order)])
    assert c.exact_b == pytest.approx(np.linalg.norm(B_s @ M, 2))
    blocks, pair = identity_right_side(other.adjacency)
    P = np.zeros((N * N, N * N))
    for j, block in enumerate(blocks):  # of the estimates y_1j, y_2j, ...
        P[j::N, j::N] = block
    np.testing.assert_allclose(M.T @ P + P @ M, np.eye(N * N), atol=1e-12)
    assert pair.largest_P == pytest.approx(np.linalg.eigvalsh(P).max())


def test_what_the_theorems_do_not_cover_is_refused(tmp_path: Path) -> None:
    def refused(text: str) -> str:
        with pytest.raises(mog.GameError) as error:
            analyse_text(text, tmp_path)
        return str(error.value)

    told = "the analysis takes the same gains for all players; player 1 has gains of its own"
    assert refused(text_of(OWN_GAINS)) == told
    told = "the analysis takes the same network for all players; player 1 has a network of its own"
    assert refused(text_of(OWN_NETWORKS)) == told
    assert refused(text_of(INITIAL_WEIGHTS)) == "the analysis takes initial weights of 0; player 1 has others"
    one_way = {"edges = [[1, 2], [2, 3, 0.7], [3, 4, 1.4], [4, 1]]": (
        "directed = true\nedges = [[1, 2, 20], [1, 3, 20], [1, 4, 20], [4, 1, 0.1], [2, 1, 0.1], [3, 1, 0.1]]"
    )}  # fmt: skip
    assert "for which M + M' is positive definite" in refused(text_of(one_way))
    found = analyse_text(text_of(DIRECTED), tmp_path)
    assert found.exact is not None
    assert found.exact.stable
    assert any("undirected" in each.name and not each.holds for each in found.hypotheses)


def analyse_text(text: str, folder: Path) -> Analysis:
    path = folder / "game.toml"
    path.write_text(text, encoding="utf-8")
    return analyse(path, simulation=False)


def test_claims_are_judged_player_by_player(tmp_path: Path) -> None:
    path = tmp_path / "game.toml"
    path.write_text(text_of(OWN_GAINS, OWN_NETWORKS), encoding="utf-8")
    fmu = mog.build_fmu(path, path.with_suffix(".fmu"))
    verdicts = {claim.name: claim for claim in validate(fmu, limit=20.0).claims}
    assert verdicts["lemma_3_weights"].verdict is Verdict.HOLDS
    assert verdicts["lemma_3_weights"].reason.startswith("Nearest to its bound, w'w of player")
    with pytest.raises(TuneError, match="one gain of each kind for all players"):
        tune(fmu, 2.0)
