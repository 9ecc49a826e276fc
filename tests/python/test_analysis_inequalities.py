"""Every inequality of the proofs, on random states of the oracle's closed loop, with the loop's own rates.

V' is the derivative of V along the oracle's right-hand side by complex step. Each state has its own W* and
its own delta = max |eps_il| + |d_il|, the smallest that the theorem allows, some weight columns lie on the
sphere, and the sizes of the four errors are drawn on log scales, so that every cross term is at times the
largest.
"""

import math
from collections.abc import Iterator
from dataclasses import astuple, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from mixed_order_game.theory import paper_bounds as pb
from mixed_order_game.theory.certificate import Certificate, Weights, comparison_matrix
from mixed_order_game.theory.constants import (
    NO_DYNAMICS,
    DynamicsConstants,
    dynamics_constants,
    loop_constants,
)
from mixed_order_game.theory.design import paper_constants
from mixed_order_game.theory.game import AnalysedGame, Gains, read_game
from mixed_order_game.theory.lyapunov import scaled_identity
from tests.conftest import GAMES
from tests.oracle import closed_loop, equilibrium
from tests.oracle import game as oracle
from tests.oracle import paper_equations as paper

FIVE_VEHICLES = Path(__file__).resolve().parents[2] / "modelDescription/games/five_vehicles.toml"
NAMES = [
    "five_vehicles",
    "interleaved_orders",
    "three_second_order",
    "four_first_order",
    "two_scalar_players",
]
SAMPLES = 60

FloatArray = NDArray[np.float64]


def files(name: str) -> Path:
    return FIVE_VEHICLES if name == "five_vehicles" else GAMES / f"{name}.toml"


@dataclass(frozen=True, eq=False)
class Sample:
    """One state with its V' by parts; arrays as in the oracle."""

    game: AnalysedGame
    rates: FloatArray  # (5,) V_1' to V_5' with weights 1 and P = I
    speed: float  # |v_s|
    norms: FloatArray  # (4,) |xbar - x*|, |vbar_s|, |x_f - z_f|, |y - 1 (x) xbar|
    e: FloatArray  # (N, D)
    robust: FloatArray  # (N, D), e (d + eps - phi)
    weight_errors: FloatArray  # (N, D), W~'W~
    weight_rates: FloatArray  # (N, D), W~'(W'/beta - S e)
    second: Any  # (N,)
    column_rates: FloatArray  # (N, D), rate of W~'W~ / (2 beta)
    dynamics: DynamicsConstants


def lyapunov_parts(
    game: oracle.Game, state: NDArray[Any], x_star: FloatArray, W_star: FloatArray
) -> tuple[NDArray[Any], NDArray[Any]]:
    """V_1 to V_4 with P = I, and W~'W~ / (2 beta) per column; analytic in the state."""
    s = closed_loop.unpack(game, state)
    first = game.first_order
    xbar = paper.shared_signal(first, s.x, s.p)
    gradient = paper.gradient_at_estimates(s.y, game.cost_quadratic, game.cost_linear, game.cost_coupling)
    vbar = paper.seeking_error_second_order(game.k2, gradient, s.p)[~first]
    parts = np.array(
        [
            0.5 * np.sum((xbar - x_star) ** 2),
            0.5 * np.sum(vbar**2),
            0.5 * np.sum((s.x - s.p)[first] ** 2),
            np.sum((s.y - xbar) ** 2),
        ]
    )
    return parts, np.sum((s.W - W_star) ** 2, axis=1) / (2.0 * game.beta)


