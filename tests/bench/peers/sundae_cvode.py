"""scikit-sundae's CVODE with compiled right-hand side and Jacobian, and its own root finding."""

from __future__ import annotations

import time
import warnings
from typing import Any

import numpy as np
from sksundae.cvode import CVODE

from tests.oracle.game import FloatArray, Game

from .hybrid_model import HybridModel, Solution


class SundaeCvode:
    """One game with fixed output times, at any tolerance."""

    def __init__(self, game: Game, times: FloatArray, *, linear_solver: str = "sparse") -> None:
        self.model = HybridModel(game)
        self.times, self.linear_solver = times, linear_solver
        self.pattern = self.model.pattern() | np.eye(self.model.size, dtype=np.bool_)
        column, row = np.nonzero(self.pattern.T)
        self.where = (row, column)

    def solve(self, rtol: float) -> Solution:
        """Integrates with the absolute tolerance 0.01 rtol."""
        model = self.model
        modes = np.zeros(model.columns)
        scratch = np.zeros((model.size, model.size))
        evaluations = 0

        def rate(t: float, y: FloatArray, out: FloatArray) -> None:
            nonlocal evaluations
            evaluations += 1
            model.rate(t, y, modes, out)

        def jacobian(_t: float, y: FloatArray, _rate: FloatArray, out: FloatArray) -> None:
            model.jacobian(y, modes, scratch)
            out[:] = scratch[self.where] if self.linear_solver == "sparse" else scratch

        def events(_t: float, y: FloatArray, out: FloatArray) -> None:
            model.events(y, modes, out)
            out[out == 0.0] = -1e-100  # CVODE stops watching a function that begins at zero

        setattr(events, "terminal", [True] * model.columns)  # noqa: B010
        setattr(events, "direction", [1] * model.columns)  # noqa: B010
        options: dict[str, Any] = {
            "rtol": rtol,
            "atol": 0.01 * rtol,
            "linsolver": self.linear_solver,
            "jacfn": jacobian,
            "eventsfn": events,
            "num_events": model.columns,
            "max_num_steps": 10**6,
        }
        if self.linear_solver == "sparse":
            options["sparsity"] = self.pattern.astype(float)
        times, stop = self.times, float(self.times[-1])
        states = np.empty((len(times), model.size))
        t, state, found = 0.0, model.initial_state(), 0
        states[0], row = state, 1
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that the given Jacobian is preferred to the difference quotient
            solver = CVODE(rate, **options)
        begun = time.process_time()
        while row < len(times):
            # two times make it return every step; more make it return at those times
            grid = np.concatenate([[t], times[row:]])
            if len(grid) == 2:
                grid = np.array([t, 0.5 * (t + stop), stop])
            solution = solver.solve(grid, state)
            if not solution.success:
                raise ArithmeticError(f"scikit-sundae stopped at {solution.t[-1]} s: {solution.message}")
            reached = float(solution.t[-1])
            stopped = reached < stop  # the list of events goes on from call to call, so it does not tell
            last = int(np.searchsorted(times, reached, side="right"))
            inside = np.isin(solution.t, times[row:last])
            states[row:last] = solution.y[inside][: last - row]
            row = last
            if not stopped:
                break
            t, state = reached, np.array(solution.y_events[-1])
            for column in np.flatnonzero(solution.i_events[-1]):
                model.switch(state, modes, int(column))
                found += 1
        cpu = time.process_time() - begun
        return Solution(states, cpu, found, evaluations)
