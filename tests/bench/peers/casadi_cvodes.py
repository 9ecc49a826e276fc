"""CasADi's CVODES with its exact sparse Jacobian.

CasADi locates no events here: its own detection, marked experimental in 3.8, ends in an error of CVODES. A
user therefore writes the projection's condition into the rates (`if_else`) and lets the integrator find its
way across the switches. As the best case that nobody has outside a benchmark, the run can instead be told
the switch times: the modes enter as parameters, the run is cut at the switches, and locating them costs
nothing. Each piece is an integrator of its own, made and with jit compiled before the clock starts. The
activations come from the sums of y and y^2, which all centres share. The linear solver is CasADi's default,
qr, unless another is named; csparse takes more than twice its time here.
"""

from __future__ import annotations

import itertools
import os
import tempfile
import time
from typing import Any

import casadi as ca
import numpy as np

from tests.oracle.game import FloatArray, Game
from tests.oracle.paper_equations import ROBUST_CONSTANT

from .hybrid_model import HybridModel, Solution, rows_of

Switches = list[tuple[float, int]]  # time in s and weight column, in order


def with_modes_inside(game: Game, dae: dict[str, Any]) -> dict[str, Any]:
    """The loop whose columns are on the sphere where w'w >= W_max and e w'S >= 0, without mode parameters."""
    n = game.players * game.dimension
    first = (2 + game.players) * n  # of the weights
    rows = [slice(first + m * n, first + (m + 1) * n) for m in range(game.neurons)]
    inside = ca.substitute(dae["ode"], dae["p"], ca.SX.zeros(n))
    squares = sum(dae["x"][row] ** 2 for row in rows)
    outward = sum(dae["x"][row] * inside[row] for row in rows)  # beta e w'S
    modes = ca.if_else(ca.logic_and(squares >= game.W_max, outward >= 0.0), 1.0, 0.0)
    return {"t": dae["t"], "x": dae["x"], "ode": ca.substitute(dae["ode"], dae["p"], modes)}


def symbolic_loop(game: Game) -> dict[str, Any]:
    """Time t, state x, modes p and rates ode as CasADi expressions; state laid out as in HybridModel."""
    N, D, q = game.players, game.dimension, game.neurons
    n = N * D
    t, state, modes = ca.SX.sym("t"), ca.SX.sym("x", (2 + N + q) * n), ca.SX.sym("p", n)
    x, p = state[:n], state[n : 2 * n]
    y = [state[(2 + i) * n : (3 + i) * n] for i in range(N)]
    W = [state[(2 + N + m) * n : (3 + N + m) * n] for m in range(q)]
    linear = rows_of(game.cost_linear)
    wave = [
        rows_of(part)
        for part in (
            game.disturbance_bias,
            game.disturbance_amplitude,
            game.disturbance_frequency,
            game.disturbance_phase,
        )
    ]
    S: list[list[Any]] = []
    for i in range(N):
        total, squares = ca.sum1(y[i]), ca.sumsqr(y[i])
        distances = [squares - 2.0 * c * total + n * c * c for c in game.centers[:, 0]]
        S.append([ca.exp(-distance / game.width**2) for distance in distances])
    xbar = [p[k] if game.first_order[k % N] else x[k] for k in range(n)]
    x_rate: list[Any] = [None] * n
    p_rate: list[Any] = [None] * n
    W_rate: list[list[Any]] = [[None] * n for _ in range(q)]
    for i in range(N):
        for coordinate in range(D):
            k = coordinate * N + i
            gradient = 2.0 * game.cost_quadratic[i] * y[i][k] + linear[k]
            g = 0.0
            for j in range(N):
                other = coordinate * N + j
                if game.cost_coupling[i, j] != 0.0:
                    gradient += 2.0 * game.cost_coupling[i, j] * (y[i][k] - y[i][other])
                G, H = game.dynamics_linear[i, j, coordinate], game.dynamics_square[i, j, coordinate]
                if G != 0.0 or H != 0.0:
                    g += (G + H * x[other]) * x[other]
            first = game.first_order[i]
            e = x[k] - p[k] if first else p[k] + game.k2 * gradient
            nn = sum(W[m][k] * S[i][m] for m in range(q))
            phi = game.delta * ca.tanh(ROBUST_CONSTANT * game.delta / game.epsilon * e)
            bias, amplitude, frequency, phase = (part[k] for part in wave)
            d = bias + amplitude * ca.sin(frequency * t + phase)
            driven = -(game.k1 if first else game.k4) * e - nn - phi + g + d
            x_rate[k] = driven if first else p[k]
            p_rate[k] = -game.k2 * gradient if first else driven
            r = modes[k] * nn / game.W_max
            for m in range(q):
                W_rate[m][k] = game.beta * e * (S[i][m] - r * W[m][k])
    y_rate = []
    for i in range(N):
        for k in range(n):
            sum_ = game.adjacency[i, k % N] * (y[i][k] - xbar[k]) if game.adjacency[i, k % N] else 0.0
            for j in range(N):
                if game.adjacency[i, j] != 0.0:
                    sum_ += game.adjacency[i, j] * (y[i][k] - y[j][k])
            y_rate.append(-game.k3 * sum_)
    rates = ca.vertcat(*x_rate, *p_rate, *y_rate, *[rate for row in W_rate for rate in row])
    return {"t": t, "x": state, "p": modes, "ode": rates}


