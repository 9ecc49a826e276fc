"""What is proved of a game's costs, dynamics and disturbances over a box of joint actions and speeds.

The host tool proves: it encloses the second derivatives of the costs and the derivatives of the dynamics by
intervals, on the box cut into parts, and looks at sample points beside.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .host_tool import ask, file_of

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Box:
    """Joint actions from lower to upper, (N, D) each, in the game's length unit."""

    lower: FloatArray
    upper: FloatArray

    def reach(self, x_star: FloatArray) -> float:
        """Distance of x* (N, D) to the nearest face; negative if it lies outside."""
        return float(np.minimum(x_star - self.lower, self.upper - x_star).min())


def box_around(x_star: FloatArray, distance: float) -> Box:
    """Every action within a distance of x* (N, D), in each coordinate."""
    return Box(x_star - distance, x_star + distance)


@dataclass(frozen=True, eq=False)
class JacobianBounds:
    """Of a map with D values for each player over a box: rows and columns by player, then by coordinate."""

    lipschitz: FloatArray  # (N,), proved; inf where nothing is
    sampled: FloatArray  # (N,), largest of the samples, at most what is proved
    middle: FloatArray  # (N D, N D); NaN where nothing is proved
    radius: FloatArray  # (N D, N D), by which entries differ from the middle at most; inf likewise


@dataclass(frozen=True, eq=False)
class GameBounds:
    """Constants of the assumptions over a box, N players, D coordinates."""

    box: Box
    x_star: FloatArray  # (N, D)
    monotonicity: float  # m of Assumption 3, proved; -inf where nothing is
    sampled_monotonicity: float  # the smallest of the samples, at least what is proved
    gradients: JacobianBounds  # of grad_i f_i: l_i of Assumption 1
    dynamics: JacobianBounds  # of g_i along actions, all at rest: eta_i of Assumption 5, in 1/s
    speed: float  # largest |v_jl| that the next ones hold for, in the game's length unit per s
    velocities: JacobianBounds  # of g_i along velocities: nu_i, in 1/s
    dynamics_size: FloatArray  # (N, D), of |g_il| over the box, all at rest; inf where nothing is proved
    disturbance_size: FloatArray  # (N, D), of |d_il(t)| for all t; inf likewise
    first_gradients: FloatArray  # (N, D), grad_i f_i(y_i(0))
    open: tuple[str, ...]  # why something is not proved

    @property
    def reach(self) -> float:
        """Largest r for which |y - x*| <= r, of joint actions y, lies in the box."""
        return self.box.reach(self.x_star)

    @property
    def use_velocities(self) -> bool:
        """Whether dynamics depend on velocities somewhere, or are not proved not to."""
        return bool(np.any(self.velocities.lipschitz > 0.0))

    @property
    def monotone(self) -> bool:
        """Whether m > 0 and Lipschitz constants of all gradients are proved."""
        return self.monotonicity > 0.0 and bool(np.isfinite(self.gradients.lipschitz).all())


def game_bounds(
    game: Path,
    box: Box,
    x_star: FloatArray,
    changes: Mapping[str, float | int | bool] | None = None,
    *,
    speed: float = 0.0,
) -> GameBounds:
    """Bounds of a game file (.toml) or of an FMU's own, with start values of the FMU's variables changed.

    Those along velocities hold where no velocity's coordinate is larger than the speed.

    Raises GameError if the game is none or does not take the changes, BuildError without the host tool.
    """
    pairs = zip(box.lower.ravel().tolist(), box.upper.ravel().tolist(), strict=True)
    settings = (f"{json.dumps(name)} = {float(value)!r}" for name, value in (changes or {}).items())
    sides = [list(pair) for pair in pairs]
    request = f"box = {sides}\nspeed = {float(speed)!r}\nsettings = {{ {', '.join(settings)} }}\n"
    with file_of(game) as file:
        told = ask("--constants", file, request)
    return GameBounds(
        box=box,
        x_star=x_star,
        monotonicity=_number(told["monotonicity"]["proved"], -math.inf),
        sampled_monotonicity=_number(told["monotonicity"]["sampled"], math.nan),
        gradients=_jacobian(told["gradients"]),
        dynamics=_jacobian(told["dynamics"]),
        speed=speed,
        velocities=_jacobian(told["velocities"]),
        dynamics_size=_array(told["dynamics_size"]),
        disturbance_size=_array(told["disturbance_size"]),
        first_gradients=_array(told["first_gradients"]),
        open=tuple(told["open"]),
    )


def _jacobian(told: Mapping[str, Any]) -> JacobianBounds:
    lower, upper = _array(told["lower"], -math.inf), _array(told["upper"])
    proved = np.isfinite(lower) & np.isfinite(upper)
    middle = np.full_like(lower, math.nan)
    middle[proved] = 0.5 * (lower[proved] + upper[proved])
    radius = np.full_like(lower, math.inf)
    radius[proved] = np.maximum(upper[proved] - middle[proved], middle[proved] - lower[proved])
    return JacobianBounds(
        lipschitz=_array([each["proved"] for each in told["lipschitz"]]),
        sampled=_array([each["sampled"] for each in told["lipschitz"]]),
        middle=middle,
        radius=radius,
    )


def _array(told: Any, missing: float = math.inf) -> FloatArray:
    array = np.array(told, dtype=np.float64)  # null becomes NaN
    return np.where(np.isnan(array), missing, array)


def _number(told: float | None, missing: float) -> float:
    return missing if told is None else told
