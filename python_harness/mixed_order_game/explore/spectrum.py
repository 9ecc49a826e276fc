"""Eigenvalues of the unperturbed loop for the values on the page, and the word for its badge."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import MixedOrderGameError, SimulationError
from ..fmu.model import Value
from ..fmu.run import Simulator
from ..game.definition import has_expressions
from ..game.parameters import GameParameters, game_parameters
from ..theory.exact_loop import LARGEST_LINEAR_LOOP
from ..theory.graph import is_connected
from ..theory.linearized import linearized_loop
from ..theory.spectrum import linear_loop

FloatArray = NDArray[np.float64]

STABLE, UNSTABLE, NOT_DECIDED, NOT_COMPUTED = "stable", "unstable", "not decided", "not computed"


@dataclass(frozen=True, eq=False)
class Spectrum:
    """What is known of the unperturbed loop's modes."""

    eigenvalues: NDArray[np.complex128]  # (n,), 1/s; empty where they are not computed
    verdict: str  # STABLE, UNSTABLE, NOT_DECIDED or NOT_COMPUTED
    reason: str  # one sentence

    def as_json(self) -> dict[str, Any]:
        """Plain values for json.dumps, eigenvalues to seven digits."""
        return {
            "real": [float(f"{value:.7g}") for value in self.eigenvalues.real],
            "imaginary": [float(f"{value:.7g}") for value in self.eigenvalues.imag],
            "verdict": self.verdict,
            "reason": self.reason,
        }


def spectrum_of(simulator: Simulator, changes: Mapping[str, Value]) -> Spectrum:
    """Of quadratic costs that of one coordinate's loop, which is linear; otherwise that at x*.

    What the FMU refuses, and a loop that is too large, is the reason of one that is not computed.
    """
    local = has_expressions(simulator.model.expressions, "cost") is not None
    try:
        game = game_parameters(simulator.model, changes)
        matrix = linearized_loop(simulator, changes).matrix if local else _linear_loop(game)
    except MixedOrderGameError as error:
        return Spectrum(np.empty(0, dtype=complex), NOT_COMPUTED, f"{error}.")
    eigenvalues = np.linalg.eigvals(matrix).astype(complex)
    rounding = len(matrix) * float(np.finfo(float).eps) * float(np.abs(matrix).max())
    verdict, reason = _judged(
        float(eigenvalues.real.max()), rounding, is_connected(game.adjacency), " near x*" if local else ""
    )
    return Spectrum(eigenvalues, verdict, reason)


def _linear_loop(game: GameParameters) -> FloatArray:
    if game.players > LARGEST_LINEAR_LOOP:
        states = 2 * game.players + game.players**2
        raise SimulationError(f"the loop has {states:,} states a coordinate, too many for its eigenvalues")
    return linear_loop(game)


def _judged(abscissa: float, rounding: float, connected: bool, near: str) -> tuple[str, str]:  # noqa: FBT001
    """Verdict and reason for a largest real part in 1/s, of which rounding is not known."""
    if abscissa > rounding:
        return UNSTABLE, f"A mode grows{near} at {abscissa:.4g} 1/s."
    if not connected:
        return NOT_DECIDED, "The graph is not connected: some estimates are corrected by nothing."
    if abscissa >= -rounding:
        return NOT_DECIDED, f"The largest real part{near} is zero to rounding."
    return STABLE, f"The slowest mode{near} decays at {-abscissa:.4g} 1/s."
