"""What the command prints: tables of a model, a result and a verdict, on stdout."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.box import SIMPLE_HEAD as LINES
from rich.table import Table
from rich.text import Text

from ..errors import ResultError
from ..fmu.model import Model, sources
from ..fmu.parts import longest_sampled_step
from ..game.definition import PARTS, NamedParameter, named_parameters
from ..game.equilibrium import judge_equilibrium
from ..results.result import Result
from ..studies.claims.verdict import Verdict
from .printing import show, standard_output

if TYPE_CHECKING:
    from ..studies.validate import Validation  # whose claims bring SciPy

LONGEST_LIST = 20


def print_info(model: Model, *, variables: bool = False) -> None:
    """Print what an FMU says about itself."""
    console = standard_output()
    data = info_data(model, variables=variables)
    grid = Table.grid(padding=(0, 2))
    for key in ("title", "fmu", "guid", "generation_tool", "players", "dimension", "neurons"):
        grid.add_row(key.replace("_", " "), Text(str(data[key])))
    grid.add_row("orders", _orders(model.order))
    sign = ">" if model.directed else "-"
    edges = ", ".join(f"{i}{sign}{j}" + (f" ({w:g})" if w != 1.0 else "") for i, j, w in model.edges)
    grid.add_row("graph", Text(edges))
    grid.add_row("gains", ", ".join(f"{name} = {value:g}" for name, value in model.gains.items()))
    for name, told in _particulars(model, data):
        grid.add_row(name, told)
    grid.add_row("experiment", f"{model.stop_time:g} s, step {model.step:g} s, tolerance {model.tolerance:g}")
    counts = ", ".join(f"{count} {kind}" for kind, count in data["variable_counts"].items())
    grid.add_row("variables", counts)
    show(grid, console)

    parameters = named_parameters(model.game)
    if parameters:
        table = Table("parameter", "value", "range", "unit", "meaning", box=LINES)
        for each in parameters:
            row = (
                each.name,
                _parameter_value(each),
                _range(each.min, each.max),
                each.unit,
                each.description,
            )
            table.add_row(*map(Text, row))
        show(table, console)

    origins = sources(model)
    if origins:
        table = Table("values", "variables", "source", box=LINES)
        for source in origins:
            table.add_row(source.group, ", ".join(source.names), source.source)
        show(table, console)

    kinds = list(model.capabilities)
    table = Table("capability", *kinds, box=LINES)
    for name in dict.fromkeys(name for kind in kinds for name in model.capabilities[kind]):
        table.add_row(name, *(_plain(model.capabilities[kind].get(name, "-")) for kind in kinds))
    show(table, console)

    if variables:
        table = Table("variable", "causality", "variability", "start", "range", "unit", "meaning", box=LINES)
        for entry in model.variables.values():
            start = "" if entry.start is None else _plain(entry.start)
            limits = _range(entry.minimum, entry.maximum)
            cells = (entry.name, entry.causality, entry.variability, start, limits, entry.unit or "")
            table.add_row(*map(Text, cells), Text(entry.description))
        show(table, console)


def _particulars(model: Model, data: dict[str, Any]) -> Iterator[tuple[str, str | Text]]:
    """What not every FMU has: expressions, what it waits for, an equilibrium that it knows."""
    for part, numbers in model.expressions.items():
        yield "expressions", f"{PARTS[part]} of {_counted(numbers, model.players)}"
    if model.elsewhere:
        yield "elsewhere", f"players {', '.join(map(str, model.elsewhere))}"
    for number, step in longest_sampled_step(model).items():
        yield (
            "external plant",
            (
                f"of player {number}: communication steps below {0.5 * step:.2g} s, "
                f"{step:.2g} s if it steps after the FMU"
            ),
        )
    if found := data["equilibrium"]:
        yield "equilibrium", Text(" ".join(dict.fromkeys([found["sentence"], *found["warnings"]])))


def info_data(model: Model, *, variables: bool = False) -> dict[str, Any]:
    """The same as plain values for json.dumps."""
    equilibrium = judge_equilibrium(model.path)
    data: dict[str, Any] = {
        "title": model.title,
        "fmu": str(model.path),
        "guid": model.guid,
        "generation_tool": model.generation_tool,
        "fmi_version": model.fmi_version,
        "players": model.players,
        "dimension": model.dimension,
        "neurons": model.neurons,
        "order": list(model.order),
        "player_names": list(model.player_names),
        "edges": [list(edge) for edge in model.edges],
        "gains": model.gains,
        "named_parameters": [asdict(each) for each in named_parameters(model.game)],
        "expressions": {part: list(numbers) for part, numbers in model.expressions.items()},
        "equilibrium": equilibrium.as_json() if equilibrium else None,
        "stop_time": model.stop_time,
        "step": model.step,
        "tolerance": model.tolerance,
        "paper_example": model.is_paper_example,
        "sources": [
            {"group": source.group, "variables": list(source.names), "source": source.source}
            for source in sources(model)
        ],
        "variable_counts": dict(Counter(variable.causality for variable in model.variables.values())),
        "capabilities": {kind: dict(flags) for kind, flags in model.capabilities.items()},
    }
    if variables:
        data["variables"] = [vars(variable) for variable in model.variables.values()]
    return data


def print_result(result: Result) -> None:
    """Print where a run ended: each player's action, velocity and distance to the equilibrium."""
    console = standard_output()
    console.print(Text(repr(result)))
    try:
        x, v, x_star = result.x[-1], result.v[-1], result.x_star
    except ResultError:
        return  # the run recorded other variables; the line above names their number
    table = Table("player", "x", "v", "x*", "|x - x*|", box=LINES)
    for i in range(result.players):
        velocity = "" if np.isnan(v[i]).all() else _numbers(v[i])
        distance = float(np.linalg.norm(x[i] - x_star[i]))
        table.add_row(str(i + 1), _numbers(x[i]), velocity, _numbers(x_star[i]), f"{distance:.2e}")
    show(table, console)


