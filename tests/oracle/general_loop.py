"""The closed loop of a game whose costs, unknown dynamics and disturbances are Python functions.

The numbers of the game (gains, graph, orders, initial values) come from its file by tomllib; what the file
has as expressions is not read, the functions stand for it. Gradients are complex steps, exact to rounding.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import root

from . import paper_equations as paper
from .paper_equations import Numbers

FloatArray = NDArray[np.float64]
STEP = 1e-30  # of complex steps: nothing is subtracted, so it may be as small as it likes


@dataclass(frozen=True)
class Functions:
    """What a game consists of. N players, D coordinates."""

    costs: Callable[[Numbers], Numbers]
    """f_i at what player i sees: of x (..., N, N, D), where x[..., i, j, l] is x_jl as i sees it; (..., N)"""
    dynamics: Callable[[Numbers, Numbers], Numbers]
    """g_i, of x and v (N, D); (N, D)"""
    disturbances: Callable[[float], Numbers]
    """d_i, of t in s; (N, D)"""
    jumps: Sequence[float] = ()
    """the times in s at which the disturbances jump"""


def own(x: Numbers) -> Numbers:
    """What each player sees of itself: of x (..., N, N, D); (..., N, D)."""
    players = np.arange(x.shape[-2])
    return x[..., players, players, :]


def own_gradients(costs: Callable[[Numbers], Numbers], y: FloatArray) -> FloatArray:
    """grad_i f_i(y_i). y (N, N, D); (N, D)."""
    N, _, D = y.shape
    shifted = np.broadcast_to(y, (D, N, N, D)).astype(np.complex128)
    for coordinate in range(D):
        shifted[coordinate, np.arange(N), np.arange(N), coordinate] += 1j * STEP
    return np.asarray(costs(shifted).imag.T / STEP)


def equilibrium(costs: Callable[[Numbers], Numbers], start: FloatArray) -> FloatArray:
    """Where all own gradients vanish, by SciPy's root from start (N, D)."""
    N, D = start.shape

    def pseudo_gradient(x: FloatArray) -> FloatArray:
        return own_gradients(costs, np.broadcast_to(x.reshape(N, D), (N, N, D))).ravel()

    found = root(pseudo_gradient, start.ravel(), tol=1e-14)
    size = np.abs(found.fun).max()
    if not size < 1e-10:
        raise ArithmeticError(f"no equilibrium was found: {found.message}, gradients of {size:.1e}")
    return np.asarray(found.x.reshape(N, D))


class GeneralLoop:
    """Right-hand side and solution.

    State: x (N D) | z of order 1 or v of order 2 (N D) | y (N N D) | W (N q D).
    """

    def __init__(self, tables: dict[str, Any], functions: Functions) -> None:
        defaults = tables.get("defaults", {})
        players = [defaults | player for player in tables["player"]]
        self.functions = functions
        self.gains = tables["gains"]
        self.N, self.D = len(players), int(tables["dimension"])
        self.first = np.array([player["order"] == 1 for player in players])
        self.width, self.W_max = tables["rbf"]["width"], tables["rbf"]["W_max"]
        self.centers = np.array(
            [np.broadcast_to(center, self.N * self.D) for center in tables["rbf"]["centers"]], dtype=float
        )
        self.adjacency = np.zeros((self.N, self.N))
        for edge in tables["graph"]["edges"]:
            weight = edge[2] if len(edge) > 2 else 1.0
            self.adjacency[edge[0] - 1, edge[1] - 1] = self.adjacency[edge[1] - 1, edge[0] - 1] = weight
        self.x0 = np.array([np.broadcast_to(player["x0"], self.D) for player in players], dtype=float)
        if not all(player["y0"] == "x0" and player["z0"] == "x0" for player in players):
            raise ValueError("estimates and references are expected to begin at x0")

    def initial_state(self) -> FloatArray:
        p = np.where(self.first[:, np.newaxis], self.x0, 0.0)
        y = np.broadcast_to(self.x0, (self.N, self.N, self.D))
        W = np.zeros(self.N * len(self.centers) * self.D)
        return np.concatenate([self.x0.ravel(), p.ravel(), y.ravel(), W])

    def unpack(self, states: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """x and z or v (..., N, D), y (..., N, N, D), W (..., N, q, D) of states (..., n)."""
        N, D, n = self.N, self.D, self.N * self.D
        parts = np.split(states, [n, 2 * n, 2 * n + N * n], axis=-1)
        shapes = [(N, D), (N, D), (N, N, D), (N, len(self.centers), D)]
        x, p, y, W = (
            part.reshape(*states.shape[:-1], *shape) for part, shape in zip(parts, shapes, strict=True)
        )
        return x, p, y, W

    def rate(self, t: float, state: FloatArray) -> FloatArray:
        x, p, y, W = self.unpack(state)
        gains, first = self.gains, self.first[:, np.newaxis]
        gradient = own_gradients(self.functions.costs, y)
        e = np.where(
            first,
            paper.seeking_error_first_order(x, p),
            paper.seeking_error_second_order(gains["k2"], gradient, p),
        )
        S = paper.rbf_activation(y.reshape(self.N, -1), self.centers, self.width)
        phi = paper.robust_term(gains["delta"], gains["epsilon"], e)
        u = -np.where(first, gains["k1"], gains["k4"]) * e - paper.network_output(W, S) - phi
        v = np.where(first, 0.0, p)
        driven = u + self.functions.dynamics(x, v) + self.functions.disturbances(t)
        shared = paper.shared_signal(self.first, x, p)
        column_rate = paper.adaptation_inside(gains["beta"], S[:, np.newaxis, :], e)
        return np.concatenate(
            [
                np.where(first, driven, p).ravel(),
                np.where(first, paper.reference_rate(gains["k2"], gradient), driven).ravel(),
                paper.estimate_rate(gains["k3"], self.adjacency, y, shared).ravel(),
                column_rate.transpose(0, 2, 1).ravel(),
            ]
        )

    def _rate_until(self, last: float) -> Callable[[float, FloatArray], FloatArray]:
        return lambda t, state: self.rate(min(t, last), state)

    def solve(self, times: FloatArray, rtol: float = 1e-9, atol: float = 1e-10) -> FloatArray:
        """States (T, n) at times (T,) in s from 0 on; the integration begins anew where disturbances jump.

        Raises ArithmeticError if the integrator gives up, or a weight column reaches its bound, which is not
        served.
        """
        states = [self.initial_state()[np.newaxis]]
        ends = [each for each in sorted({*self.functions.jumps}) if 0.0 < each < times[-1]] + [
            float(times[-1])
        ]
        start, state = 0.0, states[0][0]
        for end in ends:
            within = times[(times > start) & (times <= end)]
            found = solve_ivp(
                self._rate_until(float(np.nextafter(end, start))),  # before disturbances jump
                (start, end),
                state,
                "DOP853",
                np.union1d(within, [end]),
                rtol=rtol,
                atol=atol,
            )
            if not found.success:
                raise ArithmeticError(found.message)
            states.append(found.y.T[: len(within)])
            start, state = end, found.y[:, -1]
        solution = np.concatenate(states)[0 if times[0] == 0.0 else 1 :]
        W = self.unpack(solution)[3]
        if np.sum(W**2, axis=-2).max() >= self.W_max:
            raise ArithmeticError("a weight column reaches its bound")
        return solution
