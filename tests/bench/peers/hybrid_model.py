"""The closed loop in given projection modes for peers in Python: compiled rates, Jacobian, event functions.

State x | z or v | y_i (l, j) | W_m (l, i): every part is made of rows of N D entries, entry (i, l) at
l N + i, as in the core, so that trajectories compare directly. Modes are one number per weight column:
0 inside, 1 on the sphere.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numba
import numpy as np
from numpy.typing import NDArray

from tests.oracle.game import FloatArray, Game
from tests.oracle.paper_equations import ROBUST_CONSTANT

IntArray: TypeAlias = NDArray[np.int64]


@dataclass(frozen=True)
class Solution:
    """States at the output times and the cost of the integration."""

    states: FloatArray  # (T, size)
    cpu: float  # s, integration only
    events: int
    rate_evaluations: int | None = None


def rows_of(matrix: FloatArray) -> FloatArray:
    """(N, D) player-major to a row of N D entries, coordinate-major."""
    return np.ascontiguousarray(matrix.T).ravel()


class HybridModel:
    """One game, robust and perturbed, with numbers as centres; compiled functions of (t, state, modes)."""

    def __init__(self, game: Game) -> None:
        if not (game.robust and game.perturbed) or np.any(game.centers != game.centers[:, :1]):
            raise ValueError("the peers solve the robust, perturbed strategy with numbers as centres")
        self.game = game
        N, D, q = game.players, game.dimension, game.neurons
        self.columns = N * D
        self.size = (2 + N + q) * N * D
        self.W_max = game.W_max
        gain = game.dynamics_gain[:, np.newaxis, np.newaxis]
        self.data = (
            game.first_order.astype(np.int64),
            np.array([game.k1, game.k2, game.k3, game.k4, game.beta, game.delta, game.epsilon]),
            np.ascontiguousarray(game.centers[:, 0]),
            1.0 / game.width**2,
            game.W_max,
            *_sparse(game.adjacency),
            np.ascontiguousarray(game.adjacency),
            game.cost_quadratic.copy(),
            rows_of(game.cost_linear),
            *_sparse(game.cost_coupling),
            *_sparse(np.abs(game.dynamics_linear).sum(2) + np.abs(game.dynamics_square).sum(2))[:2],
            np.ascontiguousarray((gain * game.dynamics_linear).transpose(2, 0, 1)),
            np.ascontiguousarray((gain * game.dynamics_square).transpose(2, 0, 1)),
            rows_of(game.disturbance_amplitude),
            rows_of(game.disturbance_frequency),
            rows_of(game.disturbance_phase),
            rows_of(game.disturbance_bias),
        )
        # compile now, for arrays that may and that may not be written to
        state, modes = self.initial_state(), np.zeros(self.columns)
        out, values, jacobian = np.empty(self.size), np.empty(self.columns), np.zeros((self.size, self.size))
        frozen = state.copy()
        frozen.flags.writeable = False
        for argument in (state, frozen):
            self.rate(0.0, argument, modes, out)
            self.events(argument, modes, values)
            self.jacobian(argument, modes, jacobian)

    def initial_state(self) -> FloatArray:
        """(size,), W = 0."""
        game = self.game
        p = np.where(game.first_order[:, np.newaxis], game.z0, game.v0)
        y = [rows_of(row) for row in game.y0]
        return np.concatenate([rows_of(game.x0), rows_of(p), *y, np.zeros(game.neurons * self.columns)])

    def rate(self, t: float, state: FloatArray, modes: FloatArray, out: FloatArray) -> None:
        """State rates, written to out (size,)."""
        _rate(t, state, modes, out, self.data)

    def jacobian(self, state: FloatArray, modes: FloatArray, out: FloatArray) -> None:
        """d rate / d state, written to out (size, size), whose other entries are and stay zero."""
        _jacobian(state, modes, out, self.data)

    def events(self, state: FloatArray, modes: FloatArray, out: FloatArray) -> None:
        """One function per column (N D,), which rises through zero where its mode ends.

        w'w / W_max - 1 inside, -e w'S on the sphere.
        """
        _events(state, modes, out, self.data)

    def pattern(self) -> NDArray[np.bool_]:
        """(size, size), where the Jacobian may differ from zero in any mode."""
        pattern = np.zeros((self.size, self.size), dtype=np.bool_)
        generator = np.random.default_rng(0)
        out = np.zeros((self.size, self.size))
        for mode in (0.0, 1.0):
            out[:] = 0.0
            self.jacobian(generator.normal(size=self.size), np.full(self.columns, mode), out)
            pattern |= out != 0.0
        return pattern

    def switch(self, state: FloatArray, modes: FloatArray, column: int) -> None:
        """Changes one column's mode at an event, in place; columns on the sphere are scaled to W_max."""
        values = np.empty(self.columns)
        if modes[column] == 0.0:
            modes[column] = 1.0
            self.events(state, modes, values)
            if values[column] > 0.0:  # w'w reached the bound while e w'S < 0: it stays inside
                modes[column] = 0.0
        else:
            modes[column] = 0.0
        self.project(state, modes)

    def project(self, state: FloatArray, modes: FloatArray) -> None:
        """Scales the columns on the sphere to W_max, in place."""
        W = state[(2 + self.game.players) * self.columns :].reshape(-1, self.columns)
        on = modes != 0.0
        W[:, on] *= np.sqrt(self.W_max / np.sum(W[:, on] ** 2, axis=0))


