"""What the network and the robust term have to reject along a run: unknown dynamics and disturbances."""

import numpy as np
from numpy.typing import NDArray

from .names import parse_name
from .parameters import GameParameters
from .results import Result

FloatArray = NDArray[np.float64]


def unknown_term(game: GameParameters, result: Result) -> FloatArray:
    """g_i(x(t)) + d_i(t) + d_ext along a run whose parameters do not change, (T, N, D).

    g_i(x)_l = sum_j (G_ij,l x_jl + H_ij,l x_jl^2), d_il(t) = bias + amplitude sin(frequency t + phase).
    """
    shape = (game.players, game.dimension)
    unknown = np.broadcast_to(_parameter(result, "d_ext", shape), (len(result.time), *shape)).copy()
    if not result.parameters.get("perturbed", True):
        return unknown
    x = result.x
    unknown += np.einsum("ijl,tjl->til", game.dynamics_linear, x)
    unknown += np.einsum("ijl,tjl->til", game.dynamics_square, x * x)
    bias, amplitude, frequency, phase = (
        _parameter(result, f"disturbance_{name}", shape)
        for name in ("bias", "amplitude", "frequency", "phase")
    )
    time = result.time[:, np.newaxis, np.newaxis]
    return np.asarray(unknown + bias + amplitude * np.sin(frequency * time + phase))


def _parameter(result: Result, stem: str, shape: tuple[int, ...]) -> FloatArray:
    values = np.zeros(shape)
    for name, value in result.parameters.items():
        each, index = parse_name(name)
        if each == stem and index:
            values[tuple(position - 1 for position in index)] = value
    return values
