"""Arguments and options that several commands have in common."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer

from .writing import Kind, check_output

GameArgument = Annotated[
    Path | None,
    typer.Argument(
        help="An FMU (.fmu), a game file (.toml) or a game of the package by name; "
        "the paper's example when left out.",
        show_default=False,
    ),
]

SettingsOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="Start value of all runs; repeatable."),
]

StopTimeOption = Annotated[float | None, typer.Option(help="End of every run in s.", show_default="FMU's")]

StepOption = Annotated[float | None, typer.Option(help="Sampling in s.", show_default="FMU's")]

ToleranceOption = Annotated[
    float | None, typer.Option(help="Relative tolerance of the integrator.", show_default="FMU's")
]

SettleTimeOption = Annotated[
    float | None,
    typer.Option(help="Time in s from which the final error is taken.", show_default="80 % of the run"),
]

BandOption = Annotated[
    float | None,
    typer.Option(help="Largest |x - x*| that counts as settled.", show_default="2 % of the initial one"),
]

ForceOption = Annotated[bool, typer.Option("--force", help="Replace a file of another kind.")]


def output_option(
    path: Path, kind: Kind, *, inputs: Iterable[Path | None] = (), force: bool, hint: str = "--output"
) -> Path:
    """The path of a file to write, judged before any work.

    Raises typer.BadParameter for its suffix, ResultError where check_output does.
    """
    if not kind.takes(path):
        raise typer.BadParameter(f"the file must end in {kind.ending}", param_hint=hint)
    return check_output(path, kind, inputs=inputs, force=force)