def samples(
    name: str, seed: int, *, plain: bool = False, moved: bool = False, count: int = SAMPLES
) -> Iterator[Sample]:
    """Random states; plain: the loop of Theorem 2; moved: with dynamics that depend on velocities, too."""
    source, own = oracle.read_game(files(name)), read_game(files(name))
    random = np.random.default_rng(seed)
    x_star = equilibrium.nash_equilibrium(source)
    N, D, q = source.players, source.dimension, source.neurons
    first = source.first_order
    for _ in range(count):
        k1, k2, k3, k4 = (10.0 ** random.uniform(-1.0, 2.0, size=4)).tolist()
        game = replace(source, robust=not plain, perturbed=not plain, k1=k1, k2=k2, k3=k3, k4=k4)
        size = 10.0 ** random.uniform(-2.0, 1.5, size=4)

        def vector(*shape: int, norm: float, aligned: float) -> FloatArray:
            """A random vector, at times nearly the same in all entries."""
            raw = random.standard_normal(shape) + aligned * random.standard_normal()
            return np.asarray(norm * raw / np.linalg.norm(raw))

        aligned = float(random.choice([0.0, 3.0]))
        xbar = x_star + vector(N, D, norm=size[0], aligned=aligned)
        y = xbar + vector(N, N, D, norm=size[3], aligned=aligned)
        gradient = paper.gradient_at_estimates(y, game.cost_quadratic, game.cost_linear, game.cost_coupling)
        vbar = vector(N, D, norm=size[1], aligned=aligned)
        tracking = vector(N, D, norm=size[2], aligned=aligned)
        x = np.where(first[:, np.newaxis], xbar + tracking, xbar)
        p = np.where(first[:, np.newaxis], xbar, vbar - game.k2 * gradient)
        e = np.where(first[:, np.newaxis], x - p, vbar)

        S = paper.rbf_activation(y.reshape(N, -1), game.centers, game.width)
        root = math.sqrt(game.W_max)
        W_star = random.standard_normal((N, q, D))
        W_star *= root * random.uniform(size=(N, 1, D)) / np.linalg.norm(W_star, axis=1, keepdims=True)
        W = random.standard_normal((N, q, D))
        on_sphere = random.uniform(size=(N, D)) < 0.5
        radii = np.where(on_sphere, 1.0, random.uniform(size=(N, D)))
        W *= root * radii[:, np.newaxis] / np.linalg.norm(W, axis=1, keepdims=True)
        on_sphere &= e * paper.network_output(W, S) >= 0.0

        rates = game.dynamics_linear, game.dynamics_square, game.dynamics_gain
        g_at_y = np.array([paper.unknown_dynamics(y[i], *rates)[i] for i in range(N)])
        eps = g_at_y - paper.network_output(W_star, S)
        t = float(random.uniform(0.0, 10.0))
        d = paper.disturbance(
            t,
            game.disturbance_bias,
            game.disturbance_amplitude,
            game.disturbance_frequency,
            game.disturbance_phase,
        )
        game = replace(game, delta=float((np.abs(eps) + np.abs(d)).max()))
        state = closed_loop.pack(x, p, y, W)
        rate = closed_loop.state_rate(game, t, state, on_sphere, np.zeros((N, D)))
        step = 1e-30
        parts, columns = lyapunov_parts(game, state + 1j * step * rate, x_star, W_star)
        W_rate = closed_loop.unpack(game, rate).W
        W_error = W - W_star
        phi = paper.robust_term(game.delta, game.epsilon, e)
        distance = max(float(np.linalg.norm(x - x_star)), float(np.linalg.norm(xbar - x_star)))
        reach = max(*np.linalg.norm((y - x_star).reshape(N, -1), axis=1).tolist(), distance)
        pulled = W_rate / game.beta - S[:, :, np.newaxis] * e[:, np.newaxis]
        rates_of_parts = np.append(parts.imag / step, np.sum(columns.imag / step))
        local = NO_DYNAMICS if plain else dynamics_constants(own.parameters, distance, reach)
        if moved:  # g_i has sum_j K_ij v_j besides, and e moves with it, as far as it can or anyhow
            v = np.where(first[:, np.newaxis], 0.0, p)
            K = e @ v.T if random.uniform() < 0.7 else random.standard_normal((N, N)) * ~first
            K *= 10.0 ** random.uniform(0.0, 5.0) / max(float(np.linalg.norm(K)), 1e-300)
            moving = e * (K @ v)
            rates_of_parts[1] += moving[~first].sum()
            rates_of_parts[2] += moving[first].sum()
            local = replace(
                local,
                velocity_lipschitz=np.linalg.norm(K, axis=1),
                first_velocities=float(np.linalg.norm(K[first], 2)) if first.any() else 0.0,
                second_velocities=float(np.linalg.norm(K[~first], 2)) if not first.all() else 0.0,
            )
        yield Sample(
            game=own.with_gains(
                Gains(game.k1, game.k2, game.k3, game.k4, game.beta, game.delta, game.epsilon, game.W_max)
            ),
            rates=rates_of_parts,
            speed=float(np.linalg.norm(p[~first])),
            norms=np.array(
                [
                    np.linalg.norm(xbar - x_star),
                    np.linalg.norm(vbar[~first]),
                    np.linalg.norm(tracking[first]),
                    np.linalg.norm(y - xbar),
                ]
            ),
            e=e,
            robust=e * (d + eps - phi),
            weight_errors=np.sum(W_error**2, axis=1),
            weight_rates=np.sum(W_error * pulled, axis=1),
            second=~first,
            column_rates=np.asarray(columns.imag / step),
            dynamics=local,
        )