class CasadiCvodes:
    """One game with fixed output times, at any tolerance: told the switches, or the modes in its rates."""

    def __init__(
        self,
        game: Game,
        times: FloatArray,
        switches: Switches | None = None,
        *,
        jit: bool = False,
        linear_solver: str = "qr",
    ) -> None:
        self.model = HybridModel(game)
        self.times, self.switches = times, switches or []
        self.linear_solver, self.jit = linear_solver, jit
        self.dae = symbolic_loop(game)
        if switches is None:
            self.dae = with_modes_inside(game, self.dae)
        self.pieces: dict[float, list[tuple[Any, slice]]] = {}

    def prepare(self, rtol: float) -> None:
        """Builds the integrators of one tolerance."""
        if rtol in self.pieces:
            return
        options: dict[str, Any] = {"reltol": rtol, "abstol": 0.01 * rtol, "max_num_steps": 10**6}
        options["linear_solver"] = self.linear_solver
        if self.jit:
            options |= {
                "jit": True,
                "compiler": "shell",
                "jit_options": {"compiler": "gcc", "flags": ["-O2", "-march=native"], "verbose": False},
                "jit_temp_suffix": True,
                "jit_cleanup": False,  # the folder goes as a whole
            }
        edges = [0.0, *[when for when, _ in self.switches], float(self.times[-1])]
        pieces = []
        here = os.getcwd()
        with tempfile.TemporaryDirectory() as folder:
            os.chdir(folder)  # CasADi compiles in the present directory
            try:
                for number, (start, stop) in enumerate(itertools.pairwise(edges)):
                    inside = (self.times > start) & (self.times < stop)
                    where = np.flatnonzero(inside)
                    first = int(where[0]) if len(where) else 0
                    grid = [*self.times[inside], stop]
                    integrator = ca.integrator(f"piece_{number}", "cvodes", self.dae, start, grid, options)
                    pieces.append((integrator, slice(first, first + len(where))))
            finally:
                os.chdir(here)
        self.pieces[rtol] = pieces

    def solve(self, rtol: float) -> Solution:
        """Integrates; CPU time is that of the integrators' calls and the projection between them."""
        self.prepare(rtol)
        state = self.model.initial_state()
        modes = np.zeros(self.model.columns)
        states = np.empty((len(self.times), self.model.size))
        states[0] = state
        begun = time.process_time()
        for number, (integrator, rows) in enumerate(self.pieces[rtol]):
            told = {"p": modes} if self.switches else {}
            result = np.asarray(integrator(x0=state, **told)["xf"])
            states[rows] = result[:, :-1].T
            state = result[:, -1].copy()
            if number < len(self.switches):
                column = self.switches[number][1]
                modes[column] = 1.0 - modes[column]
                self.model.project(state, modes)
        states[-1] = state
        cpu = time.process_time() - begun
        return Solution(states, cpu, len(self.switches))
