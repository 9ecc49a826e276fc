"""Arguments and options that several commands have in common, and how their texts are read."""

from collections.abc import Callable, Iterable, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from ..files.writing import Kind, check_output
from ..names import split_names
from .completion import complete_game, complete_game_file, complete_setting

if TYPE_CHECKING:
    from ..fmu.model import Model, Value
    from ..game.graphs import CommunicationGraph
    from ..studies.designs import Range

Parsed = TypeVar("Parsed")

GameArgument = Annotated[
    Path | None,
    typer.Argument(
        help="An FMU (.fmu), a game file (.toml) or a game of the package by name; "
        "the paper's example when left out.",
        show_default=False,
        autocompletion=complete_game,
    ),
]

GameFileArgument = Annotated[
    Path | None,
    typer.Argument(
        help="A game file (.toml) or a game of the package by name; the paper's example when left out.",
        show_default=False,
        autocompletion=complete_game_file,
    ),
]

SettingsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="Start value of a parameter or input, in all runs; repeatable.",
        autocompletion=complete_setting,
    ),
]

StopTimeOption = Annotated[float | None, typer.Option(help="End of every run in s.", show_default="FMU's")]

StepOption = Annotated[float | None, typer.Option(help="Time between samples in s.", show_default="FMU's")]

ToleranceOption = Annotated[
    float | None, typer.Option(help="Relative tolerance of the integrator.", show_default="FMU's")
]

SettleTimeOption = Annotated[
    float | None,
    typer.Option(help="Time in s from which the final error is taken.", show_default="80 % of the run"),
]

BandOption = Annotated[
    float | None,
    typer.Option(help="Norm of x - x* that counts as settled.", show_default="2 % of the initial one"),
]

JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON.")]

ForceOption = Annotated[bool, typer.Option("--force", help="Replace a file of another kind.")]


class FigureFormat(StrEnum):
    """File formats of figures."""

    PDF = "pdf"
    SVG = "svg"
    PNG = "png"


def output_option(
    path: Path, kind: Kind, *, inputs: Iterable[Path | None] = (), force: bool, hint: str = "--output"
) -> Path:
    """The path of a file to write, judged before any work.

    Raises typer.BadParameter for its suffix, ResultError where check_output does.
    """
    if not kind.takes(path):
        raise typer.BadParameter(f"the file must end in {kind.ending}", param_hint=hint)
    return check_output(path, kind, inputs=inputs, force=force)


def settings_of(texts: Iterable[str], hint: str = "--set") -> "dict[str, Value]":
    """NAME=VALUE, each name once."""
    from ..arguments import value_of_text

    return pairs_of(texts, value_of_text, hint)


def pairs_of(texts: Iterable[str], parse: Callable[[str], Parsed], hint: str) -> dict[str, Parsed]:
    """NAME=TEXT, each name once, its text parsed. Raises typer.BadParameter."""
    from ..studies.designs import DesignError

    pairs: dict[str, Parsed] = {}
    for text in texts:
        name, separator, rest = (part.strip() for part in text.partition("="))
        if not (name and separator and rest):
            raise typer.BadParameter(f"NAME=... expected, not {text!r}", param_hint=hint)
        if name in pairs:
            raise typer.BadParameter(f"{name} is given twice", param_hint=hint)
        try:
            pairs[name] = parse(rest)
        except (DesignError, ValueError) as error:
            raise typer.BadParameter(f"{name}: {error}", param_hint=hint) from None
    return pairs


def range_option(text: str | None, hint: str) -> "Range | None":
    """LOW:HIGH. Raises typer.BadParameter."""
    from ..studies.designs import DesignError, range_of_text

    try:
        return None if text is None else range_of_text(text)
    except DesignError as error:
        raise typer.BadParameter(str(error), param_hint=hint) from None


def graphs_option(texts: Sequence[str], model: "Model", seed: int) -> "tuple[CommunicationGraph, ...]":
    """Graphs of all texts in turn, each once. Raises typer.BadParameter."""
    from ..game.graphs import GraphError, graph_of_model, graphs_of_text

    graphs: dict[CommunicationGraph, None] = {}
    for text in texts:
        try:
            found = graphs_of_text(text, model.players, seed=seed, own=graph_of_model(model))
        except GraphError as error:
            raise typer.BadParameter(str(error), param_hint="--graphs") from None
        graphs |= dict.fromkeys(found)
    return tuple(graphs)


def names_option(texts: Iterable[str], hint: str) -> list[str]:
    """Comma-separated names of all texts. Raises typer.BadParameter for a text that holds none."""
    names: list[str] = []
    for text in texts:
        found = split_names(text)
        if not found:
            raise typer.BadParameter(f"names separated by commas expected, not {text!r}", param_hint=hint)
        names += found
    return names


def players_of_text(text: str, hint: str) -> list[int]:
    """1-based players, as in 3 or 1,2. Raises typer.BadParameter."""
    try:
        return [int(each) for each in text.split(",")]
    except ValueError:
        raise typer.BadParameter(f"{text!r} is no list of players such as 1,2", param_hint=hint) from None