def constants_of(s: Sample, p: float, coordinates: int | None = None) -> pb.PaperConstants:
    dynamics = s.dynamics
    if dynamics is NO_DYNAMICS:
        dynamics = replace(dynamics, lipschitz=np.zeros(s.game.parameters.players))
    c = loop_constants(s.game.parameters)
    return paper_constants(s.game, c, p=p, dynamics=dynamics, coordinates=coordinates)


def quadratic(coefficients: pb.Coefficients, norms: FloatArray) -> float:
    """-sum c_i r_i^2; a group without players has an infinite coefficient and a norm of 0."""
    ordered = (coefficients.actions, coefficients.velocities, coefficients.tracking, coefficients.estimates)
    return -math.fsum(c * r * r for c, r in zip(ordered, norms.tolist(), strict=True) if r > 0.0)


def slack(bound: float, value: float, *scales: float) -> None:
    """value <= bound up to rounding of the largest number met on the way."""
    assert value <= bound + 1e-9 * max(abs(bound), abs(value), *map(abs, scales))


@pytest.mark.parametrize("name", NAMES)
def test_lemmas_of_the_adaptive_and_the_robust_part(name: str) -> None:
    """W~'(W'/beta - S e) <= 0, e (d + eps - phi) <= epsilon and W~'W~ <= 4 W_max, per column."""
    for s in samples(name, 1):
        assert np.all(s.weight_rates <= 1e-9 * np.abs(s.column_rates).max() + 1e-9)
        assert np.all(s.robust <= s.game.gains.epsilon * (1.0 + 1e-9))
        assert np.all(s.weight_errors <= 4.0 * s.game.gains.W_max * (1.0 + 1e-12))


