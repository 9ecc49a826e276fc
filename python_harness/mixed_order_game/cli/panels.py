"""How help looks: each option under the same heading in every command, paragraphs as wide as the terminal."""

import inspect
from collections.abc import Callable
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
        "settling_time", "strict",
    ),
    "What is written": (
        "arm_linux", "as_json", "figure", "file_format", "force", "heat_maps", "kinds", "output",
        "schema", "tables", "until", "variables", "width",
    ),
    "The page": ("browser", "port"),
}  # fmt: skip
"""Options by their parameters' names; others, --help among them, stand under Options."""


def grouped(command: Callable[..., None]) -> Callable[..., None]:
    """The command, its options put under their headings."""
    headings = {name: heading for heading, names in PANELS.items() for name in names}
    for name, parameter in inspect.signature(command).parameters.items():
        for each in get_args(parameter.annotation)[1:]:
            if isinstance(each, OptionInfo) and name in headings:
                each.rich_help_panel = headings[name]
    return command


def help_of(command: Callable[..., None]) -> str:
    """The docstring with each paragraph in one line, as Typer keeps the line breaks of all but the first."""
    return "\n\n".join(" ".join(part.split("\n")) for part in (inspect.getdoc(command) or "").split("\n\n"))


class PlainFlags:
    """Of commands and groups: options that take no value name no type in help."""

    def get_params(self, ctx: Any) -> Any:
        """The parameters, flags without the name of a type."""
        params = super().get_params(ctx)  # type: ignore[misc]  # of Typer's class beside this one
        for each in params:
            if getattr(each, "is_flag", False) and each.metavar is None:
                each.metavar = ""
        return params


class Command(PlainFlags, typer.core.TyperCommand):
    """A command whose flags name no type in help."""
