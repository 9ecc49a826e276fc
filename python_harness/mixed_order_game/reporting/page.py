"""The page: evidence and figures in one HTML file that asks no network for anything."""

import json
import platform
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import GameError
from ..extras import need
from ..files.writing import PAGE, RESULT, check_output, write_file
from ..fmu.build import SOURCE_OR_RESULT, GameSource, fmu_of
from ..fmu.model import Value, sources
from ..game.parameters import game_parameters
from ..names import parse_name
from ..results.graph_figure import edges_of, is_directed
from ..results.metrics import SETTLED
from ..results.result import Result, load
from ..version import package_version
from .evidence import Evidence, energy_so_far, evidence_of_game, evidence_of_result
from .figures import figures

TEMPLATE = "page.html.j2"
LONGEST_LIST = 400
"""Rows of a table of parameters; what exceeds them is counted."""


@dataclass(frozen=True)
class Report:
    """A page that was written."""

    path: Path
    evidence: Evidence

    @property
    def passed(self) -> bool:
        """Whether no claim fails."""
        return self.evidence.passed


def report(
    source: GameSource | Result,
    output: Path | str,
    *,
    changes: Mapping[str, Value] | None = None,
    claims: bool = True,
    stop_time: float | None = None,
    force: bool = False,
    progress: Callable[[str, float], None] | None = None,
) -> Report:
    """Write one HTML page about a game or a run: figures, claims, parameters. It needs no network.

    Parameters
    ----------
    source
        An FMU (.fmu), a game file (.toml), a game of the package by its name, a `Game`, a result file
        (.parquet, .csv), a `Result`; the paper's example for None.
    output
        The page (.html). It replaces a page, with `force` any file but the source; that is judged before any
        run.
    changes
        Start values in place of the FMU's own. The claims, which are about the game as it stands, are then
        left out.
    claims
        Whether the paper's claims are judged, which takes more and longer runs.
    stop_time
        End of the runs in s; default the FMU's.
    force
        Whether a file of another kind is replaced.
    progress
        Called with the name of a run and the part of it done, 0 to 1.

    Returns
    -------
    Report
        The path and what the page shows.

    Raises
    ------
    MissingPackageError
        Without the extra `report` (an ImportError, too).
    GameError, ModelError, VariableError, SimulationError
        As running and judging do; GameError for changes or a stop time of a stored run.
    ResultError
        If a stored run cannot be read or the page cannot be written.

    Examples
    --------
    >>> page = mog.report("rivalling_pairs", "rivals.html", claims=False)
    >>> page.path.name
    'rivals.html'
    """
    output = Path(output)
    inputs = [Path(source)] if isinstance(source, str | Path) else []
    check_output(output, PAGE, inputs=inputs, force=force)
    for module in ("jinja2", "plotly.offline"):
        need(module)  # before any run
    if isinstance(source, str | Path) and RESULT.takes(Path(source)):
        source = load(source)
    if isinstance(source, Result):
        if changes or stop_time is not None:
            raise GameError("a stored run takes neither parameters nor a stop time")
        evidence = evidence_of_result(source)
    else:
        fmu = fmu_of(source, SOURCE_OR_RESULT)
        evidence = evidence_of_game(
            fmu, changes=changes, claims=claims, stop_time=stop_time, progress=progress
        )
    page = render_page(evidence)
    write_file(output, PAGE, lambda file: file.write(page.encode()), inputs=inputs, force=force)
    return Report(output, evidence)


def render_page(evidence: Evidence) -> str:
    """The HTML text; equal evidence gives equal text."""
    jinja2 = need("jinja2")
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    drawn = list(figures(evidence))
    text: str = environment.get_template(TEMPLATE).render(
        title=evidence.result.title or "Stored run",
        plotly=need("plotly.offline").get_plotlyjs(),
        figures=drawn,
        figure_data=_script_json({figure.name: figure.as_json() for figure in drawn}),
        summary=_summary(evidence),
        verdict=None if evidence.validation is None else evidence.validation,
        notes=[*evidence.notes, *(() if evidence.validation is None else evidence.validation.notes)],
        settings=_settings(evidence),
        scalars=_scalars(evidence),
        players=_players(evidence),
        costs_have_expressions=evidence.model is not None and "cost" in evidence.model.expressions,
        edges=[
            f"{i}{'>' if is_directed(evidence.result) else '-'}{j}" + (f" ({w:g})" if w != 1.0 else "")
            for i, j, w in edges_of(evidence.result)
        ],
        others=_others(evidence.result),
        sources=() if evidence.model is None else sources(evidence.model),
        provenance=_provenance(evidence),
        messages=evidence.result.messages,
    )
    return text


