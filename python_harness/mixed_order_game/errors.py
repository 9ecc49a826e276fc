"""Exceptions of the package: everything it raises on purpose derives from MixedOrderGameError.

Where Python has a word for what happened, the exception is that one, too: KeyError, ValueError, ...
The command prints the text of these as one sentence on stderr and exits with status 1.
"""


class MixedOrderGameError(Exception):
    """Base of every error the package raises on purpose."""

    __str__ = Exception.__str__  # KeyError's would put the sentence in quotes


def reason(error: Exception) -> str:
    """Why something failed, for the end of a sentence: of the system's errors neither number nor path."""
    if isinstance(error, MixedOrderGameError):
        return str(error)
    if isinstance(error, OSError) and error.strerror:
        if isinstance(error, FileExistsError):  # of a folder to be made where a file stands
            return "not a directory"
        return error.strerror[0].lower() + error.strerror[1:]
    if isinstance(error, KeyError):
        return f"{error.args[0]} is missing"
    return str(error)


class GameError(MixedOrderGameError, ValueError):
    """A game definition file that is missing or breaks the definition."""


class MissingGameError(FileNotFoundError, GameError):
    """There is no such game, or no such game file."""


class MissingEntryError(GameError, KeyError):
    """A game without the entry or the player that was asked for."""


class BuildError(MixedOrderGameError, RuntimeError):
    """An FMU that could not be made from a game, for another reason than the game itself."""


class ModelError(MixedOrderGameError, ValueError):
    """An FMU that cannot be read or is not of this project."""


class MissingModelError(FileNotFoundError, ModelError):
    """There is no such FMU."""


class VariableError(MixedOrderGameError, ValueError):
    """A variable that does not exist, cannot be set, or a value that it does not take."""


class UnknownVariableError(VariableError, KeyError):
    """A variable that does not exist; the text names the nearest ones."""


class SimulationError(MixedOrderGameError, RuntimeError):
    """A run that cannot be started or that the FMU refused; the text ends with the FMU's own message."""


class ExperimentError(SimulationError, ValueError):
    """Times, tolerances and shapes of a run that make no sense."""


class ResultError(MixedOrderGameError):
    """A file that cannot be read, written or replaced, or a signal that was not recorded."""


class MissingResultError(FileNotFoundError, ResultError):
    """There is no such result file."""


class ExistingFileError(FileExistsError, ResultError):
    """A file that exists and is not replaced."""


class NotRecordedError(ResultError, KeyError):
    """A signal or column that a result does not hold."""


class MissingPackageError(MixedOrderGameError, ImportError):
    """A package that an extra brings is not installed; the text names the extra."""


class PlotError(MixedOrderGameError, ValueError):
    """A figure that cannot be drawn from the result given."""


def missing(kind: type[MixedOrderGameError]) -> type[MixedOrderGameError]:
    """The kind of error that says that a file is missing: one that also is a FileNotFoundError."""
    return next((each for each in kind.__subclasses__() if issubclass(each, FileNotFoundError)), kind)
