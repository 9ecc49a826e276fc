"""What the network and the robust term have to reject along a run: unknown dynamics and disturbances."""

import numpy as np
from numpy.typing import NDArray

from ..fmu.model import Model
from ..game.definition import has_expressions
from ..game.parameters import GameParameters
from ..names import parse_name
from .result import Result

FloatArray = NDArray[np.float64]

UNKNOWN = ("dynamics", "disturbance")
"""Parts of a player that make up the unknown term."""


def recorded_for_unknown_term(model: Model) -> list[str] | None:
    """What a run has to record for the unknown term besides x and u; None if the FMU lacks it."""
    if not has_expressions(model.expressions, *UNKNOWN):
        return []
    rates = [
        f"der({'x' if order == 1 else 'v'}[{i},{k}])"
        for i, order in enumerate(model.order, 1)
        for k in range(1, model.dimension + 1)
    ]
    return rates if all(name in model.variables for name in rates) else None


def unknown_term(game: GameParameters, result: Result) -> FloatArray:
    """g_i(x(t)) + d_i(t) + d_ext along a run whose parameters do not change, (T, N, D).

    g_i(x)_l = sum_j (G_ij,l x_jl + H_ij,l x_jl^2), d_il(t) = bias + amplitude sin(frequency t + phase).
    Of expressions it is x_i' - u_i of order 1, v_i' - u_i of order 2, from recorded derivatives.
    Raises ResultError if these were not recorded.
    """
    if has_expressions(game.expressions, *UNKNOWN):
        return _from_rates(game, result)
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


def _from_rates(game: GameParameters, result: Result) -> FloatArray:
    rates = [
        [result[f"der({'x' if order == 1 else 'v'}[{i},{k}])"] for k in range(1, game.dimension + 1)]
        for i, order in enumerate(game.order, 1)
    ]
    return np.asarray(np.moveaxis(np.array(rates), 2, 0) - result.u)


def _parameter(result: Result, stem: str, shape: tuple[int, ...]) -> FloatArray:
    values = np.zeros(shape)
    for name, value in result.parameters.items():
        each, index = parse_name(name)
        if each == stem and index:
            values[tuple(position - 1 for position in index)] = value
    return values