def _script_json(value: object) -> str:
    """JSON that may stand inside a script element."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _summary(evidence: Evidence) -> list[tuple[str, str]]:
    """What is read first: name and figure."""
    result = evidence.result
    tiles = [
        ("players", str(result.players)),
        ("coordinates", str(result.dimension)),
        ("duration", f"{result.time[-1] - result.time[0]:g} s"),
    ]
    found = result.metrics
    if "nash_error" in result.columns:
        tiles.append(("|x - x*| at the end", f"{result.nash_error[-1]:.3g}"))
    tiles += [
        ("largest entry of x - x*, last fifth", f"{found.final_error:.3g}"),
        (f"settled to {SETTLED:.0%} after", _finite(found.settling_time, " s", "not settled")),
        ("overshoot", _finite(100.0 * found.overshoot, " %", "none")),
    ]
    if evidence.abscissa is not None:
        tiles.append(("predicted rate, unperturbed", f"{-evidence.abscissa:.4g} 1/s"))
    if not np.isnan(found.control_energy):
        tiles.append(("control energy", f"{found.control_energy:.4g}"))
    if not np.isnan(found.events):
        tiles.append(("sphere events", f"{found.events:.0f}"))
    return tiles


def _finite(value: float, unit: str, otherwise: str) -> str:
    return f"{value:.3g}{unit}" if np.isfinite(value) else otherwise


def _settings(evidence: Evidence) -> list[tuple[str, str, str]]:
    """Parameters that differ from the FMU's start values: name, value, start value."""
    model, result = evidence.model, evidence.result
    if model is None:
        return []
    return [
        (name, _number(value), _number(model.variable(name).start))
        for name, value in model.changed_values(result.parameters).items()
    ]


def _scalars(evidence: Evidence) -> list[tuple[str, str, str, str]]:
    """Parameters without an index: name, value, unit, meaning."""
    rows = []
    for name, value in evidence.result.parameters.items():
        if parse_name(name)[1]:
            continue
        variable = None if evidence.model is None else evidence.model.variables.get(name)
        unit = (variable.unit if variable else None) or evidence.result.units.get(name, "")
        rows.append(
            (name, _number(value), "" if unit == "1" else unit, variable.description if variable else "")
        )
    return rows


def _players(evidence: Evidence) -> list[dict[str, str]]:
    """One row a player: order, cost, start, equilibrium, end."""
    model, result = evidence.model, evidence.result
    if model is None:
        return []
    game = game_parameters(model, evidence.changes)
    energy = energy_so_far(result)[-1]
    rows = []
    for i in range(min(game.players, LONGEST_LIST)):
        coupling = game.cost_coupling[i]
        rows.append(
            {
                "player": f"{i + 1}: {model.player_names[i]}",
                "order": str(model.order[i]),
                "quadratic": _number(game.cost_quadratic[i]),
                "linear": _list(game.cost_linear[i]),
                "coupling": ", ".join(f"{j + 1}: {coupling[j]:g}" for j in np.flatnonzero(coupling)),
                "expression": model.game["player"][i].get("cost", {}).get("expression", ""),
                "x0": _list(game.x0[i]),
                "x_star": _list(result.x_star[i]),
                "end": _list(result.x[-1, i]),
                "energy": f"{energy[i]:.4g}",
            }
        )
    return rows


def _others(result: Result) -> list[tuple[str, str]]:
    """Indexed parameters that are not zero, for the record."""
    rows = [
        (name, _number(value)) for name, value in result.parameters.items() if parse_name(name)[1] and value
    ]
    if len(rows) > LONGEST_LIST:
        rows = [*rows[:LONGEST_LIST], ("...", f"and {len(rows) - LONGEST_LIST} more")]
    return rows


def _provenance(evidence: Evidence) -> list[tuple[str, str]]:
    result, model = evidence.result, evidence.model
    rows = [
        ("run by", f"mixed-order-game {result.package_version}" if result.package_version else "unknown"),
        ("page by", f"mixed-order-game {package_version()}"),
        ("FMU's GUID", result.guid or "unknown"),
    ]
    if model is not None:
        rows += [
            ("FMU", model.path.name),
            ("FMU made by", model.generation_tool),
            ("FMI version", model.fmi_version),
        ]
    rows += [
        ("step", f"{result.step:g} s"),
        ("relative tolerance", f"{result.tolerance:g}"),
        ("Python", platform.python_version()),
        ("platform", f"{platform.system()} {platform.machine()}"),
    ]
    for package in ("fmpy", "numpy", "plotly"):
        try:
            rows.append((package, version(package)))
        except PackageNotFoundError:
            continue
    return rows


def _number(value: Any) -> str:
    if isinstance(value, bool | np.bool_):
        return "true" if value else "false"
    return f"{float(value):.10g}"


def _list(values: Any) -> str:
    return ", ".join(f"{value:.5g}" for value in values)
