"""Where the loop starts and how far it can go: the parts of V along states, sublevel sets, balls about x*."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..game.parameters import GameParameters
from .certificate import Certificate, Weights
from .spectrum import gradient_map, nash_equilibrium

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LoopErrors:
    """The four norms of V at T states, (T,) each; velocities in 1/s, the others in the game's length unit."""

    actions: FloatArray  # |xbar - x*|
    velocities: FloatArray  # |vbar_s|
    tracking: FloatArray  # |x_f - z_f|
    estimates: FloatArray  # |y - 1 (x) xbar|
    largest_estimate: FloatArray  # max_i |y_i - x*|

    def level(self, weights: Weights) -> FloatArray:
        """V_1 to V_4 with these weights, (T,); the adaptive part is not in it."""
        squares = (
            self.actions**2 + weights.velocities * self.velocities**2 + weights.tracking * self.tracking**2
        )
        return np.asarray(0.5 * squares + weights.estimates * self.estimates**2)


def loop_errors(
    parameters: GameParameters,
    x: FloatArray,
    v: FloatArray,
    z: FloatArray,
    y: FloatArray,
    gradient: FloatArray | None = None,
) -> LoopErrors:
    """Errors of states: x, v, z (T, N, D), y (T, N, N, D); v of order 1 and z of order 2 are ignored.

    gradient (T, N, D): grad_i f_i(y_i), which quadratic costs tell themselves. xbar_i = z_i (order 1) or x_i
    (order 2); vbar_i = v_i + k2 grad_i f_i(y_i) for order 2.
    """
    x_star = nash_equilibrium(parameters)
    first = parameters.first_order
    xbar = np.where(first[:, np.newaxis], z, x)
    if gradient is None:
        gradient = np.einsum("ij,tijl->til", gradient_map(parameters), y) + parameters.cost_linear
    vbar = (v + parameters.k2 * gradient)[:, ~first]
    difference = y - xbar[:, np.newaxis]

    def norm(array: FloatArray) -> FloatArray:
        return np.asarray(np.linalg.norm(array.reshape(len(x), -1), axis=1))

    distances = np.linalg.norm((y - x_star).reshape(*y.shape[:2], -1), axis=2)
    return LoopErrors(
        actions=norm(xbar - x_star),
        velocities=norm(vbar),
        tracking=norm((x - z)[:, first]),
        estimates=norm(difference),
        largest_estimate=np.asarray(distances.max(axis=1)),
    )


def initial_errors(parameters: GameParameters) -> LoopErrors:
    """Errors of the game's initial state, (1,) each. vbar_s(0) grows with k2, also where v(0) = 0."""
    p = parameters
    gradient = None if p.bounds is None else p.bounds.first_gradients[np.newaxis]
    return loop_errors(p, p.x0[np.newaxis], p.v0[np.newaxis], p.z0[np.newaxis], p.y0[np.newaxis], gradient)


@dataclass(frozen=True)
class Domain:
    """A sublevel set V <= level and the balls about x* that hold it, radii in the game's length unit."""

    level: float
    action_radius: float  # |x - x*|
    estimate_radius: float  # |y_i - x*|, each i


def domain(certificate: Certificate, level: float) -> Domain:
    """The balls that hold the sublevel set."""
    return Domain(level, certificate.action_radius(level), certificate.estimate_radius(level))
