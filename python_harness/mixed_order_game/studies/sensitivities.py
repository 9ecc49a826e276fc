"""How a run changes with its parameters, to first order: forward sensitivities.

The host tool runs the game: FMI has no function for derivatives of a whole run.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..arguments import number_argument
from ..errors import ExperimentError, GameError, SimulationError, VariableError
from ..fmu.build import GameSource
from ..fmu.model import Model, Value, read_model
from ..fmu.run import samples
from ..game.host_tool import ask, file_of

FloatArray = NDArray[np.float64]

TOOL = "mixed-order-game-description: "
"""What the host tool writes before the reason why a run failed."""


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """A run's actions and their derivatives by parameters. T times, N players, D coordinates.

    derivatives[name] is dx/dp, (T, N, D), in units[name]; x_star_derivatives[name] is that of x*, (N, D).
    """

    time: FloatArray  # (T,), s
    x: FloatArray  # (T, N, D)
    x_star: FloatArray  # (N, D)
    derivatives: Mapping[str, FloatArray]
    x_star_derivatives: Mapping[str, FloatArray]
    units: Mapping[str, str | None]  # None: none declared
    parameters: Mapping[str, Value] = field(repr=False)  # every parameter and input with its value
    steps: int  # of the integrator

    def __getitem__(self, name: str) -> FloatArray:
        """dx/dp of a parameter, (T, N, D). Raises UnknownVariableError for one that was not asked for."""
        if name not in self.derivatives:
            known = ", ".join(self.derivatives)
            raise VariableError(f"there is no derivative by {name}; there are those by {known}")
        return self.derivatives[name]

    @property
    def nash_error(self) -> FloatArray:
        """|x - x*|, 2-norm, (T,)."""
        return np.asarray(np.linalg.norm(self.x - self.x_star, axis=(1, 2)))

    def nash_error_derivative(self, name: str) -> FloatArray:
        """Derivative of |x - x*| by a parameter, (T,); NaN where the error is 0."""
        away = self.x - self.x_star
        change = self[name] - self.x_star_derivatives[name]
        with np.errstate(invalid="ignore"):
            return np.asarray((away * change).sum(axis=(1, 2)) / self.nash_error)


def sensitivities(
    game: GameSource = None,
    parameters: Sequence[str] = ("k1", "k2", "k3", "k4", "beta", "delta", "epsilon"),
    *,
    start_values: Mapping[str, Value] | None = None,
    stop_time: float | None = None,
    start_time: float = 0.0,
    step: float = 0.02,
    tolerance: float = 1e-6,
) -> Sensitivities:
    """Run a game once and tell how its actions change with parameters, to first order.

    The variational equation s' = J s + df/dp is solved beside the run, with exact derivatives, and jumps with
    the rates where weights enter the sphere or expressions jump. One run with seven gains takes about as long
    as 3.5 runs at N = 5, and the run itself is the same as without.

    Parameters
    ----------
    game
        An FMU (.fmu), a game file (.toml), a game of the package by its name, a `Game`; the paper's example
        when left out.
    parameters
        Real parameters on which the run depends, initial values included. A name without indices stands for
        all of its kind, each by itself.
    start_values
        Parameters and inputs to set first, by name, as in `run`.
    stop_time
        End in s; default `start_time` plus the FMU's stop time.
    start_time
        Beginning in s.
    step
        Time between samples in s; the last one is shorter if the horizon is not a multiple of it.
    tolerance
        Relative tolerance of the integrator, between 0 and 1. Errors of the derivatives fall with it, but are
        not controlled themselves: take 1e-9 or less where controls are bounded, or costs or dynamics have
        abs, min or max.

    Returns
    -------
    Sensitivities

    Raises
    ------
    ModelError, GameError, BuildError
        For a game that is missing or none, or has players or plants outside.
    VariableError
        For a variable that does not exist, does not take its value or is no such parameter; for a parameter
        of expressions where expressions jump at conditions.
    SimulationError
        For a run that cannot begin or end; for times and tolerances that make no sense it is an
        `ExperimentError`, a ValueError, too.

    Source
    ------
    Feehery, Tolsma, Barton, Applied Numerical Mathematics 25 (1997); Galan, Feehery, Barton, Applied
    Numerical Mathematics 31 (1999).

    Examples
    --------
    >>> found = mog.sensitivities("five_vehicles", ["k1", "k2"], stop_time=2.0)
    >>> found["k1"].shape, found.units["k1"]
    ((101, 5, 2), 's')
    """
    model = read_model(game)
    model.require_all_players()
    model.require_plants()
    if stop_time is None:
        stop_time = number_argument(start_time, "start_time", ExperimentError) + model.stop_time
    time = samples(
        number_argument(start_time, "start_time", ExperimentError),
        number_argument(stop_time, "stop_time", ExperimentError),
        number_argument(step, "step", ExperimentError),
    )
    tolerance = number_argument(tolerance, "tolerance", ExperimentError)
    if not (np.isfinite(tolerance) and 0.0 < tolerance < 1.0):
        raise ExperimentError(f"tolerance = {tolerance:g} is not between 0 and 1")
    values = model.start_values(start_values)
    names = _names(model, parameters)
    changes = model.changed_values(values)
    settings = (f"{json.dumps(name)} = {float(value)!r}" for name, value in changes.items())
    request = (
        f"times = {time.tolist()}\nparameters = {json.dumps(names)}\n"
        f"tolerance = {tolerance!r}\nsettings = {{ {', '.join(settings)} }}\n"
    )
    with file_of(model.path) as file:
        try:
            told = ask("--sensitivities", file, request)
        except GameError as error:  # the game was built: it is the request, or the run
            message = str(error)
            if message.startswith(TOOL):
                raise SimulationError(message.removeprefix(TOOL)) from error
            raise VariableError(message.removeprefix(f"{file}: ")) from error
    derivatives = {
        name: np.array(each, dtype=np.float64) for name, each in zip(names, told["x_along"], strict=True)
    }
    for name, each in derivatives.items():  # in JSON, what is not finite is null
        finite = np.isfinite(each.reshape(len(time), -1)).all(axis=1)
        if not finite.all():
            raise SimulationError(
                f"the derivatives by {name} are not finite at t = {time[np.argmin(finite)]:g} s"
            )
    return Sensitivities(
        time=time,
        x=np.array(told["x"]),
        x_star=np.array(told["x_star"]),
        derivatives=derivatives,
        x_star_derivatives=dict(zip(names, map(np.array, told["x_star_along"]), strict=True)),
        units={name: _unit_of_derivative(model.variable(name).unit) for name in names},
        parameters=values,
        steps=told["steps"],
    )


def _names(model: Model, parameters: Sequence[str]) -> list[str]:
    if isinstance(parameters, str):
        raise VariableError(f"parameters = {parameters!r} is no list of names")
    chosen = model.select(parameters)
    for variable in chosen:
        if variable.causality != "parameter" or variable.type != "Real":
            kind = f"{variable.type} {variable.causality}"
            raise VariableError(f"{variable.name} is a {kind}, expected a Real parameter")
    if not chosen:
        raise VariableError("parameters are missing: expected at least one name")
    return [variable.name for variable in chosen]


def _unit_of_derivative(unit: str | None) -> str | None:
    """Unit of dx/dp, where x has none."""
    if unit is None or unit == "1":
        return unit
    if unit.startswith("1/") and unit.count("/") == 1:
        return unit.removeprefix("1/")
    return f"1/({unit})" if "/" in unit or " " in unit else f"1/{unit}"
