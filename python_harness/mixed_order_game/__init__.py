"""Distributed Nash equilibrium seeking for mixed-order games, as an FMU.

>>> import mixed_order_game as mog
>>> result = mog.run("five_vehicles", start_values={"k1": 12.0})
>>> result.x.shape  # time, player, coordinate
(1001, 5, 2)

The figures are in mixed_order_game.results.plot, the command is mog.
"""

from .errors import (
    BuildError,
    GameError,
    MixedOrderGameError,
    ModelError,
    PlotError,
    ResultError,
    SimulationError,
    VariableError,
)
from .fmu.build import build_fmu, cached_fmu, default_fmu, default_game
from .fmu.model import Model, Variable, read_model
from .fmu.run import Simulator, run
from .results.result import Result, load
from .studies.validate import Claim, Validation, Verdict, validate
from .version import package_version

__version__ = package_version()

__all__ = [
    "BuildError",
    "Claim",
    "GameError",
    "MixedOrderGameError",
    "Model",
    "ModelError",
    "PlotError",
    "Result",
    "ResultError",
    "SimulationError",
    "Simulator",
    "Validation",
    "Variable",
    "VariableError",
    "Verdict",
    "build_fmu",
    "cached_fmu",
    "default_fmu",
    "default_game",
    "load",
    "package_version",
    "read_model",
    "run",
    "validate",
]
