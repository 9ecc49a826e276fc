"""The page: evidence and figures in one HTML file that asks no network for anything."""

import base64
import gzip
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
from ..fmu.model import Model, Value, sources
from ..game.definition import named_parameters
from ..game.parameters import game_parameters
from ..names import parse_name
from ..notebook import digits
from ..results.graph_figure import edges_of, is_directed
from ..results.metrics import SETTLED
from ..results.result import Result, load
from ..theory.findings import Analysis
from ..version import package_version
from .evidence import Evidence, energy_so_far, evidence_of_game, evidence_of_result, thinned
from .expression_latex import name_in_latex
from .figures import Figure, figures
from .formulas import costs, disturbances, dynamics, loop

TEMPLATE = "page.html.j2"
SAMPLES = (2000, 1000, 500, 250, 125)
"""Most samples of a run that is drawn, tried one after the other."""

LARGEST_DATA = 900_000
"""Bytes of the packed data: the page is to stay below 3 MB, of which Plotly takes 1.9."""

MOST_FORMULAS = 24
"""Lines of costs, of dynamics and of disturbances; what exceeds them is counted."""

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
    for module in ("jinja2", "latex2mathml.converter", "plotly.offline"):
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
    drawn, data = _drawn(evidence)
    text: str = environment.get_template(TEMPLATE).render(
        title=evidence.result.title or "Stored run",
        plotly=_packed(need("plotly.offline").get_plotlyjs()),
        figures=drawn,
        figure_data=data,
        formulas=[] if evidence.model is None else _formulas(evidence.model),
        loop=[(name, _typeset(latex)) for name, latex in loop(evidence.model)],
        named_parameters=[] if evidence.model is None else _named_parameters(evidence.model),
        analysis=evidence.analysis,
        analysis_rows=[] if evidence.analysis is None else _analysis_rows(evidence.analysis),
        summary=_summary(evidence),
        verdict=None if evidence.validation is None else evidence.validation,
        notes=[*evidence.notes, *(() if evidence.validation is None else evidence.validation.notes)],
        settings=_settings(evidence),
        scalars=_scalars(evidence),
        players=_players(evidence),
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


def _drawn(evidence: Evidence) -> tuple[list[Figure], str]:
    """The figures, and their data packed: of as many samples as the page has room for."""
    for samples in SAMPLES:
        drawn = list(figures(thinned(evidence, samples)))
        values = {figure.name: figure.as_json() for figure in drawn}
        data = _packed(json.dumps(values, separators=(",", ":"), allow_nan=False))
        if len(data) <= LARGEST_DATA:
            break
    return drawn, data


def _packed(text: str) -> str:
    """Compressed, as base64: a third of the text's size; equal texts give equal bytes."""
    return base64.b64encode(gzip.compress(text.encode(), 9, mtime=0)).decode()


def _typeset(latex: str) -> str:
    """MathML, which browsers show without a script or a font of ours."""
    return str(need("latex2mathml.converter").convert(latex, display="block"))


def _formulas(model: Model) -> list[dict[str, Any]]:
    """Headings with their lines: of whom, and MathML."""
    parts = {
        "Costs": costs(model),
        "Unknown dynamics": dynamics(model),
        "Disturbances": disturbances(model),
    }
    return [
        {
            "title": title,
            "lines": [(line.whose, _typeset(line.latex)) for line in lines[:MOST_FORMULAS]],
            "more": max(0, len(lines) - MOST_FORMULAS),
        }
        for title, lines in parts.items()
        if lines
    ]


def _named_parameters(model: Model) -> list[tuple[str, str, str, str]]:
    """Named parameters of expressions: name, value, unit, meaning."""
    rows = []
    for each in named_parameters(model.game):
        if isinstance(each.value, list) and isinstance(each.value[0], list):
            value = "; ".join(", ".join(f"{entry:g}" for entry in row) for row in each.value)
        else:
            value = ", ".join(f"{entry:g}" for entry in np.atleast_1d(each.value))
        rows.append((_typeset(name_in_latex(each.name)), value, each.unit, each.description))
    return rows


def _analysis_rows(analysis: Analysis) -> list[tuple[str, str, str, str, str]]:
    """Figures of the analysis: section, name, value, unit, meaning."""
    return [
        (
            row.section,
            row.name,
            row.value if isinstance(row.value, str) else digits(row.value),
            "" if row.unit == "1" else row.unit,
            row.meaning,
        )
        for row in analysis.rows
    ]


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
        tiles.append(("events", f"{found.events:.0f}"))
    return tiles


def _finite(value: float, unit: str, otherwise: str) -> str:
    return f"{value:.3g}{unit}" if np.isfinite(value) else otherwise


def _settings(evidence: Evidence) -> list[tuple[str, str, str]]:
    """Parameters that differ from the FMU's start values: name, value, start value.

    From when on errors are judged is no property of what ran.
    """
    model, result = evidence.model, evidence.result
    if model is None:
        return []
    return [
        (name, _number(value), _number(model.variable(name).start))
        for name, value in model.changed_values(result.parameters).items()
        if name != "judge_from"
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
    """One row a player: order, start, equilibrium, end."""
    model, result = evidence.model, evidence.result
    if model is None:
        return []
    game = game_parameters(model, evidence.changes)
    energy = energy_so_far(result)[-1]
    return [
        {
            "player": f"{i + 1}: {model.player_names[i]}",
            "order": str(model.order[i]),
            "x0": _list(game.x0[i]),
            "x_star": _list(result.x_star[i]),
            "end": _list(result.x[-1, i]),
            "energy": f"{energy[i]:.4g}",
        }
        for i in range(min(game.players, LONGEST_LIST))
    ]


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
