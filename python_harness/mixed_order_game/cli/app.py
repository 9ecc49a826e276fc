"""The command mog: parses options and prints; everything else is done by the library.

Exit codes: 0 fine; 1 a check failed, or an error told in one sentence on stderr; 2 wrong usage;
130 after Ctrl-C.
"""

import codecs
import io
import sys
from typing import Annotated, Any

import typer
import typer.core

from ..errors import MixedOrderGameError, reason
from ..interrupts import INTERRUPTED, end_as_exceptions
from .analyse import analyse
from .build import build
from .check import check
from .compare import compare
from .demo import demo
from .explore import explore
from .info import info
from .new import new
from .panels import Command, PlainTypes, grouped, help_of
from .periods import periods
from .plot import plot
from .report import report
from .run import run
from .schema import schema
from .ssp import ssp
from .sweep import sweep
from .tune import tune
from .validate import validate
from .verbosity import with_verbosity


class ErrorsAsSentences(PlainTypes, typer.core.TyperGroup):
    """Prints the package's own exceptions as one sentence on stderr and exits with 1; Ctrl-C gives 130."""

    def invoke(self, ctx: Any) -> Any:
        """Run a command."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            typer.echo("mog: interrupted", err=True)
            raise typer.Exit(INTERRUPTED) from None
        except MixedOrderGameError as error:
            typer.echo(f"mog: {error}", err=True)
            raise typer.Exit(1) from error


app = typer.Typer(
    name="mog",
    cls=ErrorsAsSentences,
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(value: bool) -> None:
    if value:
        from ..version import package_version

        typer.echo(f"mog {package_version()}")
        raise typer.Exit


def root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Distributed Nash equilibrium seeking for mixed-order games, as an FMU.

    Commands that run or show a game take an FMU, a game file or a game of the package by name, and the
    paper's example when given none.
    """


app.callback(help=help_of(root))(root)

COMMANDS = {
    "Run and show": (demo, run, explore, plot, report),
    "Judge": (validate, analyse, compare),
    "Many runs": (sweep, tune, periods),
    "Games": (new, check, schema, info),
    "FMUs": (build, ssp),
}
for heading, commands in COMMANDS.items():
    for command in commands:
        told = help_of(command)
        app.command(cls=Command, help=told, short_help=told.partition("\n\n")[0], rich_help_panel=heading)(
            with_verbosity(grouped(command))
        )


def main() -> None:
    """Entry point of the command, on any console."""
    end_as_exceptions()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # characters that it lacks are shown as \\uXXXX, not fatal
            utf8 = codecs.lookup(stream.encoding).name == "utf-8"
            stream.reconfigure(errors="surrogateescape" if utf8 else "backslashreplace")
    try:
        app()
    except OSError as error:  # mostly of a full disk behind standard output
        where = f"{error.filename}: " if error.filename else ""
        sys.stderr.write(f"mog: {where}{reason(error)}\n")
        sys.exit(1)


if __name__ == "__main__":
    main()