@pytest.mark.parametrize("moved", [False, True])
@pytest.mark.parametrize("name", NAMES)
def test_comparison_matrix_bounds_the_rate(name: str, moved: bool) -> None:
    """V' <= -r'Theta r + D epsilon (n w_f + (N - n) w_s) for random weights and gains."""
    random = np.random.default_rng(2)
    for s in samples(name, 2, moved=moved, count=SAMPLES // 3 if moved else SAMPLES):
        weights = Weights(*(10.0 ** random.uniform(-4.0, 1.0, size=3)).tolist())
        c = loop_constants(s.game.parameters)
        theta, _ = comparison_matrix(c, s.dynamics, s.game.gains, weights)
        r = s.norms[[True, c.second_players > 0, c.first_players > 0, True]]
        noise = c.first_players * weights.tracking + c.second_players * weights.velocities
        of_column = np.where(s.second, weights.velocities, weights.tracking)[:, np.newaxis]
        by_part = [*np.array([1.0, weights.velocities, weights.tracking, weights.estimates]) * s.rates[:4]]
        by_part.append(float(np.sum(of_column * s.column_rates)))
        bound = -float(r @ theta @ r) + c.dimension * noise * s.game.gains.epsilon
        slack(bound, sum(by_part), *by_part)


@pytest.mark.parametrize("name", NAMES)
def test_a_level_bounds_the_velocities(name: str) -> None:
    random = np.random.default_rng(22)
    for s in samples(name, 22, count=SAMPLES // 3):
        weights = Weights(*(10.0 ** random.uniform(-4.0, 1.0, size=3)).tolist())
        halves = np.array([0.5, 0.5 * weights.velocities, 0.5 * weights.tracking, weights.estimates])
        found = Certificate(loop_constants(s.game.parameters), weights, 1.0)
        assert s.speed <= found.velocity_radius(float(halves @ s.norms**2), s.game.gains.k2) * (1.0 + 1e-9)


def test_every_term_of_the_comparison_matrix_is_needed() -> None:
    """Turning the sign of any one cross term of Theta is refuted by some state."""
    refuted = set()
    for name in ("five_vehicles", "interleaved_orders"):
        random = np.random.default_rng(21)
        for s in samples(name, 21, plain=True, count=250):
            weights = Weights(*(10.0 ** random.uniform(-4.0, 1.0, size=3)).tolist())
            c = loop_constants(s.game.parameters)
            theta, _ = comparison_matrix(c, s.dynamics, s.game.gains, weights)
            scale = np.array([1.0, weights.velocities, weights.tracking, weights.estimates])
            value = float(scale @ s.rates[:4])
            for i, j in ((0, 1), (0, 2), (0, 3), (1, 3), (2, 3)):
                flipped = theta.copy()
                flipped[i, j] = flipped[j, i] = -theta[i, j]
                if value > -float(s.norms @ flipped @ s.norms) + 1e-9 * abs(value):
                    refuted.add((i, j))
    assert refuted == {(0, 1), (0, 2), (0, 3), (1, 3), (2, 3)}


@pytest.mark.parametrize("moved", [False, True])
@pytest.mark.parametrize("name", NAMES)
def test_theorem_1_coefficients_bound_the_rate(name: str, moved: bool) -> None:
    """V' <= -sum Phi_i r_i^2 - sum W~'W~ + N D epsilon + 4 N D W_max, for random p: the constants hold."""
    random = np.random.default_rng(3)
    for s in samples(name, 3, moved=moved, count=SAMPLES // 3 if moved else SAMPLES):
        p = float(10.0 ** random.uniform(-3.0, 0.5))
        c = constants_of(s, p)
        columns = c.players * c.coordinates
        gains = s.game.gains
        added = 4.0 * columns * gains.W_max - float(s.weight_errors.sum())
        assert added >= 0.0
        bound = quadratic(pb.theorem_1_coefficients(c, gains), s.norms) + columns * gains.epsilon + added
        by_part = [*(np.array([1.0, 1.0, 1.0, p, 1.0]) * s.rates)]
        slack(bound, sum(by_part), *by_part)


@pytest.mark.parametrize("of_order_1", [True, False])
def test_theorem_1_loses_no_more_than_products_with_velocities(of_order_1: bool) -> None:
    """nu r (|vbar_s| + k2 l |xbar - x*| + k2 l sqrt(N) |y - 1 (x) xbar|), r = |x_f - z_f| or |vbar_s|.

    The loss covers it for all norms, and exactly where each product is half the sum of its two squares.
    """
    s = next(iter(samples(NAMES[0], 6, count=1)))
    c = replace(constants_of(s, 0.1), first_velocities=0.0, second_velocities=0.0)
    gains, nu = s.game.gains, 0.7
    without = pb.theorem_1_coefficients(c, gains)
    moved = replace(c, first_velocities=nu) if of_order_1 else replace(c, second_velocities=nu)
    with_velocities = pb.theorem_1_coefficients(moved, gains)
    loss = np.subtract(astuple(without), astuple(with_velocities))
    through, root = gains.k2 * c.lipschitz, math.sqrt(c.players)
    nu *= math.sqrt(c.first_players if of_order_1 else c.second_players)

    def slack_at(norms: FloatArray) -> float:
        actions, velocities, tracking, estimates = norms
        driven = tracking if of_order_1 else velocities
        products = nu * driven * (velocities + through * actions + through * root * estimates)
        return float(loss @ norms**2 - products)

    random = np.random.default_rng(6)
    assert min(slack_at(10.0 ** random.uniform(-2.0, 2.0, 4)) for _ in range(1000)) >= 0.0
    equal = np.array(
        [nu * through, nu if of_order_1 else 1.0, 1.0 if of_order_1 else 0.0, nu * through * root]
    )
    assert slack_at(equal) == pytest.approx(0.0, abs=1e-12 * float(loss @ equal**2))


@pytest.mark.parametrize("name", NAMES)
def test_theorem_2_coefficients_bound_the_rate(name: str) -> None:
    random = np.random.default_rng(4)
    for s in samples(name, 4, plain=True):
        p = float(10.0 ** random.uniform(-3.0, 0.5))
        bound = quadratic(pb.theorem_2_coefficients(constants_of(s, p), s.game.gains), s.norms)
        by_part = [*(np.array([1.0, 1.0, 1.0, p]) * s.rates[:4])]
        slack(bound, sum(by_part), *by_part)


@pytest.mark.parametrize("name", NAMES)
def test_boundedness_coefficients_bound_the_rate(name: str) -> None:
    """(V_1 + ... + V_4)' <= -sum Psi_i r_i^2 + a_f |x_f - z_f| + a_s |vbar_s|, with D in a_f and a_s."""
    random = np.random.default_rng(5)
    for s in samples(name, 5):
        p = float(10.0 ** random.uniform(-3.0, 0.5))
        c, gains = constants_of(s, p), s.game.gains
        size = math.sqrt(c.neurons * gains.W_max) + gains.delta + c.disturbance + c.dynamics_at_equilibrium
        push = math.sqrt(c.coordinates) * size
        bound = quadratic(pb.boundedness_coefficients(c, gains), s.norms)
        bound += (
            push * math.sqrt(c.first_players) * s.norms[2] + push * math.sqrt(c.second_players) * s.norms[1]
        )
        by_part = [*(np.array([1.0, 1.0, 1.0, p]) * s.rates[:4])]
        slack(bound, sum(by_part), *by_part)


def test_coordinates_enter_the_noise() -> None:
    """With D = 2, sum e (d + eps - phi) exceeds the printed N epsilon and attains nearly N D epsilon."""
    N, D, delta, epsilon = 5, 2, 10.0, 0.01
    K = paper.ROBUST_CONSTANT
    e = np.full((N, D), 0.5 * (1.0 + K) * epsilon / (K * delta))  # where |u| - u tanh u is largest
    total = float(np.sum(e * (delta - paper.robust_term(delta, epsilon, e))))
    assert total > N * epsilon
    assert total == pytest.approx(N * D * epsilon, rel=1e-12)
    W_max = 500.0
    W_error = 2.0 * math.sqrt(W_max) * np.ones((N, D))  # W = -W*, both on the sphere
    assert np.sum(W_error**2) > 4.0 * N * W_max
    assert np.sum(W_error**2) == pytest.approx(4.0 * N * D * W_max)
    # There, with every other error 0, V' = 0, which the printed bound denies and the one with D does not.
    assert N * epsilon + 4.0 * N * W_max - np.sum(W_error**2) < 0.0
    assert N * D * epsilon + 4.0 * N * D * W_max - np.sum(W_error**2) >= 0.0


def test_constant_of_the_robust_term_is_the_best_one() -> None:
    """sup of |u| - u tanh(u) is K = exp(-(K + 1)): e (delta - phi) <= epsilon is sharp."""
    u = np.linspace(0.0, 5.0, 2_000_001)
    largest = float(np.max(u - u * np.tanh(u)))
    assert largest == pytest.approx(paper.ROBUST_CONSTANT, rel=1e-9)
    assert math.exp(-(paper.ROBUST_CONSTANT + 1.0)) == pytest.approx(paper.ROBUST_CONSTANT)


@pytest.mark.parametrize(("first_players", "second_players"), [(0, 3), (3, 0), (3, 2), (2, 2)])
def test_last_step_of_the_boundedness_lemma(first_players: int, second_players: int) -> None:
    """Above the printed level of V the lemma's own bound of V' exceeds -r V / 2, unless n = N - n."""
    c = pb.PaperConstants(
        players=first_players + second_players,
        first_players=first_players,
        neurons=11,
        coordinates=1,
        monotonicity=3.0,
        lipschitz=12.0,
        b=50.0,
        pair=scaled_identity(0.3, 0.5),
    )
    gains = Gains(1.0, 1.0, 1.0, 1.0, 1.0, 10.0, 0.01, 500.0)
    size = math.sqrt(c.neurons * gains.W_max) + gains.delta
    a = np.sqrt([first_players, second_players]) * size
    psi = 2.0
    rate = psi / 0.5
    equal = pb.Coefficients(psi, psi, psi, psi)

    def excess(level: float) -> float:
        """Largest of the lemma's bound of V' plus r V / 2 over |x_f - z_f|^2 + |vbar_s|^2 = 2 V."""
        r = a / np.linalg.norm(a) * math.sqrt(2.0 * level)
        return -psi * float(r @ r) + float(a @ r) + 0.5 * rate * level

    printed = pb.boundedness_level(c, gains, equal, corrected=False)
    corrected = pb.boundedness_level(c, gains, equal, corrected=True)
    tolerance = 1e-9 * rate * corrected
    assert excess(corrected) == pytest.approx(0.0, abs=tolerance)
    if first_players == second_players:
        assert corrected == pytest.approx(printed)
    else:
        assert corrected > printed
        assert excess(1.0001 * printed) > tolerance
    if 0 in (first_players, second_players):
        assert corrected / printed == pytest.approx(2.0)


def test_young_split_of_theorem_1() -> None:
    """k2 k3 b v y <= b/2 (k3^2 v^2 + k2^2 y^2): the k2^2 and k3^2 sides of the print are right."""
    k2, k3, b, v, y = 10.0 ** np.random.default_rng(6).uniform(-2.0, 2.0, size=(5, 1000))
    assert np.all(k2 * k3 * b * v * y <= 0.5 * b * ((k3 * v) ** 2 + (k2 * y) ** 2) * (1.0 + 1e-12))


def test_sharper_level_is_the_best_factor() -> None:
    """Over all factors c of 4 N D W_max - sum W~'W~ the level is least at c = K_0 / (2 beta)."""
    c = pb.PaperConstants(5, 3, 11, 2, 3.3, 12.0, 50.0, scaled_identity(0.3, 0.5))
    gains = Gains(1.0, 1.0, 1.0, 1.0, 100.0, 10.0, 0.01, 500.0)
    for psi in (0.1, 30.0, 5000.0):
        coefficients = pb.Coefficients(psi, psi, psi, psi)
        rate = coefficients.rate(c.pair)
        factors = np.geomspace(1e-8, 1e8, 20001)
        levels = (
            10 * (gains.epsilon + 4.0 * factors * gains.W_max) / np.minimum(rate, 2.0 * gains.beta * factors)
        )
        sharper = pb.sharper_ultimate_level(c, gains, coefficients)
        assert sharper <= levels.min() * (1.0 + 1e-12)
        assert sharper == pytest.approx(levels.min(), rel=1e-3)
        assert sharper <= pb.ultimate_level(c, gains, coefficients) * (1.0 + 1e-12)
