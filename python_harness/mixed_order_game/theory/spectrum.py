"""The loop of Theorem 2 (no unknown dynamics, no disturbance, no robust part): linear for quadratic costs.

s' = M s + c with s = (x | z of order 1, v of order 2 | y), from the paper's equations

    x_i' = -k1 (x_i - z_i),  z_i' = -k2 grad_i f_i(y_i)                     order 1
    x_i' = v_i,              v_i' = -k4 v_i - k2 k4 grad_i f_i(y_i)         order 2
    y_ij' = -k3 (sum_k a_ik (y_ij - y_kj) + a_ij (y_ij - xbar_j)),          xbar = z (order 1), x (order 2)
    grad_i f_i(x) = 2 q_i x_i + l_i + 2 sum_j c_ij (x_i - x_j).

Coordinates do not interact and share one matrix, so everything here is that of one coordinate: M is (n, n)
with n = 2 N + N^2, states of several coordinates are columns. Entry N + i is z_i or v_i, entry
2 N + i N + j is y_ij.
"""

import numpy as np
from numpy.typing import NDArray

from ..errors import GameError
from ..game.definition import has_expressions, require_coefficients
from ..game.parameters import GameParameters

FloatArray = NDArray[np.float64]

ROUNDING = 1e-12
"""Part of a player's largest second derivative below which a negative one is taken for rounding."""

SINGULAR = 1e-13
"""Reciprocal condition number, of balanced rows and columns, below which a matrix counts as singular."""

SWEEPS, BALANCED = 100, 0.1


def gradient_map(game: GameParameters) -> FloatArray:
    """h (N, N) with grad_i f_i(x) = sum_j h_ij x_j + l_i.

    Raises GameError for a cost with an expression.
    """
    require_coefficients(game.expressions, "the linear map of the gradients", "cost")
    coupling = game.cost_coupling - np.diag(np.diag(game.cost_coupling))
    return np.asarray(2.0 * (np.diag(game.cost_quadratic + coupling.sum(axis=1)) - coupling))


def monotonicity_constant(game: GameParameters) -> float:
    """m of the paper's Assumption 3: smallest eigenvalue of the symmetric part of h."""
    h = gradient_map(game)
    return float(np.linalg.eigvalsh(0.5 * (h + h.T))[0])


def nash_equilibrium(game: GameParameters) -> FloatArray:
    """x* (N, D) with h x* + l = 0, where no player can lower its cost.

    Raises GameError, as the build of an FMU does, if h is singular whatever the units of its rows and
    columns, or a player's cost is concave in its own action. Where a cost has an
    expression, x* is that of the FMU, and GameError is raised if it was not taken from there.
    """
    if has_expressions(game.expressions, "cost") and game.x_star is not None:
        return game.x_star
    h = gradient_map(game)
    curvature = np.diag(h)
    concave = np.flatnonzero(curvature < -ROUNDING * np.abs(h).max(axis=1))
    if concave.size:
        i = int(concave[0])
        raise GameError(
            f"player[{i + 1}].cost is concave in the player's own action "
            f"(second derivative {curvature[i]:g}), expected one of at least 0: where all gradients vanish, "
            f"player {i + 1} can lower its cost, and that is no Nash equilibrium"
        )
    row, column = _balance(h)
    balanced = row[:, np.newaxis] * h * column
    if not np.linalg.cond(balanced, 1) < 1.0 / SINGULAR:
        raise GameError("the game has no unique Nash equilibrium: the map of its gradients is singular")
    x_star = column[:, np.newaxis] * np.linalg.solve(balanced, row[:, np.newaxis] * -game.cost_linear)
    return np.asarray(x_star, dtype=np.float64)


