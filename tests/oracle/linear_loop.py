"""The loop without robust part and perturbation, linear for quadratic costs, in closed form.

Built from the paper's Kronecker expressions, y' = -k3 (L (x) I + A_0)(y - 1 (x) xbar), not from the
simulator.
State: x (N D) | z of order 1 or v of order 2 (N D) | y (N N D); s' = M s + c.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np
from scipy.linalg import expm

from .game import FloatArray, Game


def laplacian(adjacency: FloatArray) -> FloatArray:
    """L = diag(sum_j a_ij) - A. (N, N)."""
    return np.asarray(np.diag(adjacency.sum(axis=1)) - adjacency)


def gradient_coefficients(game: Game) -> FloatArray:
    """h (N, N) with grad_i f_i(x) = sum_j h_ij x_j + l_i, the same for every coordinate."""
    coupling = game.cost_coupling - np.diag(np.diag(game.cost_coupling))
    return np.asarray(2.0 * (np.diag(game.cost_quadratic) + laplacian(coupling)))


def linear_loop(game: Game, dimension: int | None = None) -> tuple[FloatArray, FloatArray]:
    """Matrix M (n, n) in 1/s and offset c (n,), n = 2 N D + N^2 D.

    dimension = 1 gives the block of one coordinate (coordinates do not interact); c is then that of l = 0.
    """
    N = game.players
    D = game.dimension if dimension is None else dimension
    first = np.diag(game.first_order.astype(float))
    second = np.eye(N) - first
    h = gradient_coefficients(game)
    # Row i of the gradient map reads player i's own estimates y_i: e_i^T (x) h_i.
    gradient = np.vstack([np.kron(np.eye(N)[i], h[i]) for i in range(N)])  # (N, N^2)
    k3 = np.repeat(np.broadcast_to(game.k3, (N, 1)), N, axis=0)  # of y_ij at i N + j
    consensus = k3 * (np.kron(laplacian(game.adjacency), np.eye(N)) + np.diag(game.adjacency.ravel()))
    everyone = np.kron(np.ones((N, 1)), np.eye(N))  # xbar -> 1 (x) xbar

    # Order 1: x' = -k1 (x - z), z' = -k2 grad.  Order 2: x' = v, v' = -k4 v - k2 k4 grad.
    x_rows = [-game.k1 * first, game.k1 * first + second, np.zeros((N, N * N))]
    gradient_gain = game.k2 * first + game.k2 * game.k4 * second
    p_rows = [np.zeros((N, N)), -game.k4 * second, -gradient_gain @ gradient]
    y_rows = [consensus @ everyone @ second, consensus @ everyone @ first, -consensus]
    matrix = np.kron(np.block([x_rows, p_rows, y_rows]), np.eye(D))

    offset = np.zeros(len(matrix))
    if D == game.dimension:
        offset[N * D : 2 * N * D] = (-gradient_gain @ game.cost_linear).ravel()
    return matrix, offset


def initial_linear_state(game: Game) -> FloatArray:
    """s(0), (2 N D + N^2 D,)."""
    p = np.where(game.first_order[:, np.newaxis], game.z0, game.v0)
    return np.concatenate([game.x0.ravel(), p.ravel(), game.y0.ravel()])


def exact_solution(game: Game, times: FloatArray) -> FloatArray:
    """s(t) at increasing times in s from t = 0, by the matrix exponential. Returns (T, n)."""
    matrix, offset = linear_loop(game)
    n = len(offset)
    augmented = np.zeros((n + 1, n + 1))
    augmented[:n, :n], augmented[:n, n] = matrix, offset
    state = np.append(initial_linear_state(game), 1.0)
    solution = np.empty((len(times), n))
    before, step, propagator = 0.0, 0.0, np.eye(n + 1)
    for row, t in enumerate(times):
        if abs((t - before) - step) > 1e-15 * t:
            step = t - before
            propagator = expm(augmented * step)
        state = propagator @ state
        solution[row] = state[:n]
        before = t
    return solution


def spectral_abscissa(game: Game) -> float:
    """Largest real part of the eigenvalues of M, in 1/s; negative means exponentially stable."""
    matrix, _ = linear_loop(game, dimension=1)
    return float(np.max(np.linalg.eigvals(matrix).real))


def connected_graphs(N: int) -> Iterator[FloatArray]:
    """Adjacency matrices of all connected graphs on N labelled vertices (728 for N = 5)."""
    edges = list(combinations(range(N), 2))
    for chosen in range(1 << len(edges)):
        adjacency = np.zeros((N, N))
        for bit, (i, j) in enumerate(edges):
            if chosen >> bit & 1:
                adjacency[i, j] = adjacency[j, i] = 1.0
        if np.all(np.linalg.matrix_power(adjacency + np.eye(N), N - 1) > 0.0):
            yield adjacency
