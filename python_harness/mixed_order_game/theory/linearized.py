"""The unperturbed loop of any game linearized at x*, without the robust part and without perturbations.

delta' = M delta, with the states of `spectrum.linear_loop`. Only the pseudo-gradient is not linear: M needs
its Jacobian h at x*. For quadratic costs this is the loop itself; otherwise it tells of a neighbourhood of x*
alone, whose size it does not tell.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import SimulationError
from ..fmu.model import Value
from ..fmu.run import Simulator
from ..game.bounds import box_around, game_bounds
from ..game.parameters import GameParameters, game_parameters
from .spectrum import linear_loop

FloatArray = NDArray[np.float64]

LARGEST = 1000
"""Most states, (2 + N) N D, for which M is set up: all eigenvalues of 1000 take some 2 s of one core."""


@dataclass(frozen=True, eq=False)
class LinearizedLoop:
    """A game with x* (N, D) and the Jacobian h (N D, N D) of its pseudo-gradient there."""

    game: GameParameters
    x_star: FloatArray
    jacobian: FloatArray

    @property
    def states(self) -> int:
        """How many the unperturbed loop has, (2 + N) N D."""
        return (2 + self.game.players) * self.x_star.size

    @property
    def is_large(self) -> bool:
        """Whether it has more than LARGEST states: there is no M and no abscissa then."""
        return self.states > LARGEST

    @property
    def matrix(self) -> FloatArray:
        """M (n, n) in 1/s. Raises SimulationError for more than LARGEST states."""
        if self.is_large:
            raise SimulationError(
                f"the loop has {self.states:,} states, too many for its eigenvalues, which are computed up "
                f"to {LARGEST:,}"
            )
        return linear_loop(self.game)

    @property
    def abscissa(self) -> float:
        """Largest real part of the eigenvalues, in 1/s; 0 where rounding alone tells it from 0.

        Raises SimulationError for more than LARGEST states.
        """
        matrix = self.matrix
        largest = float(np.linalg.eigvals(matrix).real.max())
        rounding = len(matrix) * np.finfo(float).eps * float(np.abs(matrix).max())
        return 0.0 if abs(largest) <= rounding else largest


def linearized_loop(simulator: Simulator, changes: Mapping[str, Value] | None = None) -> LinearizedLoop:
    """The loop of a game, with these start values in place of its own, at x*.

    h comes from the FMU's directional derivatives where it shows its estimates, else from the host tool,
    which reads the game that the FMU carries. Raises SimulationError where the FMU knows no x* or h is not
    finite there.
    """
    model = simulator.model
    changes = model.expanded(changes or {})
    entries = [variable.name for _, variable in sorted(model.indexed("x_star").items())]
    x_star = simulator.at_start(entries, changes).reshape(model.players, model.dimension)
    if not np.isfinite(x_star).all():
        raise SimulationError("the FMU knows no Nash equilibrium to linearize at")
    game = replace(game_parameters(model, changes), x_star=x_star)
    if model.indexed("y"):
        jacobian, why = _along_estimates(simulator, game, x_star, changes), ""
    else:
        bounds = game_bounds(model.path, box_around(x_star, 0.0), x_star, changes)
        jacobian, why = bounds.gradients.middle, "".join(f"; {told}" for told in bounds.open)
    if not np.isfinite(jacobian).all():
        raise SimulationError(f"the loop cannot be linearized at x*: a derivative is not finite{why}")
    return LinearizedLoop(replace(game, jacobian=jacobian), x_star, jacobian)


def _along_estimates(
    simulator: Simulator, game: GameParameters, x_star: FloatArray, changes: Mapping[str, Value]
) -> FloatArray:
    """h (N D, N D) from z_i' = -k2 grad_i f_i(y_i) or v_i' = -k4 (v_i + k2 grad_i f_i(y_i)) at rest.

    Each player's rate reads its own estimates alone, so those of all players can move at once.
    """
    model = simulator.model
    start: dict[str, Value] = {**changes, "robust": False, "perturbed": False}
    for stem in ("x0", "z0", "v0", "y0"):
        for index, variable in model.indexed(stem).items():
            j, coordinate = index[-2:]  # of the player itself, or of the one that is estimated
            start[variable.name] = 0.0 if stem == "v0" else float(x_star[j - 1, coordinate - 1])
    players, coordinates = range(1, model.players + 1), range(1, model.dimension + 1)
    driven = ["z" if order == 1 else "v" for order in model.order]
    rates = [f"{driven[i - 1]}[{i},{k}]" for i in players for k in coordinates]
    directions = [[f"y[{i},{j},{k}]" for i in players] for j in players for k in coordinates]
    scale = game.of_players("k2") * np.where(game.first_order, 1.0, game.regulation)
    found = simulator.jacobian(rates, start, directions)
    return -found / np.repeat(scale, model.dimension)[:, np.newaxis]