def _balance(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Factors (N,) of rows and columns that make magnitudes in each add up to about 1 (Sinkhorn, Knopp)."""
    magnitude = np.abs(matrix)
    row, column = np.ones(len(matrix)), np.ones(len(matrix))
    for _ in range(SWEEPS):
        factor = _inverse(magnitude.sum(axis=1))
        row, magnitude = row * factor, magnitude * factor[:, np.newaxis]
        factor = _inverse(magnitude.sum(axis=0))
        column, magnitude = column * factor, magnitude * factor
        if np.abs(magnitude.sum(axis=1) - 1.0).max() <= BALANCED:
            break
    return row, column


def _inverse(sums: FloatArray) -> FloatArray:
    return np.where(sums > 0.0, 1.0 / np.where(sums > 0.0, sums, 1.0), 1.0)


def owners(game: GameParameters) -> NDArray[np.int_]:
    """The player of each action of `linear_loop`: N actions where coordinates are alike, else N D."""
    n = game.players if game.jacobian is None else len(game.jacobian)
    return np.arange(n) // (n // game.players)


def linear_loop(game: GameParameters) -> FloatArray:
    """M (n, n) in 1/s.

    Of costs with expressions that of the loop linearized at x*, from their Jacobian there. Then coordinates
    may interact: M is of all N D actions, by player, then by coordinate.
    """
    N = game.players
    h = gradient_map(game) if game.jacobian is None else game.jacobian
    of = owners(game)
    n = len(h)
    matrix = np.zeros((2 * n + N * n, 2 * n + N * n))
    degree = game.adjacency.sum(axis=1)
    k, k2, k3 = game.regulation, game.of_players("k2"), game.of_players("k3")
    for a in range(n):
        i = int(of[a])
        x, p, y = a, n + a, 2 * n + i * n
        if game.order[i] == 1:
            matrix[x, [x, p]] = -k[i], k[i]
            matrix[p, y : y + n] = -k2[i] * h[a]
        else:
            matrix[x, p] = 1.0
            matrix[p, p] = -k[i]
            matrix[p, y : y + n] = -k2[i] * k[i] * h[a]
    for i in range(N):
        for b in range(n):
            j, y = int(of[b]), 2 * n + i * n + b
            shared = n + b if game.order[j] == 1 else b  # xbar_j
            matrix[y, y] -= k3[i] * (degree[i] + game.adjacency[i, j])
            matrix[y, 2 * n + np.arange(N) * n + b] += k3[i] * game.adjacency[i]
            matrix[y, shared] += k3[i] * game.adjacency[i, j]
    return matrix


def spectral_abscissa(matrix: FloatArray) -> float:
    """Largest real part of the eigenvalues, in 1/s; negative means exponentially stable."""
    return float(np.max(np.linalg.eigvals(matrix).real))


def consensus_rate(game: GameParameters) -> float:
    """Least real part of the eigenvalues of K3 (L (x) I + A_0), in 1/s: the slowest rate of agreement.

    The matrix splits into the N blocks L + diag(a_1j, ..., a_Nj) of the estimates of player j, rows times k3.
    Its eigenvalues are real for an undirected graph, where it is similar to K3^1/2 (L (x) I + A_0) K3^1/2.
    """
    laplacian = np.diag(game.adjacency.sum(axis=1)) - game.adjacency
    blocks = laplacian + np.array([np.diag(column) for column in game.adjacency.T])
    k3 = game.of_players("k3")
    if game.directed:
        return float(np.linalg.eigvals(k3[:, np.newaxis] * blocks).real.min())
    root = np.sqrt(k3)
    return float(np.linalg.eigvalsh(root[:, np.newaxis] * blocks * root).min())


def initial_deviation(game: GameParameters) -> FloatArray:
    """s(0) - s* (n, D), or (n, 1) with all coordinates in turn, for the states of `linear_loop`.

    s* has x = z = x*, v = 0 and every estimate right.
    """
    N, D = game.players, game.dimension
    x_star = nash_equilibrium(game)
    first = game.first_order[:, np.newaxis]
    p = np.where(first, game.z0 - x_star, game.v0)
    y = game.y0 - x_star
    if game.jacobian is not None:
        return np.concatenate([(game.x0 - x_star).ravel(), p.ravel(), y.ravel()])[:, np.newaxis]
    return np.vstack([game.x0 - x_star, p, y.reshape(N * N, D)])


def predicted_deviation(game: GameParameters, stop: float, intervals: int) -> tuple[FloatArray, FloatArray]:
    """Exact x(t) - x* by the matrix exponential, at equally spaced times from 0 to stop, in s.

    Returns times (T,) and deviations (T, N, D), T = intervals + 1.
    """
    from scipy.linalg import expm

    step = stop / intervals
    propagator = expm(linear_loop(game) * step)
    state = initial_deviation(game)
    actions = len(owners(game))
    deviations = np.empty((intervals + 1, game.players, game.dimension))
    for k in range(intervals + 1):
        deviations[k] = state[:actions].reshape(deviations.shape[1:])
        state = propagator @ state
    return np.linspace(0.0, stop, intervals + 1), deviations


def decay_rate(times: FloatArray, errors: FloatArray) -> float:
    """Rate in 1/s of the exponential that fits errors (T,) at times (T,): minus the slope of log(errors)."""
    return -float(np.polyfit(times, np.log(errors), 1)[0])
