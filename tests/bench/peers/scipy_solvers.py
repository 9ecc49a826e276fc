"""SciPy's BDF, Radau and LSODA with compiled right-hand side and Jacobian, and located switches.

The steps are driven here rather than by solve_ivp, whose event functions are called one by one in Python: all
columns are watched by one compiled function, and only a change of sign starts the search on the dense output.
This favours SciPy.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from scipy.integrate import BDF, LSODA, Radau
from scipy.optimize import brentq
from scipy.sparse import csc_matrix

from tests.oracle.game import FloatArray, Game

from .hybrid_model import HybridModel, Solution

METHODS: dict[str, Any] = {"BDF": BDF, "Radau": Radau, "LSODA": LSODA}


class ScipySolver:
    """One game with fixed output times, at any tolerance."""

    def __init__(self, game: Game, times: FloatArray, method: str, *, sparse: bool = False) -> None:
        self.model = HybridModel(game)
        self.times, self.method, self.sparse = times, method, sparse
        pattern = csc_matrix(self.model.pattern())
        pattern.sort_indices()
        self.where = (pattern.indices, np.repeat(np.arange(self.model.size), np.diff(pattern.indptr)))
        self.template = pattern

    def solve(self, rtol: float) -> Solution:
        """Integrates with the absolute tolerance 0.01 rtol."""
        model = self.model
        modes = np.zeros(model.columns)
        jacobian_values = np.zeros((model.size, model.size))
        evaluations = 0

        def rate(t: float, y: FloatArray) -> FloatArray:
            nonlocal evaluations
            evaluations += 1
            out = np.empty(model.size)
            model.rate(t, y, modes, out)
            return out

        def jacobian(_t: float, y: FloatArray) -> Any:
            model.jacobian(y, modes, jacobian_values)
            if not self.sparse:
                return jacobian_values.copy()
            values = jacobian_values[self.where]
            return csc_matrix((values, self.template.indices, self.template.indptr), self.template.shape)

        times, stop = self.times, float(self.times[-1])
        states = np.empty((len(times), model.size))
        values = np.empty(model.columns)
        row = events = 0
        t, state = 0.0, model.initial_state()
        begun = time.process_time()
        while t < stop or row < len(times):
            solver = METHODS[self.method](rate, t, state, stop, rtol=rtol, atol=0.01 * rtol, jac=jacobian)
            restart = False
            while solver.status == "running" and not restart:
                message = solver.step()
                if solver.status == "failed":
                    raise ArithmeticError(f"{self.method} failed at t = {solver.t} s: {message}")
                model.events(solver.y, modes, values)
                columns = np.flatnonzero(values > 0.0)
                reached = solver.t
                interpolant = None
                if len(columns):
                    interpolant = solver.dense_output()
                    reached, column = min(
                        (self._crossing(interpolant, modes, c, solver.t_old, solver.t), c)
                        for c in columns.tolist()
                    )
                    restart = True
                last = int(np.searchsorted(times, reached, side="right"))
                if last > row:
                    interpolant = interpolant or solver.dense_output()
                    states[row:last] = interpolant(times[row:last]).T
                    row = last
                t, state = reached, solver.y
                if restart:
                    assert interpolant is not None
                    state = interpolant(reached)
                    model.switch(state, modes, column)
                    events += 1
        cpu = time.process_time() - begun
        return Solution(states, cpu, events, evaluations)

    def _crossing(
        self, interpolant: Any, modes: FloatArray, column: int, before: float, after: float
    ) -> float:
        values = np.empty(self.model.columns)

        def event(t: float) -> float:
            self.model.events(interpolant(t), modes, values)
            return float(values[column])

        if event(before) >= 0.0 or event(after) <= 0.0:
            return after
        return float(brentq(event, before, after, xtol=1e-14, rtol=1e-14))