def result_data(result: Result) -> dict[str, Any]:
    """The same as plain values for json.dumps; None where a player has no velocity or nothing is known."""
    data: dict[str, Any] = {
        "title": result.title,
        "start_time": float(result.time[0]),
        "stop_time": float(result.time[-1]),
        "samples": len(result.time),
        "signals": len(result.columns),
        "changed": dict(result.changed),
        "messages": list(result.messages),
    }
    try:
        x, v, x_star = result.x[-1], result.v[-1], result.x_star
    except ResultError:
        return data
    return {
        **data,
        "metrics": result.metrics.as_json(),
        "players": [
            {
                "player": i + 1,
                "x": x[i].tolist(),
                "v": None if np.isnan(v[i]).all() else v[i].tolist(),
                "x_star": x_star[i].tolist(),
                "distance": float(np.linalg.norm(x[i] - x_star[i])),
            }
            for i in range(result.players)
        ],
    }


VERDICT_STYLES = {
    Verdict.HOLDS: "green",
    Verdict.FAILS: "bold red",
    Verdict.NOT_COVERED: "yellow",
    Verdict.NOT_SETTLED: "yellow",
}


def print_validation(validation: "Validation") -> None:
    """Print every claim with its verdict and the reason."""
    console = standard_output()
    console.print(Text(validation.model.title, style="bold"))
    show(claims_table(validation), console)
    for note in validation.notes:
        console.print(Text(note))
    console.print(Text(validation.summary() + "."))


def claims_table(validation: "Validation") -> Table:
    """Verdict, claim and reason, a row each; every cell wraps."""
    table = Table("", "claim", "reason", box=LINES)
    for claim in validation.claims:
        verdict = Text(claim.verdict.value, style=VERDICT_STYLES[claim.verdict])
        table.add_row(verdict, Text(claim.statement), Text(claim.reason))
    return table


def _orders(order: Sequence[int]) -> str:
    """Orders as 1,1,2; many of them as 30 x 1, 30 x 2."""
    if len(order) <= LONGEST_LIST:
        return ",".join(map(str, order))
    return ", ".join(f"{len(list(run))} x {value}" for value, run in groupby(order))


def _counted(numbers: Sequence[int], players: int) -> str:
    """Players by their numbers: all players, player 2, players 1, 3."""
    if len(numbers) == players:
        return "all players"
    told = ", ".join(map(str, numbers[:LONGEST_LIST])) + (", ..." if len(numbers) > LONGEST_LIST else "")
    return f"player{'s' if len(numbers) > 1 else ''} {told}"


def _parameter_value(parameter: NamedParameter) -> str:
    value = parameter.value
    if not isinstance(value, list):
        text = f"{value:g}"
    elif isinstance(value[0], list):
        text = f"{len(value)} x {len(value[0])}"
    elif len(value) <= LONGEST_LIST:
        text = f"[{', '.join(f'{entry:g}' for entry in value)}]"
    else:
        text = f"a list of {len(value)}"
    return f"{text}, fixed" if parameter.fixed else text


def _range(low: float | None, high: float | None) -> str:
    bounds = (low, high)
    return "" if bounds == (None, None) else " to ".join("" if b is None else f"{b:g}" for b in bounds)


def _numbers(values: Any) -> str:
    return ", ".join(f"{value:.5g}" for value in values)


def _plain(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:g}" if isinstance(value, float) else str(value)