def _sparse(matrix: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
    """Compressed rows: start, column, value."""
    start = np.concatenate([[0], np.cumsum(np.count_nonzero(matrix, axis=1))]).astype(np.int64)
    row, column = np.nonzero(matrix)
    return start, column.astype(np.int64), matrix[row, column].astype(np.float64)


@numba.njit(cache=True, fastmath=False)
def _signals(state, data, S, gradient, e, s, phi):  # type: ignore[no-untyped-def]
    first, gains, centers, scale = data[0], data[1], data[2], data[3]
    quadratic, linear, c_start, c_player, c_value = data[9], data[10], data[11], data[12], data[13]
    N, q = len(first), len(centers)
    n = len(linear)
    k2, delta, epsilon = gains[1], gains[5], gains[6]
    for i in range(N):
        y = state[(2 + i) * n : (3 + i) * n]
        total = 0.0
        squares = 0.0
        for k in range(n):
            total += y[k]
            squares += y[k] * y[k]
        for m in range(q):
            c = centers[m]
            S[i, m] = np.exp(-(squares - 2.0 * c * total + n * c * c) * scale)
        for p in range(i, n, N):
            sum_ = 2.0 * quadratic[i] * y[p] + linear[p]
            for k in range(c_start[i], c_start[i + 1]):
                sum_ += 2.0 * c_value[k] * (y[p] - y[p - i + c_player[k]])
            gradient[p] = sum_
            e[p] = state[p] - state[n + p] if first[i] == 1 else state[n + p] + k2 * sum_
            s[p] = 0.0
            phi[p] = delta * np.tanh(ROBUST_CONSTANT * delta * e[p] / epsilon)
    for m in range(q):
        w = state[(2 + N + m) * n : (3 + N + m) * n]
        for p in range(n):
            s[p] += w[p] * S[p % N, m]


@numba.njit(cache=True, fastmath=False)
def _rate(t, state, modes, out, data):  # type: ignore[no-untyped-def]
    first, gains, centers, W_max = data[0], data[1], data[2], data[4]
    a_start, a_player, a_value = data[5], data[6], data[7]
    g_start, g_player, G, H = data[14], data[15], data[16], data[17]
    amplitude, frequency, phase, bias = data[18], data[19], data[20], data[21]
    N, q, n = len(first), len(centers), len(amplitude)
    k1, k2, k3, k4, beta = gains[0], gains[1], gains[2], gains[3], gains[4]
    S = np.empty((N, q))
    gradient, e, s, phi = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    _signals(state, data, S, gradient, e, s, phi)
    for p in range(n):
        i, l = p % N, p // N  # noqa: E741
        driven = bias[p] + amplitude[p] * np.sin(frequency[p] * t + phase[p])
        for k in range(g_start[i], g_start[i + 1]):
            j = g_player[k]
            xj = state[l * N + j]
            driven += (G[l, i, j] + H[l, i, j] * xj) * xj
        driven -= (k1 if first[i] == 1 else k4) * e[p] + s[p] + phi[p]
        if first[i] == 1:
            out[p] = driven
            out[n + p] = -k2 * gradient[p]
        else:
            out[p] = state[n + p]
            out[n + p] = driven
    for i in range(N):
        y = state[(2 + i) * n : (3 + i) * n]
        o = out[(2 + i) * n : (3 + i) * n]
        o[:] = 0.0
        for k in range(a_start[i], a_start[i + 1]):
            j, a = a_player[k], -k3 * a_value[k]
            other = state[(2 + j) * n : (3 + j) * n]
            for p in range(n):
                o[p] += a * (y[p] - other[p])
            for p in range(j, n, N):
                o[p] += a * (y[p] - (state[n + p] if first[j] == 1 else state[p]))
    for m in range(q):
        w = state[(2 + N + m) * n : (3 + N + m) * n]
        o = out[(2 + N + m) * n : (3 + N + m) * n]
        for p in range(n):
            o[p] = beta * e[p] * (S[p % N, m] - modes[p] * (s[p] / W_max) * w[p])


@numba.njit(cache=True, fastmath=False)
def _events(state, modes, out, data):  # type: ignore[no-untyped-def]
    first, centers, W_max = data[0], data[2], data[4]
    N, q, n = len(first), len(centers), len(data[10])
    any_on_sphere = False
    for p in range(n):
        if modes[p] != 0.0:
            any_on_sphere = True
        norm2 = 0.0
        for m in range(q):
            w = state[(2 + N + m) * n + p]
            norm2 += w * w
        out[p] = norm2 / W_max - 1.0
    if any_on_sphere:
        S = np.empty((N, q))
        gradient, e, s, phi = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
        _signals(state, data, S, gradient, e, s, phi)
        for p in range(n):
            if modes[p] != 0.0:
                out[p] = -e[p] * s[p]


@numba.njit(cache=True, fastmath=False)
def _jacobian(state, modes, J, data):  # type: ignore[no-untyped-def]
    first, gains, centers, scale, W_max = data[0], data[1], data[2], data[3], data[4]
    a_start, a_player, a_value, adjacency = data[5], data[6], data[7], data[8]
    quadratic, c_start, c_player, c_value = data[9], data[11], data[12], data[13]
    g_start, g_player, G, H = data[14], data[15], data[16], data[17]
    N, q, n = len(first), len(centers), len(data[10])
    k1, k2, k3, k4 = gains[0], gains[1], gains[2], gains[3]
    beta, delta, epsilon = gains[4], gains[5], gains[6]
    S = np.empty((N, q))
    gradient, e, s, phi = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    _signals(state, data, S, gradient, e, s, phi)
    ds = np.empty(n)  # d(w'S) / d y_i
    de = np.empty(n)  # d e / d y_i, order 2
    for p in range(n):
        i, l = p % N, p // N  # noqa: E741
        own = (2 + i) * n
        second = first[i] != 1
        y = state[own : own + n]
        hp = 2.0 * quadratic[i]
        for k in range(c_start[i], c_start[i + 1]):
            hp += 2.0 * c_value[k]
        de[:] = 0.0
        de[p] = k2 * hp
        for k in range(c_start[i], c_start[i + 1]):
            de[l * N + c_player[k]] -= 2.0 * k2 * c_value[k]
        tanh = phi[p] / delta
        stiffness = (k4 if second else k1) + ROBUST_CONSTANT * delta * delta / epsilon * (1.0 - tanh * tanh)
        sum_ws, sum_cws = 0.0, 0.0
        for m in range(q):
            ws = state[(2 + N + m) * n + p] * S[i, m]
            sum_ws += ws
            sum_cws += centers[m] * ws
        for k in range(n):
            ds[k] = -2.0 * scale * (sum_ws * y[k] - sum_cws)
        row = n + p if second else p
        # driven row: u + g
        if second:
            J[p, n + p] = 1.0
            J[row, n + p] = -stiffness
            for k in range(n):
                J[row, own + k] = -stiffness * de[k] - ds[k]
        else:
            for k in range(n):
                J[row, own + k] = -ds[k]
                if de[k] != 0.0:
                    J[n + p, own + k] = -de[k]
            J[row, n + p] = stiffness
            J[row, p] = -stiffness
        for k in range(g_start[i], g_start[i + 1]):
            j = g_player[k]
            value = G[l, i, j] + 2.0 * H[l, i, j] * state[l * N + j]
            column = l * N + j
            J[row, column] = value - (stiffness if column == row else 0.0)
        for m in range(q):
            J[row, (2 + N + m) * n + p] = -S[i, m]
        # adaptation
        r = modes[p] * s[p] / W_max
        theta = modes[p] / W_max
        for m in range(q):
            at = (2 + N + m) * n + p
            w = state[at]
            through_error = beta * (S[i, m] - r * w)
            through_S = -2.0 * scale * beta * e[p] * S[i, m]
            for k in range(n):
                J[at, own + k] = through_S * (y[k] - centers[m]) - beta * e[p] * theta * w * ds[k]
                if second:
                    J[at, own + k] += through_error * de[k]
            if second:
                J[at, n + p] = through_error
            else:
                J[at, p] = through_error
                J[at, n + p] = -through_error
            for h in range(q):
                J[at, (2 + N + h) * n + p] = -beta * e[p] * theta * w * S[i, h]
            J[at, at] -= beta * e[p] * r
    for i in range(N):
        degree = 0.0
        for k in range(a_start[i], a_start[i + 1]):
            degree += a_value[k]
        for p in range(n):
            j = p % N
            J[(2 + i) * n + p, (2 + i) * n + p] = -k3 * (degree + adjacency[i, j])
            for k in range(a_start[i], a_start[i + 1]):
                J[(2 + i) * n + p, (2 + a_player[k]) * n + p] = k3 * a_value[k]
            if adjacency[i, j] != 0.0:
                J[(2 + i) * n + p, (n if first[j] == 1 else 0) + p] = k3 * adjacency[i, j]
