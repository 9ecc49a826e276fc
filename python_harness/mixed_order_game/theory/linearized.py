"""The unperturbed loop of any game linearized at x*, from the FMU's directional derivatives.

delta' = M delta, delta = (x - x* | z - x* of order 1 | v of order 2 | y_ij - x*_j), without the robust part
and without perturbations. For quadratic costs this is the loop itself; otherwise it tells of a neighbourhood
of x* alone, whose size it does not tell.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import ModelError, SimulationError
from ..fmu.model import Model, Value
from ..fmu.run import Simulator

FloatArray = NDArray[np.float64]

LARGEST = 1000
"""Most states, (2 + N) N D, for which M is set up."""


@dataclass(frozen=True, eq=False)
class LinearizedLoop:
    """M (n, n) in 1/s, its states by name in turn, and the equilibrium (N, D) that it belongs to."""

    states: tuple[str, ...]
    matrix: FloatArray
    x_star: FloatArray

    @property
    def abscissa(self) -> float:
        """Largest real part of the eigenvalues, in 1/s; 0 where rounding alone tells it from 0."""
        largest = float(np.linalg.eigvals(self.matrix).real.max())
        rounding = len(self.matrix) * np.finfo(float).eps * float(np.abs(self.matrix).max())
        return 0.0 if abs(largest) <= rounding else largest


def states_of(model: Model) -> tuple[str, ...]:
    """Names of the unperturbed loop's states. Raises ModelError if the FMU does not show its estimates."""
    if not model.indexed("y"):
        raise ModelError(f'{model.path} does not show its estimates y (expose = "outputs")')
    return tuple(variable.name for stem in "xzvy" for _, variable in sorted(model.indexed(stem).items()))


def linearized_loop(simulator: Simulator, changes: Mapping[str, Value] | None = None) -> LinearizedLoop:
    """M of a game with these start values in place of its own.

    Raises ModelError if the FMU does not show its estimates, SimulationError for more than LARGEST states.
    """
    model = simulator.model
    states = states_of(model)
    if len(states) > LARGEST:
        raise SimulationError(f"the loop has {len(states):,} states, too many for its eigenvalues")
    values = {**model.expanded(changes or {}), "robust": False, "perturbed": False}
    entries = [variable.name for _, variable in sorted(model.indexed("x_star").items())]
    x_star = simulator.at_start(entries, values).reshape(model.players, model.dimension)
    at_rest: dict[str, Value] = {}
    for stem in ("x0", "z0", "v0", "y0"):
        for index, variable in model.indexed(stem).items():
            i, coordinate = index[-2:]  # of the player itself, or of the one that is estimated
            at_rest[variable.name] = 0.0 if stem == "v0" else float(x_star[i - 1, coordinate - 1])
    return LinearizedLoop(states, simulator.jacobian(states, {**values, **at_rest}), x_star)


def gradient_jacobian(loop: LinearizedLoop, model: Model, values: Mapping[str, Value]) -> FloatArray:
    """Jacobian (N D, N D) of the pseudo-gradient at x*, entries by player and coordinate.

    Read from M: z_i' = -k2 grad_i f_i(y_i) for order 1, v_i' = -k4 (v_i + k2 grad_i f_i(y_i)) for order 2.
    """
    row_of = {name: row for row, name in enumerate(loop.states)}
    N, D = model.players, model.dimension

    def gain(name: str, i: int) -> float:
        return float(values.get(name, values.get(f"{name}[{i}]", np.nan)))

    jacobian = np.empty((N * D, N * D))
    for i in range(1, N + 1):
        first = model.order[i - 1] == 1
        scale = gain("k2", i) * (1.0 if first else gain("k4", i))
        columns = [row_of[f"y[{i},{j},{k}]"] for j in range(1, N + 1) for k in range(1, D + 1)]
        for k in range(1, D + 1):
            row = row_of[f"{'z' if first else 'v'}[{i},{k}]"]
            jacobian[(i - 1) * D + k - 1] = -loop.matrix[row, columns] / scale
    return jacobian
