"""What a run of the FMU shows, in the terms of the bounds: errors, levels of V, weights, control."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from time import monotonic

import numpy as np
from numpy.typing import NDArray

from ..errors import SimulationError
from ..fmu.estimates import fmu_with_estimates
from ..fmu.model import Value
from ..fmu.run import Simulator
from ..game.parameters import GameParameters
from .domain import LoopErrors, loop_errors
from .game import AnalysedGame, Gains
from .spectrum import nash_equilibrium

FloatArray = NDArray[np.float64]

TOLERANCE = 1e-11
"""Relative tolerance of the runs. Designed gains leave seeking errors of 1e-8 and less, whose sign decides
when weight columns leave their spheres; an integrator that does not resolve them makes events of its errors.
"""

SMALLEST_EPSILON = 1e-8
"""Least epsilon that is simulated: below it the robust term's boundary layer nears the actions' rounding."""

SAMPLES = 1000


@dataclass(frozen=True, eq=False)
class Seen:
    """One run, T samples."""

    time: FloatArray  # (T,), s
    error: FloatArray  # (T,), |x - x*|_2
    x: FloatArray  # (T, N, D)
    y: FloatArray | None  # (T, N, N, D); None where the game is too large for its FMU to show them
    errors: LoopErrors | None  # likewise
    largest_weight_norm2: float  # largest w'w of a column
    largest_control: float  # largest |u_il|
    steps: int  # of the integrator

    def radius(self, begin: float) -> float:
        """Largest |x - x*| from a time in s on."""
        return float(self.error[self.time >= begin].max())

    def root_mean_square(self, begin: float) -> float:
        """Root mean square of |x - x*| over the samples from a time in s on."""
        return float(np.sqrt(np.mean(self.error[self.time >= begin] ** 2)))

    def settling_time(self, part: float) -> float:
        """Time in s from when on |x - x*| is at most `part` of its start; inf if the end is above it."""
        above = np.flatnonzero(self.error > part * self.error[0])
        if not above.size:
            return 0.0
        return float(self.time[above[-1] + 1]) if above[-1] + 1 < len(self.time) else np.inf


def simulate(
    fmu: Path,
    game: AnalysedGame,
    *,
    stop_time: float,
    gains: Gains | None = None,
    changes: Mapping[str, Value] | None = None,
    robust: bool = True,
    perturbed: bool = True,
    time_limit: float = 60.0,
) -> Seen:
    """Run the FMU of a game with its own gains or others.

    Raises SimulationError as a run does, for an epsilon below SMALLEST_EPSILON and when computing takes
    longer than time_limit, in s (looked at after each of the SAMPLES steps).
    """
    own = {} if gains is None else vars(gains)
    values: dict[str, Value] = {**(changes or {}), **own, "robust": robust, "perturbed": perturbed}
    used = game if gains is None else game.with_gains(gains)
    if used.gains.epsilon < SMALLEST_EPSILON:
        raise SimulationError(
            f"epsilon = {used.gains.epsilon:.2g} is too small to be simulated in double precision"
        )
    with Simulator(fmu_with_estimates(fmu)) as simulator:
        result = simulator.run(
            start_values=values,
            stop_time=stop_time,
            step=stop_time / SAMPLES,
            tolerance=TOLERANCE,
            progress=_deadline(time_limit),
            outputs=[
                name
                for name in ("x", "v", "z", "y", "u", "W_norm2", "nash_error", "solver_steps")
                if name in simulator.model.variables or simulator.model.indexed(name)
            ],
        )
    v, z = np.nan_to_num(result.v), np.nan_to_num(result.z)
    y = result.y if simulator.model.indexed("y") else None
    return Seen(
        time=result.time,
        error=result.nash_error,
        x=result.x,
        y=y,
        errors=None if y is None else loop_errors(used.parameters, result.x, v, z, y),
        largest_weight_norm2=float(result.W_norm2.max()),
        largest_control=float(np.abs(result.u).max()),
        steps=int(result["solver_steps"][-1]),
    )


def integration_error(parameters: GameParameters) -> float:
    """2-norm of what TOLERANCE, with a hundredth of it as absolute tolerance, allows as error of x at x*."""
    return float(np.linalg.norm(TOLERANCE * (np.abs(nash_equilibrium(parameters)) + 0.01)))


def _deadline(limit: float) -> Callable[[float], None]:
    """A progress callback that stops a run after `limit` seconds of computing."""
    begin = monotonic()

    def check(reached: float) -> None:
        if monotonic() - begin > limit:
            raise SimulationError(
                f"the run reached {reached:.3g} s in {limit:g} s of computing and was stopped"
            )

    return check
