"""General games in CasADi's CVODES, as its users would write them: SX expressions, exact sparse Jacobian.

Costs, dynamics and disturbances are the hand-typed functions of tests/games_by_hand.py on arrays of symbols.
The activations come from the sums of y and y^2, which all centres share, and common subexpressions are
evaluated once. The weights stay below their bounds in these games, so that nothing switches.
"""

from __future__ import annotations

import time
from typing import Any

import casadi as ca
import numpy as np

from tests.oracle.game import FloatArray
from tests.oracle.general_loop import GeneralLoop
from tests.oracle.paper_equations import ROBUST_CONSTANT

from .hybrid_model import Solution


def array_of(symbols: Any, *shape: int) -> Any:
    """The elements of a column of symbols, the last index fastest."""
    array = np.empty(shape, dtype=object)
    array.flat[:] = symbols.elements()
    return array


def symbolic_loop(loop: GeneralLoop) -> dict[str, Any]:
    """Time t, state x and rates ode as CasADi expressions; state laid out as in GeneralLoop."""
    N, D, q, gains = loop.N, loop.D, len(loop.centers), loop.gains
    n = N * D
    t, state = ca.SX.sym("t"), ca.SX.sym("x", loop.initial_state().size)
    x, p = array_of(state[:n], N, D), array_of(state[n : 2 * n], N, D)
    seen = [state[(2 + i) * n : (3 + i) * n] for i in range(N)]
    y = array_of(state[2 * n : (2 + N) * n], N, N, D)
    W = array_of(state[(2 + N) * n :], N, q, D)
    costs = loop.functions.costs(y)
    v = np.where(loop.first[:, np.newaxis], x * 0.0, p)
    g, d = loop.functions.dynamics(x, v), loop.functions.disturbances(array_of(t, 1, 1))
    driven, reference, y_rate = x * 0.0, x * 0.0, y * 0.0
    W_rate = W * 0.0
    for i in range(N):
        gradient = ca.gradient(costs[i], seen[i][i * D : (i + 1) * D])
        total, squares = ca.sum1(seen[i]), ca.sumsqr(seen[i])
        S = [ca.exp(-(squares - 2.0 * c * total + n * c * c) / loop.width**2) for c in loop.centers[:, 0]]
        for k in range(D):
            first = loop.first[i]
            e = x[i, k] - p[i, k] if first else p[i, k] + gains["k2"] * gradient[k]
            network = sum(W[i, m, k] * S[m] for m in range(q))
            phi = gains["delta"] * ca.tanh(ROBUST_CONSTANT * gains["delta"] / gains["epsilon"] * e)
            u = -(gains["k1"] if first else gains["k4"]) * e - network - phi
            driven[i, k] = u + g[i, k] + d[i, k]
            reference[i, k] = -gains["k2"] * gradient[k]
            for m in range(q):
                W_rate[i, m, k] = gains["beta"] * S[m] * e
            for j in range(N):
                shared = p[j, k] if loop.first[j] else x[j, k]
                apart = [
                    loop.adjacency[i, h] * (y[i, j, k] - y[h, j, k]) for h in range(N) if loop.adjacency[i, h]
                ]
                if loop.adjacency[i, j]:
                    apart.append(loop.adjacency[i, j] * (y[i, j, k] - shared))
                y_rate[i, j, k] = -gains["k3"] * sum(apart)
    is_first = loop.first[:, np.newaxis]
    parts = (np.where(is_first, driven, p), np.where(is_first, reference, driven), y_rate, W_rate)
    rates = ca.vertcat(*[rate for part in parts for rate in part.ravel()])
    return {"t": t, "x": state, "ode": ca.cse(rates)}


class CasadiGeneral:
    """One game at one tolerance with fixed output times from 0 on."""

    def __init__(self, loop: GeneralLoop, times: FloatArray, rtol: float, linear_solver: str) -> None:
        options = {
            "reltol": rtol,
            "abstol": 0.01 * rtol,
            "max_num_steps": 10**6,
            "linear_solver": linear_solver,
        }
        self.start = loop.initial_state()
        later = [float(t) for t in times[1:]]
        self.integrator = ca.integrator("loop", "cvodes", symbolic_loop(loop), 0.0, later, options)

    def solve(self) -> Solution:
        """Integrates; CPU time is that of the integrator's call."""
        begun = time.process_time()
        found = np.asarray(self.integrator(x0=self.start)["xf"])
        cpu = time.process_time() - begun
        return Solution(np.vstack([self.start, found.T]), cpu, 0)
