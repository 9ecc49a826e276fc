"""The closed loop assembled from the paper's equations: state layout, state rate and signals.

State vector: x (N D) | z of order 1 or v of order 2 (N D) | y (N N D) | W (N q D), each C-ordered.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import paper_equations as paper
from .game import FloatArray, Game
from .paper_equations import Numbers


@dataclass(frozen=True)
class Parts:
    """Views of one state vector."""

    x: Numbers  # (N, D)
    p: Numbers  # (N, D), z_i for order 1, v_i for order 2
    y: Numbers  # (N, N, D)
    W: Numbers  # (N, q, D)


@dataclass(frozen=True)
class Signals:
    """What the loop computes from a state before the rates."""

    S: Numbers  # (N, q), activations
    gradient: Numbers  # (N, D), grad_i f_i(y_i)
    e: Numbers  # (N, D), seeking error
    nn: Numbers  # (N, D), W_i^T S_i
    phi: Numbers  # (N, D), robust term; 0 when not robust
    u: Numbers  # (N, D), control within its bound
    wanted: Numbers  # (N, D), control before it is bounded


def unpack(game: Game, state: Numbers) -> Parts:
    """Split a state vector into views."""
    N, D, q = game.players, game.dimension, game.neurons
    a, b, c = N * D, 2 * N * D, 2 * N * D + N * N * D
    return Parts(
        x=state[:a].reshape(N, D),
        p=state[a:b].reshape(N, D),
        y=state[b:c].reshape(N, N, D),
        W=state[c:].reshape(N, q, D),
    )


def pack(x: Numbers, p: Numbers, y: Numbers, W: Numbers) -> Numbers:
    """Join the parts into a state vector."""
    return np.concatenate([x.ravel(), p.ravel(), y.ravel(), W.ravel()])


def initial_state(game: Game) -> FloatArray:
    """x(0), z(0) or v(0), y(0) and W(0) from the game."""
    p = np.where(game.first_order[:, np.newaxis], game.z0, game.v0)
    return np.asarray(pack(game.x0, p, game.y0, game.W0), dtype=np.float64)


def signals(game: Game, state: Numbers) -> Signals:
    """Everything algebraic in the loop. Without the robust part nn and phi are 0 and W stays at W(0)."""
    s = unpack(game, state)
    first = game.first_order[:, np.newaxis]
    gradient = paper.gradient_at_estimates(s.y, game.cost_quadratic, game.cost_linear, game.cost_coupling)
    e = np.where(
        first,
        paper.seeking_error_first_order(s.x, s.p),
        paper.seeking_error_second_order(game.k2, gradient, s.p),
    )
    S = paper.rbf_activation(s.y.reshape(game.players, -1), game.centers, game.width)
    if not game.robust:
        u = np.where(
            first,
            paper.plain_control_first_order(game.k1, s.x, s.p),
            paper.plain_control_second_order(game.k2, game.k4, gradient, s.p),
        )
        return Signals(S, gradient, e, np.zeros_like(e), np.zeros_like(e), _within(u, game.u_max), u)
    nn = paper.network_output(s.W, S)
    phi = paper.robust_term(game.delta, game.epsilon, e)
    u = np.where(
        first,
        paper.control_first_order(game.k1, s.x, s.p, nn, phi),
        paper.control_second_order(game.k2, game.k4, gradient, s.p, nn, phi),
    )
    return Signals(S, gradient, e, nn, phi, _within(u, game.u_max), u)


def _within(u: Numbers, u_max: FloatArray) -> Numbers:
    """u within [-u_max, u_max]; a complex step leaves the bound where it is."""
    return np.where(u.real > u_max, u_max, np.where(u.real < -u_max, -u_max, u))


def _per_entry(value: Numbers | float) -> Any:
    """A number of each player (N, 1), as a factor of arrays (N, D, ...) of three dimensions."""
    return value[..., np.newaxis] if isinstance(value, np.ndarray) else value


def _of(value: Numbers | float, players: NDArray[np.int_]) -> Any:
    """The numbers of some players (K, 1), of each player's (N, 1)."""
    return value[players] if isinstance(value, np.ndarray) else value


def state_rate(
    game: Game, t: float, state: Numbers, on_sphere: NDArray[np.bool_], d_ext: FloatArray
) -> Numbers:
    """Right-hand side in given projection modes.

    t in s, on_sphere (N, D) true where the weight column follows the on-sphere law, d_ext (N, D) the external
    disturbance, which comes from outside the game and acts whether or not the game is perturbed.
    """
    s = unpack(game, state)
    first = game.first_order[:, np.newaxis]
    now = signals(game, state)

    if game.perturbed:
        g = paper.unknown_dynamics(s.x, game.dynamics_linear, game.dynamics_square, game.dynamics_gain)
        d = paper.disturbance(
            t,
            game.disturbance_bias,
            game.disturbance_amplitude,
            game.disturbance_frequency,
            game.disturbance_phase,
        )
    else:
        g = d = np.zeros_like(s.x)
    d = d + d_ext
    x_rate_first = paper.first_order_plant(now.u, g, d)
    x_rate_second, v_rate = paper.second_order_plant(s.p, now.u, g, d)
    x_rate = np.where(first, x_rate_first, x_rate_second)
    p_rate = np.where(first, paper.reference_rate(game.k2, now.gradient), v_rate)

    xbar = paper.shared_signal(game.first_order, s.x, s.p)
    y_rate = paper.estimate_rate(_per_entry(game.k3), game.adjacency, s.y, xbar)

    if not game.robust:
        return pack(x_rate, p_rate, y_rate, np.zeros_like(s.W))
    S = now.S[:, np.newaxis, :]
    column_rate = paper.adaptation_inside(_per_entry(game.beta), S, now.e)  # (N, D, q)
    if on_sphere.any():
        i, coordinate = np.nonzero(on_sphere)
        column_rate[i, coordinate] = paper.adaptation_on_sphere(
            _of(game.beta, i), now.S[i], now.e[i, coordinate], s.W[i, :, coordinate]
        )
    return pack(x_rate, p_rate, y_rate, column_rate.transpose(0, 2, 1))


def state_jacobian(
    game: Game, t: float, state: FloatArray, on_sphere: NDArray[np.bool_], d_ext: FloatArray
) -> FloatArray:
    """d(state_rate)/d(state) by complex step, exact to rounding. Returns (n, n)."""
    step = 1e-30
    jacobian = np.empty((state.size, state.size))
    shifted = state.astype(np.complex128)
    for column in range(state.size):
        shifted[column] += 1j * step
        jacobian[:, column] = state_rate(game, t, shifted, on_sphere, d_ext).imag / step
        shifted[column] = state[column]
    return jacobian
