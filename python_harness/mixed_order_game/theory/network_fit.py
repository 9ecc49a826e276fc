"""How well the RBF network can stand for the unknown dynamics: W* with W*'W* <= W_max and its residual."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, linprog

from .game import AnalysedGame
from .spectrum import nash_equilibrium

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class NetworkFit:
    """W* and what it leaves, over the points that it was judged on; residuals in the unit of g."""

    weights: FloatArray  # (N, q, D)
    residual: FloatArray  # (N, D), largest |g_il - W*'S| found
    dynamics: FloatArray  # (N, D), largest |g_il| there: the residual of W* = 0
    points: int

    @property
    def weight_norm2(self) -> FloatArray:
        """W*'W* per column, (N, D)."""
        return np.asarray(np.sum(self.weights**2, axis=1))


def activations(game: AnalysedGame, y: FloatArray) -> FloatArray:
    """S_m(y_i) = exp(-|y_i - mu_m|^2 / rho^2) for y (T, N D); returns (T, q)."""
    squares = (
        np.sum(y * y, axis=1)[:, np.newaxis] - 2.0 * y @ game.centers.T + np.sum(game.centers**2, axis=1)
    )
    return np.asarray(np.exp(-squares / game.width**2))


def ball_points(game: AnalysedGame, radius: float, count: int, seed: int) -> FloatArray:
    """Points (count, N D) of the ball about x*: uniform directions, radii uniform in [0, radius].

    The centre is denser than under the volume's measure, in which nearly all points of a ball in many
    dimensions lie next to the sphere.
    """
    random = np.random.default_rng(seed)
    x_star = nash_equilibrium(game.parameters).ravel()
    directions = random.standard_normal((count, x_star.size))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.asarray(x_star + radius * random.uniform(size=(count, 1)) * directions)


def least_squares_fit(
    game: AnalysedGame, radius: float, *, W_max: float, count: int = 4000, seed: int = 0
) -> NetworkFit:
    """W* by least squares on a ball |y_i - x*| <= radius under W*'W* <= W_max, judged on other points of it.

    min |S w - g|^2 with w'w <= W_max: w = (S'S + mu I)^-1 S'g with the smallest mu >= 0 that is admissible
    (the secular equation, by the singular values of S). The residual found on points is a lower bound of the
    largest one on the ball; the certificates do not rest on it.
    """
    p = game.parameters
    y, judged = (ball_points(game, radius, count, seed + k) for k in (0, 1))
    U, sigma, Vt = np.linalg.svd(activations(game, y), full_matrices=False)
    S = activations(game, judged)
    dynamics, judged_dynamics = _dynamics(game, y), _dynamics(game, judged)
    weights = np.zeros((p.players, len(game.centers), p.dimension))
    for i in range(p.players):
        for column in range(p.dimension):
            weights[i, :, column] = Vt.T @ _bounded(sigma, U.T @ dynamics[:, i, column], W_max)
    residual = np.abs(judged_dynamics - np.einsum("tm,iml->til", S, weights)).max(axis=0)
    return NetworkFit(weights, residual, np.abs(judged_dynamics).max(axis=0), count)


def _bounded(sigma: FloatArray, target: FloatArray, W_max: float) -> FloatArray:
    """sigma target / (sigma^2 + mu) with the smallest mu >= 0 for which its square norm is at most W_max."""

    def solution(mu: float) -> FloatArray:
        denominator = sigma**2 + mu
        return np.divide(sigma * target, denominator, out=np.zeros_like(sigma), where=denominator > 0.0)

    def excess(log_mu: float) -> float:
        return float(np.sum(solution(float(np.exp(log_mu))) ** 2)) - W_max

    floor = np.log(max(float(sigma[0]), 1e-300) ** 2) - 60.0
    if excess(floor) <= 0.0:
        return solution(float(np.exp(floor)))
    high = floor + 1.0
    while excess(high) > 0.0:
        high += 10.0
    mu = float(np.exp(brentq(excess, floor, high)))
    found = solution(mu)
    norm2 = float(np.sum(found**2))
    return found * min(1.0, np.sqrt(W_max / norm2)) if norm2 > 0.0 else found


