"""Exceptions of the package: everything it raises on purpose derives from MixedOrderGameError.

The command prints the text of these as one sentence on stderr and exits with status 1.
"""


class MixedOrderGameError(Exception):
    """Base of every error the package raises on purpose."""


def reason(error: Exception) -> str:
    """Why something failed, for the end of a sentence: of the system's errors neither number nor path."""
    if isinstance(error, OSError) and error.strerror:
        if isinstance(error, FileExistsError):  # of a folder to be made where a file stands
            return "not a directory"
        return error.strerror[0].lower() + error.strerror[1:]
    if isinstance(error, KeyError):
        return f"{error.args[0]} is missing"
    return str(error)


class GameError(MixedOrderGameError):
    """A game definition file that is missing or breaks the definition."""


class BuildError(MixedOrderGameError):
    """An FMU that could not be made from a game, for another reason than the game itself."""


class ModelError(MixedOrderGameError):
    """An FMU that cannot be read or is not of this project."""


class VariableError(MixedOrderGameError):
    """A variable that does not exist, cannot be set, or a value that it does not take."""


class SimulationError(MixedOrderGameError):
    """A run that cannot be started or that the FMU refused; the text ends with the FMU's own message."""


class ResultError(MixedOrderGameError):
    """A file that cannot be read, written or replaced, or a signal that was not recorded."""


class MissingPackageError(MixedOrderGameError):
    """A package that an extra brings is not installed; the text names the extra."""


class PlotError(MixedOrderGameError):
    """A figure that cannot be drawn from the result given."""
