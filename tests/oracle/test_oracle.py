"""Self-checks of the oracle: known results, closed forms, every equation against hand-computed numbers."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from . import linear_loop
from . import paper_equations as paper
from .closed_loop import initial_state, pack, signals, state_jacobian, state_rate, unpack
from .equilibrium import nash_equilibrium, strong_monotonicity_constant
from .game import FloatArray, Game, GameError, Table, game_from_table, read_game
from .make_reference import CASES, REFERENCE, ROOT
from .simulate import simulate

FIVE_VEHICLES = ROOT / "modelDescription" / "games" / "five_vehicles.toml"
GAMES = sorted({case.path for case in CASES.values()})


@pytest.fixture(scope="module")
def five() -> Game:
    return read_game(FIVE_VEHICLES)


def column(*values: float) -> FloatArray:
    """(N, 1): one coordinate per player."""
    return np.array(values)[:, np.newaxis]


# Equations against numbers worked out by hand


def test_rbf_activation() -> None:
    centers = np.array([[0.0, 0.0, 0.0, 0.0], [1.0, 2.0, 3.0, 4.0], [-1.0, 0.0, 0.0, 1.0]])
    y = np.array([[1.0, 2.0, 3.0, 4.0], [0.0, 0.0, 0.0, 1.0]])
    expected = np.exp(-np.array([[30.0, 0.0, 26.0], [1.0, 23.0, 1.0]]) / 4.0)
    np.testing.assert_allclose(paper.rbf_activation(y, centers, 2.0), expected, rtol=1e-15)


def test_network_output_is_the_transposed_product() -> None:
    W = np.array([[1.0, 2.0], [3.0, 4.0], [5.0, -6.0]])  # q = 3, D = 2
    np.testing.assert_allclose(paper.network_output(W, np.array([1.0, 10.0, 100.0])), [531.0, -558.0])


def test_plants() -> None:
    u, g, d, v = column(1.0), column(20.0), column(300.0), column(7.0)
    assert paper.first_order_plant(u, g, d)[0, 0] == 321.0
    x_rate, v_rate = paper.second_order_plant(v, u, g, d)
    assert x_rate[0, 0] == 7.0
    assert v_rate[0, 0] == 321.0


def test_cost() -> None:
    x = np.array([[1.0, 2.0], [4.0, -2.0]])
    coupling = np.array([[0.0, 0.5], [3.0, 0.0]])
    linear = np.array([[10.0, 1.0], [0.0, 2.0]])
    value = paper.cost(x, np.array([2.0, 1.0]), linear, np.array([7.0, -1.0]), coupling)
    np.testing.assert_allclose(value, [2 * 5 + 12 + 7 + 0.5 * 25, 20.0 - 4 - 1 + 3 * 25])


def test_gradient_reads_own_estimates() -> None:
    # y_11 = 1, y_12 = 3; y_21 = -2, y_22 = 5; q = (2, 1), l = (10, -1), c_12 = 0.5, c_21 = 4.
    y = np.array([[[1.0], [3.0]], [[-2.0], [5.0]]])
    coupling = np.array([[0.0, 0.5], [4.0, 0.0]])
    gradient = paper.gradient_at_estimates(y, np.array([2.0, 1.0]), column(10.0, -1.0), coupling)
    np.testing.assert_allclose(gradient[:, 0], [4 + 10 + 2 * 0.5 * (1 - 3), 10 - 1 + 2 * 4 * (5 + 2)])


def test_unknown_dynamics() -> None:
    linear, square = np.zeros((2, 2, 2)), np.zeros((2, 2, 2))
    linear[0, 1] = [1.0, 2.0]
    square[0, 1] = [0.5, -1.0]
    linear[1, 1] = [-3.0, 4.0]
    g = paper.unknown_dynamics(np.array([[9.0, 8.0], [2.0, 3.0]]), linear, square, np.array([10.0, 1.0]))
    np.testing.assert_allclose(g, [[40.0, -30.0], [-6.0, 12.0]])


def test_disturbance() -> None:
    d = paper.disturbance(2.0, column(5.0), column(3.0), column(0.25), column(math.pi / 2 - 0.5))
    np.testing.assert_allclose(d, [[8.0]], rtol=1e-15)
    d = paper.disturbance(2.0, column(5.0), column(3.0), column(0.25), column(-0.5))
    np.testing.assert_allclose(d, [[5.0]], rtol=1e-15)


def test_seeking_errors() -> None:
    assert paper.seeking_error_first_order(column(5.0), column(3.0))[0, 0] == 2.0
    assert paper.seeking_error_second_order(2.0, column(10.0), column(3.0))[0, 0] == 23.0


def test_robust_term() -> None:
    assert paper.ROBUST_CONSTANT == pytest.approx(0.2784645427610738, rel=1e-15)
    half = math.atanh(0.5) * 0.1 / (paper.ROBUST_CONSTANT * 4.0)
    np.testing.assert_allclose(
        paper.robust_term(4.0, 0.1, column(half, -half)), column(2.0, -2.0), rtol=1e-14
    )


def test_controls() -> None:
    x, z, nn, phi, gradient, v = (column(value) for value in (5.0, 3.0, 100.0, 1000.0, 7.0, 0.5))
    assert paper.control_first_order(10.0, x, z, nn, phi)[0, 0] == -20.0 - 100.0 - 1000.0
    assert paper.control_second_order(2.0, 4.0, gradient, v, nn, phi)[0, 0] == -56.0 - 2.0 - 1100.0
    assert paper.plain_control_first_order(10.0, x, z)[0, 0] == -20.0
    assert paper.plain_control_second_order(2.0, 4.0, gradient, v)[0, 0] == -58.0
    assert paper.reference_rate(2.0, gradient)[0, 0] == -14.0


def test_adaptation() -> None:
    S, w = np.array([[1.0, 2.0]]), np.array([[3.0, 4.0]])
    e = np.array([0.5])
    np.testing.assert_allclose(paper.adaptation_inside(10.0, S, e), [[5.0, 10.0]])
    # e w'S / w'w = 0.5 * 11 / 25 = 0.22
    on_sphere = paper.adaptation_on_sphere(10.0, S, e, w)
    np.testing.assert_allclose(on_sphere, [[5.0 - 6.6, 10.0 - 8.8]])
    assert np.sum(on_sphere * w) == pytest.approx(0.0, abs=1e-13)


def test_shared_signal() -> None:
    xbar = paper.shared_signal(np.array([False, True]), column(1.0, 2.0), column(10.0, 20.0))
    np.testing.assert_array_equal(xbar, column(1.0, 20.0))


def test_estimate_rate_is_the_sum_over_neighbours() -> None:
    random = np.random.default_rng(3)
    N, D, k3 = 4, 3, 2.5
    adjacency = np.triu(random.uniform(0.5, 2.0, (N, N)), 1)
    adjacency[0, 3] = 0.0
    adjacency += adjacency.T
    y, xbar = random.normal(size=(N, N, D)), random.normal(size=(N, D))
    expected = np.zeros_like(y)
    for i in range(N):
        for j in range(N):
            for k in range(N):
                expected[i, j] -= k3 * adjacency[i, k] * (y[i, j] - y[k, j])
            expected[i, j] -= k3 * adjacency[i, j] * (y[i, j] - xbar[j])
    np.testing.assert_allclose(paper.estimate_rate(k3, adjacency, y, xbar), expected, rtol=1e-13)


def test_gradient_is_the_derivative_of_the_cost(five: Game) -> None:
    x = np.random.default_rng(4).normal(size=(5, 2))
    parts = (five.cost_quadratic, five.cost_linear)
    gradient = paper.pseudo_gradient(x, *parts, five.cost_coupling)
    for i in range(5):
        for coordinate in range(2):
            shifted = x.astype(complex)
            shifted[i, coordinate] += 1e-30j
            cost = paper.cost(shifted, *parts, five.cost_constant, five.cost_coupling)
            assert cost[i].imag / 1e-30 == pytest.approx(gradient[i, coordinate], rel=1e-13)


# The assembled loop


def tiny_game() -> Game:
    """Player 1 of order 2, player 2 of order 1, one coordinate, two neurons."""
    return game_from_table(
        tomllib.loads("""
            title = "tiny"
            dimension = 1
            [gains]
            k1 = 3.0
            k2 = 2.0
            k3 = 5.0
            k4 = 7.0
            beta = 11.0
            delta = 0.5
            epsilon = 0.1
            [rbf]
            centers = [0.0, 1.0]
            width = 2.0
            W_max = 25.0
            [graph]
            edges = [[1, 2, 0.5]]
            [[player]]
            name = "one"
            order = 2
            x0 = 1
            cost = { quadratic = 1.0, linear = 0.5, coupling = [[2, 0.25]] }
            dynamics = { linear = [[2, 2.0]] }
            disturbance = { bias = 0.125 }
            [[player]]
            name = "two"
            order = 1
            x0 = 2
            cost = { quadratic = 0.5 }
            dynamics = { square = [[1, 3.0]] }
            disturbance = { amplitude = 1.0, frequency = 0.0, phase = 1.5707963267948966 }
        """)
    )


def test_assembled_rate_by_hand() -> None:
    game = tiny_game()
    x, p = column(1.0, 2.0), column(0.25, 1.5)  # p: v_1, z_2
    y = np.array([[[1.0], [0.0]], [[2.0], [1.0]]])
    W = np.array([[[3.0], [4.0]], [[-1.0], [1.0]]])
    on_sphere = np.array([[True], [False]])
    d_ext = column(0.5, 0.25)
    s = unpack(game, state_rate(game, 0.0, pack(x, p, y, W), on_sphere, d_ext))

    gradient_1 = 2 * 1.0 + 0.5 + 2 * 0.25 * (1.0 - 0.0)  # 3
    gradient_2 = 2 * 0.5 * 1.0
    e_1, e_2 = 0.25 + 2 * gradient_1, 2.0 - 1.5
    S_1 = [math.exp(-1 / 4), math.exp(-1 / 4)]  # |y_1|^2 = 1, |y_1 - 1|^2 = 1
    S_2 = [math.exp(-5 / 4), math.exp(-1 / 4)]
    nn_1, nn_2 = 3 * S_1[0] + 4 * S_1[1], -S_2[0] + S_2[1]
    phi_1, phi_2 = (0.5 * math.tanh(paper.ROBUST_CONSTANT * 0.5 * e / 0.1) for e in (e_1, e_2))
    u_1, u_2 = -7 * e_1 - nn_1 - phi_1, -3 * e_2 - nn_2 - phi_2
    np.testing.assert_allclose(s.x, column(0.25, u_2 + 3 * 1.0 + 1.0 + 0.25), rtol=1e-13)
    np.testing.assert_allclose(s.p, column(u_1 + 2 * 2.0 + 0.125 + 0.5, -2 * gradient_2), rtol=1e-13)
    # xbar = (x_1, z_2) = (1, 1.5), a_12 = 0.5, k3 = 5
    y_rates = [[-2.5 * (1 - 2), -2.5 * ((0 - 1) + (0 - 1.5))], [-2.5 * ((2 - 1) + (2 - 1)), -2.5 * (1 - 0)]]
    np.testing.assert_allclose(s.y[:, :, 0], y_rates, rtol=1e-13)
    radial = e_1 * nn_1 / 25.0
    w_1 = [11 * (S_1[0] * e_1 - radial * 3), 11 * (S_1[1] * e_1 - radial * 4)]
    np.testing.assert_allclose(s.W[0, :, 0], w_1, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(s.W[1, :, 0], [11 * S_2[0] * e_2, 11 * S_2[1] * e_2], rtol=1e-13)


def test_plain_strategy_is_without_network() -> None:
    game = replace(tiny_game(), robust=False, perturbed=False)
    state = np.random.default_rng(5).normal(size=initial_state(game).size)
    now = signals(game, state)
    np.testing.assert_allclose(now.u[:, 0], [-7 * now.e[0, 0], -3 * now.e[1, 0]], rtol=1e-13)
    s = unpack(game, state_rate(game, 1.0, state, np.zeros((2, 1), dtype=np.bool_), column(5.0, 6.0)))
    # the external disturbance is no part of the game's own perturbation
    np.testing.assert_allclose(s.p[0], now.u[0] + 5.0)
    np.testing.assert_allclose(s.x[1], now.u[1] + 6.0)
    assert not s.W.any()


@pytest.mark.parametrize("path", GAMES, ids=lambda path: path.stem)
def test_complex_step_jacobian_equals_finite_differences(path: Path) -> None:
    game = read_game(path)
    random = np.random.default_rng(6)
    state = 0.5 * random.normal(size=initial_state(game).size)
    on_sphere = random.random((game.players, game.dimension)) < 0.5
    d_ext = random.normal(size=on_sphere.shape)
    jacobian = state_jacobian(game, 0.3, state, on_sphere, d_ext)
    for _ in range(5):
        direction = random.normal(size=state.size)
        step = 1e-6
        ahead, behind = (
            state_rate(game, 0.3, state + h * direction, on_sphere, d_ext) for h in (step, -step)
        )
        exact = jacobian @ direction
        error = np.max(np.abs((ahead - behind) / (2 * step) - exact)) / np.max(np.abs(exact))
        assert error < 2e-6


# Closed forms


@pytest.mark.parametrize("path", GAMES, ids=lambda path: path.stem)
def test_linear_loop_is_the_plain_loop(path: Path) -> None:
    game = replace(read_game(path), robust=False, perturbed=False)
    matrix, offset = linear_loop.linear_loop(game)
    state = initial_state(game)
    state[: len(offset)] += np.random.default_rng(7).normal(size=len(offset))
    none = np.zeros((game.players, game.dimension))
    rate = state_rate(game, 0.0, state, none.astype(np.bool_), none)
    expected = matrix @ state[: len(offset)] + offset
    np.testing.assert_allclose(rate[: len(offset)], expected, rtol=1e-11, atol=1e-10)


@pytest.mark.parametrize("path", GAMES, ids=lambda path: path.stem)
def test_games_are_strongly_monotone_and_stable(path: Path) -> None:
    game = read_game(path)
    assert strong_monotonicity_constant(game) > 1.0
    assert linear_loop.spectral_abscissa(game) < -0.5
    at_equilibrium = nash_equilibrium(game)
    residual = linear_loop.gradient_coefficients(game) @ at_equilibrium + game.cost_linear
    assert np.max(np.abs(residual)) < 1e-12


def test_five_vehicles_equilibrium(five: Game) -> None:
    np.testing.assert_allclose(nash_equilibrium(five), np.full((5, 2), -0.5), atol=1e-14)


def test_every_connected_graph_on_five_vertices(five: Game) -> None:
    graphs = list(linear_loop.connected_graphs(5))
    assert len(graphs) == 728
    slowest = max(linear_loop.spectral_abscissa(replace(five, adjacency=graph)) for graph in graphs)
    assert round(-slowest, 2) == 2.98
    weak = replace(five, k1=5.0, k2=1.0, k3=5.0, k4=5.0)
    assert min(linear_loop.spectral_abscissa(replace(weak, adjacency=graph)) for graph in graphs) > 0.0


def test_unperturbed_plain_loop_equals_matrix_exponential(five: Game) -> None:
    game = replace(five, robust=False, perturbed=False)
    times = np.linspace(0.0, 3.0, 31)
    run = simulate(game, times)
    exact = linear_loop.exact_solution(game, times)
    np.testing.assert_allclose(run.x.reshape(31, -1), exact[:, :10], atol=1e-9)
    np.testing.assert_allclose((run.z + run.v).reshape(31, -1), exact[:, 10:20], atol=1e-8)
    np.testing.assert_allclose(run.y.reshape(31, -1), exact[:, 20:], atol=1e-9)
    assert np.max(np.abs(run.x[-1] + 0.5)) < 1e-6
    assert run.switch_count == 0


def test_matrix_exponential_does_not_depend_on_the_samples(five: Game) -> None:
    uneven = linear_loop.exact_solution(five, np.array([0.05, 0.2, 0.3, 0.7]))
    np.testing.assert_allclose(uneven[-1], linear_loop.exact_solution(five, np.array([0.7]))[0], rtol=1e-11)


# The hybrid system


def test_paper_example_known_results(five: Game) -> None:
    with np.load(REFERENCE / "five_vehicles.npz") as stored:
        late = stored["t"] >= 16.0
        largest = np.max(np.abs(stored["x"] - nash_equilibrium(five))[late])
        assert 0.001215 < largest < 0.00123
        assert stored["switch_count"] == 22
        assert len(stored["switch_time"]) == 22


def test_paper_example_through_all_its_switches(five: Game) -> None:
    with np.load(REFERENCE / "five_vehicles.npz") as stored:
        run = simulate(five, stored["t"][:8], rtol=1e-9, atol=1e-10)
        assert run.switch_count == stored["switch_count"]
        np.testing.assert_allclose(run.switch_times, stored["switch_time"], atol=1e-8)
        for name in ("x", "v", "z", "u", "W_norm2"):
            scale = np.max(np.abs(stored[name]))
            np.testing.assert_allclose(getattr(run, name), stored[name][:8], atol=1e-7 * scale, err_msg=name)


@pytest.mark.parametrize("name", [name for name in CASES if name != "five_vehicles"])
def test_stored_references_are_reproduced(name: str) -> None:
    case = CASES[name]
    game = read_game(case.path)
    with np.load(REFERENCE / f"{name}.npz") as stored:
        kept = len(stored["t"]) // 5 if not case.changes else len(stored["t"])
        run = simulate(game, stored["t"][:kept], rtol=1e-8, atol=1e-9, breakpoints=case.changes)
        for signal in ("x", "v", "z", "u", "W_norm2", "nash_error"):
            scale = max(1.0, float(np.max(np.abs(stored[signal]))))
            np.testing.assert_allclose(
                getattr(run, signal), stored[signal][:kept], atol=1e-5 * scale, err_msg=signal
            )
        assert np.max(run.W_norm2) <= game.W_max * (1.0 + 1e-9)
        expected = np.count_nonzero(stored["switch_time"] <= run.t[-1])
        assert run.switch_count == expected


@pytest.mark.parametrize("name", CASES)
def test_projection_keeps_every_column_in_the_ball(name: str) -> None:
    game = read_game(CASES[name].path)
    with np.load(REFERENCE / f"{name}.npz") as stored:
        assert np.max(stored["W_norm2"]) <= game.W_max * (1.0 + 1e-12)
        np.testing.assert_array_equal(stored["v"][:, game.first_order], 0.0)
        np.testing.assert_array_equal(stored["z"][:, ~game.first_order], 0.0)


def test_small_bound_enters_and_leaves_many_times() -> None:
    with np.load(REFERENCE / "small_weight_bound.npz") as stored:
        entered = stored["switch_entered"]
        assert np.count_nonzero(entered) > 50
        assert np.count_nonzero(~entered) > 40


def test_radau_agrees_with_dop853_through_switches() -> None:
    game = read_game(CASES["vector_centers"].path)
    times = np.linspace(0.0, 0.5, 6)
    explicit, implicit = (simulate(game, times, rtol=1e-8, atol=1e-10, method=m) for m in ("DOP853", "Radau"))
    assert explicit.switch_count == implicit.switch_count > 0
    np.testing.assert_allclose(explicit.x, implicit.x, atol=1e-7)
    np.testing.assert_allclose(explicit.W, implicit.W, atol=1e-7)


def test_breakpoint_acts_from_its_time_only() -> None:
    game = tiny_game()
    times = np.array([0.0, 0.1, 0.2])
    plain = simulate(game, times)
    pushed = simulate(game, times, breakpoints=[(0.1, {"d_ext": 3.0})])
    np.testing.assert_allclose(pushed.x[:2], plain.x[:2], rtol=1e-12)
    assert np.all(np.abs(pushed.x[2, 1] - plain.x[2, 1]) > 0.01)
    steady = simulate(replace(game, disturbance_bias=game.disturbance_bias + 3.0), times)
    always = simulate(game, times, breakpoints=[(0.0, {"d_ext": 3.0})])
    np.testing.assert_allclose(always.x, steady.x, rtol=1e-10)
    with pytest.raises(ValueError, match="W_max"):
        simulate(game, times, breakpoints=[(0.1, {"W_max": 1.0})])


# The reader


def test_reader_accepts_the_paper_game(five: Game) -> None:
    assert (five.players, five.dimension, five.neurons) == (5, 2, 11)
    assert five.order.tolist() == [1, 1, 1, 2, 2]
    expected = np.zeros((5, 5))
    for i, j in ((1, 2), (2, 3), (3, 2), (4, 2), (4, 5), (5, 1)):
        expected[i - 1, j - 1] = 1.0
    np.testing.assert_array_equal(five.cost_coupling, expected)
    x = np.random.default_rng(8).normal(size=(5, 2))
    g = paper.unknown_dynamics(x, five.dynamics_linear, five.dynamics_square, five.dynamics_gain)
    np.testing.assert_allclose(g[1], [x[1, 0] ** 2 + x[2, 0], x[1, 1]])
    np.testing.assert_allclose(g[[0, 2, 3, 4]], [x[1], 3 * x[2], 4 * x[3], 5 * x[4]])


def test_variants_of_the_paper_game_differ_in_strategy_only(five: Game) -> None:
    for name, perturbed in (("five_vehicles_plain", False), ("five_vehicles_plain_perturbed", True)):
        variant = read_game(CASES[name].path)
        assert (variant.robust, variant.perturbed) == (False, perturbed)
        for field in (entry.name for entry in fields(five)):
            if field not in ("title", "robust", "perturbed"):
                np.testing.assert_array_equal(getattr(variant, field), getattr(five, field), err_msg=field)


def _edited(edit: Callable[[Table], object]) -> Table:
    table = tomllib.loads(FIVE_VEHICLES.read_text(encoding="utf-8"))
    edit(table)
    return table


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda t: t["gains"].pop("k3"), "missing k3"),
        (lambda t: t["gains"].update(k5=1.0), "unknown key k5"),
        (lambda t: t["rbf"].update(W_max=0.0), "rbf.W_max: a positive number"),
        (lambda t: t["player"][0].update(order=3), "player 1: order"),
        (lambda t: t["player"][0].update(v0=1.0), "player 1: unknown key v0"),
        (lambda t: t["player"][1].update(x0=[1.0, 2.0, 3.0]), "player 2: x0: a list of 2"),
        (lambda t: t["player"][2]["cost"].update(coupling=[[10**9, 1.0]]), "player 3: cost.coupling"),
        (lambda t: t["graph"]["edges"].append([2, 1]), "given twice"),
        (lambda t: t.update(dimension=10**9), "dimension"),
    ],
)
def test_reader_refuses(edit: Callable[[Table], object], message: str) -> None:
    with pytest.raises(GameError, match=message.replace(".", r"\.")):
        game_from_table(_edited(edit))