def trajectory_fit(game: AnalysedGame, x: FloatArray, y: FloatArray, *, W_max: float) -> NetworkFit:
    """W* with the smallest largest |g_il(y_i(t)) - W*'S(y_i(t))| over samples y (T, N, N, D) of one run.

    A linear programme per column: min r, -r <= S w - g <= r, |w_m| <= sqrt(W_max / q), which keeps w'w <=
    W_max (and leaves a little of that ball unused). The proof of Theorem 1 needs the residual only along
    the trajectory, so this is what delta has to be there, up to samples and box. With q times W_max the box
    holds the whole ball w'w <= W_max, and the residual is a lower bound for every admissible W*. x
    tells the number of samples.
    """
    p = game.parameters
    T, N, D, q = len(x), p.players, p.dimension, len(game.centers)
    weights = np.zeros((N, q, D))
    residual, dynamics = np.zeros((N, D)), np.zeros((N, D))
    box = float(np.sqrt(W_max / q))
    for i in range(N):
        S = activations(game, y[:, i].reshape(T, -1))
        g = _dynamics(game, y[:, i].reshape(T, -1))[:, i]
        for column in range(D):
            ones = np.ones((T, 1))
            rows = np.vstack([np.hstack([S, -ones]), np.hstack([-S, -ones])])
            found = linprog(
                np.append(np.zeros(q), 1.0),
                A_ub=rows,
                b_ub=np.concatenate([g[:, column], -g[:, column]]),
                bounds=[(-box, box)] * q + [(0.0, None)],
            )
            if found.x is not None:
                weights[i, :, column] = found.x[:q]
            residual[i, column] = np.abs(g[:, column] - S @ weights[i, :, column]).max()
            dynamics[i, column] = np.abs(g[:, column]).max()
    return NetworkFit(weights, residual, dynamics, T)


def mirror_bound(game: AnalysedGame, radius: float) -> FloatArray:
    """A lower bound (N, D) of max |g_il - w'S| over |y_i - x*| <= radius for every w: what cannot be learnt.

    Let U be the affine hull of the centres, u its point nearest x*, and n a unit vector normal to U. The
    two points u + s n and u - s n have the same distance to every centre, hence the same S, whatever the
    width, and both lie in the ball for s = radius - |x* - u|. So max |g - w'S| is at least half of |g(u + s
    n) - g(u - s n)|, which is s |slope . n| with slope = G + 2 H u (the squares cancel); n along the
    slope's normal part is the best. The centres of the paper's example lie on one line, so U is a line and
    nearly everything is normal to it.
    """
    p = game.parameters
    x_star = nash_equilibrium(p).ravel()
    base = game.centers[0]
    spread = (game.centers[1:] - base).T
    if spread.size:
        basis, sigma, _ = np.linalg.svd(spread, full_matrices=False)
        Q = basis[:, sigma > 1e-12 * max(float(sigma[0]), 1e-300)]
    else:
        Q = np.zeros((x_star.size, 0))
    u = base + Q @ (Q.T @ (x_star - base))
    reach = max(0.0, radius - float(np.linalg.norm(x_star - u)))
    slope = p.dynamics_linear + 2.0 * p.dynamics_square * u.reshape(1, p.players, p.dimension)
    bound = np.zeros((p.players, p.dimension))
    for column in range(p.dimension):
        gradient = np.zeros((p.players, p.players, p.dimension))
        gradient[:, :, column] = slope[:, :, column]
        flat = gradient.reshape(p.players, -1)
        normal = flat - (flat @ Q) @ Q.T
        bound[:, column] = reach * np.linalg.norm(normal, axis=1)
    return bound


def _dynamics(game: AnalysedGame, y: FloatArray) -> FloatArray:
    """g_il at points y (T, N D); returns (T, N, D)."""
    p = game.parameters
    points = y.reshape(len(y), p.players, p.dimension)
    linear = np.einsum("ijl,tjl->til", p.dynamics_linear, points)
    return np.asarray(linear + np.einsum("ijl,tjl->til", p.dynamics_square, points**2))
