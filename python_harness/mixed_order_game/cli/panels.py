"""How help looks: each option under the same heading in every command, nothing cut on a narrow terminal."""

import inspect
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, get_args

import typer.core
from typer.models import OptionInfo

PANELS = {
    "The game": (
        "baselines", "dimension", "disturbance", "example", "feedback", "fmu", "graph", "graph_schedule",
        "group", "linear_disturbance", "orders", "plant", "player", "players", "settings", "square",
        "title", "variants",
    ),
    "What is varied": (
        "design", "gains", "graphs", "grid", "initial_actions", "initial_states",
        "initial_velocities", "period", "ranges", "samples", "seed",
    ),
    "The run": (
        "jobs", "limit", "restart", "scheduler", "search", "simulation", "start_time", "step", "stop_time",
        "tolerance",
    ),
    "What it is judged by": (
        "band", "box", "claims", "largest_error", "neighbourhood", "radius", "settle_time",
        "settling_time", "speed", "strict",
    ),
    "What is written": (
        "arm_linux", "as_json", "figure", "file_format", "force", "heat_maps", "kinds", "output",
        "schema", "tables", "until", "variables", "width",
    ),
    "The page": ("browser", "port"),
}  # fmt: skip
"""Options by their parameters' names; others, --help among them, stand under Options."""


VALUES = {Path: "PATH", float: "NUMBER", int: "INTEGER", str: "TEXT"}
"""What help calls the value of an option that has no word of its own for it."""

LEAST_WIDTH = 80
"""Width in characters from which Typer's tables of options cut no name."""


def grouped(command: Callable[..., None]) -> Callable[..., None]:
    """The command, its options put under their headings and their values named."""
    headings = {name: heading for heading, names in PANELS.items() for name in names}
    for name, parameter in inspect.signature(command).parameters.items():
        annotated, *infos = get_args(parameter.annotation)
        for each in infos:
            if not isinstance(each, OptionInfo):
                continue
            if name in headings:
                each.rich_help_panel = headings[name]
            if each.metavar is None:
                each.metavar = next((VALUES[part] for part in _parts(annotated) if part in VALUES), None)
    return command


def _parts(annotation: Any) -> Iterator[Any]:
    """The types that a type is made of: list[Path] | None of Path and None."""
    inner = get_args(annotation)
    if not inner:
        yield annotation
    for each in inner:
        yield from _parts(each)


def help_of(command: Callable[..., None]) -> str:
    """The docstring with each paragraph in one line, as Typer keeps the line breaks of all but the first."""
    return "\n\n".join(" ".join(part.split("\n")) for part in (inspect.getdoc(command) or "").split("\n\n"))


class PlainTypes:
    """Of commands and groups: help names no type of an option without value, and no Python type."""

    def get_params(self, ctx: Any) -> Any:
        """The parameters; arguments are described by their texts alone."""
        params = super().get_params(ctx)  # type: ignore[misc]  # of Typer's class beside this one
        for each in params:
            if each.param_type_name == "argument":
                each.display_type_rich = lambda **_: None
            elif getattr(each, "is_flag", False) and each.metavar is None:
                each.metavar = ""
        return params


class Command(PlainTypes, typer.core.TyperCommand):
    """A command whose help fits the terminal."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Typer's plain help where its tables would cut the names of options."""
        from rich.console import Console
        from rich.text import Text

        if Console().width < LEAST_WIDTH:
            self.rich_markup_mode = None
            self.help = Text.from_markup(self.help or "").plain
        super().format_help(ctx, formatter)
