"""How much a command tells on stderr: the options --verbose and --quiet of every command.

The package logs in the namespace mixed_order_game; a command shows warnings of it unless told otherwise.
"""

import functools
import inspect
import logging
from collections.abc import Callable
from typing import Annotated, Any

import typer

LOGGER = logging.getLogger(__package__.partition(".")[0])

VerboseOption = Annotated[
    int,
    typer.Option(
        "--verbose",
        "-v",
        count=True,
        metavar="",
        help="Tell what is done; twice: in detail.",
        show_default=False,
    ),
]

QuietOption = Annotated[bool, typer.Option("--quiet", "-q", help="No progress, notes and warnings.")]


class _OnStandardError(logging.Handler):
    def emit(self, record: logging.LogRecord) -> None:
        level = "" if record.levelno < logging.WARNING else f"{record.levelname.lower()}: "
        typer.echo(f"mog: {level}{record.getMessage()}", err=True)


def is_quiet() -> bool:
    """Whether progress and notes are to be left out."""
    return not LOGGER.isEnabledFor(logging.WARNING)


def note(text: str) -> None:
    """Tell something besides the result on stderr, unless that is not wished."""
    if not is_quiet():
        typer.echo(text, err=True)


def with_verbosity(command: Callable[..., None]) -> Callable[..., None]:
    """The command with the options --verbose and --quiet."""

    @functools.wraps(command)
    def run(*arguments: Any, verbose: int, quiet: bool, **options: Any) -> None:
        handler = _OnStandardError()
        before = LOGGER.level
        LOGGER.addHandler(handler)
        LOGGER.setLevel(_level(verbose, quiet=quiet))
        try:
            command(*arguments, **options)
        finally:
            LOGGER.removeHandler(handler)
            LOGGER.setLevel(before)

    own = inspect.signature(command)
    kind = inspect.Parameter.KEYWORD_ONLY
    added = [
        inspect.Parameter("verbose", kind, default=0, annotation=VerboseOption),
        inspect.Parameter("quiet", kind, default=False, annotation=QuietOption),
    ]
    signature = own.replace(parameters=[*own.parameters.values(), *added])
    run.__dict__["__signature__"] = signature
    run.__annotations__ = {each.name: each.annotation for each in signature.parameters.values()}
    return run


def _level(verbose: int, *, quiet: bool) -> int:
    if verbose and quiet:
        raise typer.BadParameter("--verbose and --quiet contradict each other", param_hint="--quiet")
    if quiet:
        return logging.ERROR
    return {0: logging.WARNING, 1: logging.INFO}.get(verbose, logging.DEBUG)
