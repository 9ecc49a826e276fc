"""The interactive figures of a report, as Plotly's plain data.

Colour tells the player, line style the coordinate, as in the figures for papers.
"""

import base64
import html
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.colors import to_hex
from numpy.typing import NDArray

from ..errors import ResultError
from ..names import indices_of
from ..results.error_figure import BELOW_FLOOR, integrator_floor
from ..results.graph_figure import edges_of
from ..results.plane_figure import earlier_equilibria
from ..results.result import Result
from ..results.style import PALETTE
from ..results.time_figures import SMALLEST
from .evidence import Evidence, energy_so_far, shared_signal, sphere_switches, weight_bound

FloatArray = NDArray[np.float64]
Trace = dict[str, Any]

MOST_PLAYERS = 40
"""Players drawn one by one."""

MOST_LEGEND = 12
FRAMES = 160
DASHES = ("solid", "dash", "dot", "dashdot")
GREY = "#777777"
PLANE = 2
"""Coordinates that a plane needs."""

TRANSIENT = 3.0
"""Length of the transient as it is shown, in settling times."""

SHORT_TRANSIENT = 0.4
"""Part of the run below which the transient is offered as a range of its own."""

LATE = ("error", "consensus", "network")
"""Figures that begin with the whole run."""


@dataclass
class Figure:
    """One figure of the page: an id, what to read above and below it, Plotly's data and layout."""

    name: str
    title: str
    caption: str
    data: list[Trace]
    layout: dict[str, Any]
    frames: list[dict[str, Any]] = field(default_factory=list)
    options: list[str] = field(default_factory=list)  # the reader chooses one; a trace's meta is its position
    ranges: list[tuple[str, list[float]]] = field(default_factory=list)  # of the time axis, to choose from

    def as_json(self) -> dict[str, Any]:
        """What Plotly.newPlot takes."""
        return {
            "data": self.data,
            "layout": self.layout,
            "frames": self.frames,
            "ranges": [limits for _, limits in self.ranges],
        }


def figures(evidence: Evidence) -> Iterator[Figure]:
    """Every figure that the evidence allows."""
    makers = (_actions, _velocities, _plane, _error, _estimates, _consensus, _network, _weights, _control)
    for make in makers:
        try:
            figure = make(evidence)
        except ResultError:  # the run recorded other signals
            continue
        if figure is not None:
            _choose_range(figure, evidence.result)
            yield figure


def colours(count: int) -> list[str]:
    """The palette, or a perceptually even map if it does not suffice."""
    if count <= len(PALETTE):
        return list(PALETTE[:count])
    return [to_hex(mpl.colormaps["viridis"](value)) for value in np.linspace(0.0, 0.95, count)]


def _choose_range(figure: Figure, result: Result) -> None:
    """Whole run and, where it is short, the transient; figures of the transient begin with it."""
    if figure.name == "plane":
        return
    begin, end = float(result.time[0]), float(result.time[-1])
    figure.ranges = [("whole run", [begin, end])]
    settled = result.metrics.settling_time
    if 0.0 < TRANSIENT * settled < SHORT_TRANSIENT * (end - begin):
        figure.ranges.append(("transient", [begin, begin + TRANSIENT * settled]))
        if figure.name not in LATE:
            figure.ranges.reverse()
    figure.layout["xaxis"]["range"] = figure.ranges[0][1]


def _actions(evidence: Evidence) -> Figure:
    result = evidence.result
    data = _per_player(evidence, result.x, "x")
    palette = colours(result.players)
    for i in range(_drawn(result)):
        for k in range(result.dimension):
            time, level = _corners(result.time, result.equilibria[:, i, k])
            line = _line(time, level, f"x*[{i + 1},{k + 1}]", palette[i], width=0.8, opacity=0.6)
            line["line"]["shape"] = "vh"
            data.append(line | {"legendgroup": f"player {i + 1}", "showlegend": False, "hoverinfo": "skip"})
    caption = f"{_styles(result)}Thin lines: the Nash equilibrium x* of each time.{_left_out(result)}"
    return Figure("actions", "Actions", caption, data, _over_time("action x" + _unit(result, "x")))


def _corners(time: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The samples that a step line needs: the ends and those beside a change."""
    changes = np.flatnonzero(np.diff(values)) + 1
    kept = np.unique(np.concatenate([[0], changes - 1, changes, [len(time) - 1]]))
    return time[kept], values[kept]


def _velocities(evidence: Evidence) -> Figure | None:
    result = evidence.result
    if np.isnan(result.v).all():
        return None
    data = _per_player(evidence, result.v, "v")
    caption = f"Players of order 2. {_styles(result)}{_left_out(result)}"
    return Figure("velocities", "Velocities", caption, data, _over_time("velocity v" + _unit(result, "v")))


def _plane(evidence: Evidence) -> Figure | None:
    """Paths in the plane of the first two coordinates; frames move the players and the graph between them."""
    result = evidence.result
    if result.dimension < PLANE:
        return None
    N = _drawn(result)
    x = result.x[:, :N, :PLANE]
    palette = colours(result.players)[:N]
    edges = list(
        dict.fromkeys((min(i, j) - 1, max(i, j) - 1) for i, j, _ in edges_of(result) if max(i, j) <= N)
    )
    data: list[Trace] = [
        _line(x[:, i, 0], x[:, i, 1], _name(evidence, i), palette[i], width=1.5) for i in range(N)
    ]
    together = len(np.unique(np.round(result.x_star[:N, :PLANE], 12), axis=0)) == 1
    data.append(
        {
            "type": "scatter",
            "mode": "markers",
            "name": "equilibrium",
            "x": _packed(result.x_star[:N, 0]),
            "y": _packed(result.x_star[:N, 1]),
            "marker": {
                "symbol": "x",
                "size": 9,
                "color": "black" if together else list(palette),
                "line": {"color": "white", "width": 1},
            },
        }
    )
    earlier = earlier_equilibria(result, N)[:, :PLANE]
    if len(earlier):
        data.append(
            data[-1]
            | {
                "name": "equilibrium before",
                "x": _packed(earlier[:, 0]),
                "y": _packed(earlier[:, 1]),
                "marker": {"symbol": "x", "size": 9, "color": "#aaaaaa"},
            }
        )
    first_moment = _moment(x[0], edges, palette, text=N <= MOST_LEGEND)
    moving = list(range(len(data), len(data) + len(first_moment)))
    data += first_moment
    chosen = _moments(result.time, x)
    frames = [
        {
            "name": str(k),
            "traces": moving,
            "data": [
                {"x": each["x"], "y": each["y"]}
                for each in _moment(x[k], edges, palette, text=N <= MOST_LEGEND)
            ],
        }
        for k in chosen
    ]
    stop: dict[str, Any] = {"mode": "immediate", "frame": {"duration": 0, "redraw": False}}
    layout = _layout("x_i1" + _unit(result, "x"), "x_i2" + _unit(result, "x")) | {
        "height": 650,
        "updatemenus": [
            {
                "type": "buttons",
                "direction": "left",
                "showactive": False,
                "x": 0.0,
                "y": -0.12,
                "xanchor": "left",
                "yanchor": "top",
                "pad": {"t": 0, "r": 8},
                "buttons": [
                    {
                        "label": "Play",
                        "method": "animate",
                        "args": [
                            None,
                            {
                                "frame": {"duration": 40, "redraw": False},
                                "transition": {"duration": 0},
                                "fromcurrent": True,
                                "mode": "immediate",
                            },
                        ],
                    },
                    {"label": "Pause", "method": "animate", "args": [[None], stop]},
                ],
            }
        ],
        "sliders": [
            {
                "active": 0,
                "x": 0.0,
                "y": -0.12,
                "len": 1.0,
                "pad": {"t": 24},  # pixels: below the buttons, also where the page is narrow
                "currentvalue": {"prefix": "t = ", "suffix": " s", "xanchor": "right"},
                "ticklen": 0,
                "minorticklen": 0,
                "steps": [
                    {
                        "label": f"{result.time[k]:.2f}",
                        "method": "animate",
                        "args": [[str(k)], {**stop, "transition": {"duration": 0}}],
                    }
                    for k in chosen
                ],
            }
        ],
    }
    layout["margin"]["b"] = 140
    layout["showlegend"] = False  # the caption tells it
    layout["xaxis"]["constrain"] = layout["yaxis"]["constrain"] = "domain"
    layout["yaxis"]["scaleanchor"] = "x"
    first = " of the first two coordinates" if result.dimension > PLANE else ""
    before = ", grey ones before the costs changed" if len(earlier) else ""
    caption = (
        f"Paths in the plane{first}. Colour: player{', numbered at its start' if N <= MOST_LEGEND else ''}; "
        f"grey lines: the communication graph; crosses: the equilibrium{before}. Play moves the players, "
        f"faster through slow parts.{_left_out(result)}"
    )
    return Figure("plane", "Paths in the plane", caption, data, layout, frames=frames)


def _moment(
    x: FloatArray, edges: Sequence[tuple[int, int]], palette: Sequence[str], *, text: bool
) -> list[Trace]:
    """The graph, if there is one, and the players at one time, x (N, 2)."""
    ends = np.array([[x[i], x[j], [np.nan, np.nan]] for i, j in edges]).reshape(-1, 2)
    graph = _line(ends[:, 0], ends[:, 1], "communication", "#bbbbbb", width=1.0) | {"hoverinfo": "skip"}
    players: Trace = {
        "type": "scatter",
        "mode": "markers+text" if text else "markers",
        "name": "players",
        "showlegend": False,
        "x": _packed(x[:, 0]),
        "y": _packed(x[:, 1]),
        "text": [str(i + 1) for i in range(len(x))] if text else [],
        "textfont": {"color": "white", "size": 10},
        "marker": {"size": 17 if text else 9, "color": list(palette)},
        "hoverinfo": "skip",
    }
    return [graph, players] if edges else [players]


def _moments(time: FloatArray, x: FloatArray) -> list[int]:
    """Samples of the frames: even in the mean of time and of the way gone."""
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(x, axis=0)).max(axis=(1, 2)))])
    clock = (time - time[0]) / (time[-1] - time[0])
    progress = 0.5 * clock + 0.5 * (way / way[-1] if way[-1] > 0.0 else clock)
    chosen = np.searchsorted(progress, np.linspace(0.0, progress[-1], FRAMES))
    return [int(k) for k in np.unique(chosen)]


def _error(evidence: Evidence) -> Figure:
    result, plain = evidence.result, evidence.plain
    data = [_positive(result.time, result.nash_error, "this run", PALETTE[0])]
    caption = "Distance to the equilibrium, 2-norm over all players and coordinates."
    layout = _over_time("|x - x*|" + _unit(result, "x"))
    layout["yaxis"] |= {"type": "log", "exponentformat": "power"}
    if plain is not None:
        data.append(_positive(plain.time, plain.nash_error, "neither perturbed nor robust", PALETTE[1]))
    if plain is not None and evidence.abscissa is not None and evidence.abscissa < 0.0:
        anchor = int(np.argmax(plain.nash_error < 1e-3 * plain.nash_error[0]))
        predicted = plain.nash_error[anchor] * np.exp(evidence.abscissa * (plain.time - plain.time[anchor]))
        rate = f"{-evidence.abscissa:.3g}"
        shown = predicted > integrator_floor(plain)
        line = _line(plain.time[shown], predicted[shown], f"slowest rate {rate} 1/s", GREY, dash="dash")
        data.append(line)
        caption += (
            f" Dashed: exp(-{rate} t), the slowest rate in the spectrum of the linear loop, or of the loop "
            "linearized at x*, at which the run that is neither perturbed nor robust falls in the end, "
            "unless it starts without that mode."
        )
    caption += _shade(evidence, "nash_error", 1, data, layout)
    return Figure("error", "Distance to the equilibrium", caption, data, layout)


def _estimates(evidence: Evidence) -> Figure | None:
    result = evidence.result
    if not indices_of(result.columns, "y"):
        return None
    N, D = result.players, result.dimension
    palette = colours(N)
    y, shared = result.y, shared_signal(result)
    data: list[Trace] = []
    options: list[str] = []
    for j in range(N):
        for k in range(D):
            position = len(options)
            options.append(f"estimates of player {j + 1}" + (f", coordinate {k + 1}" if D > 1 else ""))
            lines = [
                _line(result.time, y[:, i, j, k], f"y[{i + 1},{j + 1},{k + 1}]", palette[i]) for i in range(N)
            ]
            if shared is not None:
                lines.append(
                    _line(result.time, shared[:, j, k], "shared signal", "black", width=2.0, dash="dash")
                )
            data += [_chosen(line, position) for line in lines]
    caption = (
        "Each player's estimate of the chosen player (colour: who estimates) and what that player shares."
    )
    layout = _over_time("estimate y" + _unit(result, "y"))
    return Figure("estimates", "Estimates", caption, data, layout, options=options)


def _consensus(evidence: Evidence) -> Figure:
    result = evidence.result
    data = [_positive(result.time, result["consensus_error"], "this run", PALETTE[0])]
    if evidence.plain is not None:
        plain = evidence.plain
        data.append(
            _positive(plain.time, plain["consensus_error"], "neither perturbed nor robust", PALETTE[1])
        )
    layout = _over_time("|y_ij - xbar_j|")
    layout["yaxis"] |= {"type": "log", "exponentformat": "power"}
    caption = "2-norm of all estimates' distances to the signals that the players share."
    caption += _shade(evidence, "consensus_error", result.players, data, layout)
    return Figure("consensus", "Disagreement of the estimates", caption, data, layout)


def _network(evidence: Evidence) -> Figure:
    result = evidence.result
    nn, phi = result.nn, result.phi
    data: list[Trace] = []
    options: list[str] = []
    for i in range(_drawn(result)):
        for k in range(result.dimension):
            index = f"[{i + 1},{k + 1}]"
            lines = [
                _line(result.time, nn[:, i, k], f"network nn{index}", PALETTE[0]),
                _line(result.time, phi[:, i, k], f"robust term phi{index}", PALETTE[2]),
                _line(
                    result.time,
                    nn[:, i, k] + phi[:, i, k],
                    f"nn{index} + phi{index}",
                    PALETTE[1],
                    dash="dash",
                ),
            ]
            if evidence.unknown is not None:
                unknown = evidence.unknown[:, i, k]
                lines.insert(0, _line(result.time, unknown, f"g{index} + d{index}", "black", width=2.0))
            data += [_chosen(line, len(options)) for line in lines]
            options.append(_name(evidence, i) + (f", coordinate {k + 1}" if result.dimension > 1 else ""))
    caption = (
        "What the network and the robust term put against the unknown term g + d: rejection is perfect where "
        f"nn + phi covers it. The two share the work: neither need match g + d alone.{_left_out(result)}"
    )
    title = "Network output against the unknown term"
    return Figure("network", title, caption, data, _over_time("drive"), options=options)


def _weights(evidence: Evidence) -> Figure:
    result = evidence.result
    norms = result.W_norm2
    data = _per_player(evidence, norms, "W_norm2")
    bound = weight_bound(result)
    palette = colours(result.players)
    if bound is not None:
        data.append(_line(result.time[[0, -1]], np.array([bound, bound]), "W_max", GREY, dash="dash"))
    switches = [each for each in sphere_switches(result) if each[1] < _drawn(result)]
    for enters, symbol, name in (
        (True, "triangle-up", "reaches the sphere"),
        (False, "triangle-down", "leaves it"),
    ):
        chosen = [each for each in switches if each[3] is enters]
        if chosen:
            data.append(
                {
                    "type": "scatter",
                    "mode": "markers",
                    "name": name,
                    "x": [float(result.time[t]) for t, *_ in chosen],
                    "y": [float(norms[t, i, k]) for t, i, k, _ in chosen],
                    "text": [f"W_norm2[{i + 1},{k + 1}] {name}" for _, i, k, _ in chosen],
                    "hovertemplate": "%{text}<br>t = %{x:.3f} s<extra></extra>",
                    "marker": {
                        "symbol": symbol,
                        "size": 11,
                        "color": [palette[i] for _, i, _, _ in chosen],
                        "line": {"color": "black", "width": 1},
                    },
                }
            )
    caption = f"{_styles(result)}Triangles: a column is seen to reach or leave the sphere w'w = W_max."
    layout = _over_time("w'w")
    if "solver_events" in result.columns:
        events = result["solver_events"]
        happened = np.flatnonzero(np.diff(events, prepend=events[0]) > 0.0)
        layout["shapes"] = [
            {
                "type": "line",
                "x0": float(result.time[t]),
                "x1": float(result.time[t]),
                "yref": "paper",
                "y0": 0.0,
                "y1": 0.03,
                "line": {"color": "black", "width": 1.5},
            }
            for t in happened
        ]
        caption += f" Ticks at the bottom: all {int(events[-1])} events, of whatever kind."
    return Figure("weights", "Weight norms", caption + _left_out(result), data, layout)


def _control(evidence: Evidence) -> Figure:
    result = evidence.result
    effort = np.linalg.norm(result.u, axis=2)
    energy = energy_so_far(result)
    palette = colours(result.players)
    data: list[Trace] = []
    for position, values in enumerate((effort, energy)):
        for i in range(_drawn(result)):
            line = _line(result.time, values[:, i], _name(evidence, i), palette[i])
            data.append(_chosen(line | {"showlegend": result.players <= MOST_LEGEND}, position))
    caption = (
        f"Per player: the 2-norm of u_i, or the integral of its square from the start.{_left_out(result)}"
    )
    layout = _over_time("control effort")
    options = ["size |u_i|", "energy, integral of |u_i|^2"]
    return Figure("control", "Control effort", caption, data, layout, options=options)


def _per_player(evidence: Evidence, values: FloatArray, stem: str) -> list[Trace]:
    """One line for each player and coordinate, values (T, N, D); a legend entry for each player."""
    result = evidence.result
    palette = colours(result.players)
    data: list[Trace] = []
    for i in range(_drawn(result)):
        known = [k for k in range(result.dimension) if not np.isnan(values[:, i, k]).all()]
        for k in known:
            line = _line(
                result.time, values[:, i, k], _name(evidence, i), palette[i], dash=DASHES[k % len(DASHES)]
            )
            line["legendgroup"] = f"player {i + 1}"
            line["showlegend"] = k == known[0] and result.players <= MOST_LEGEND
            line["hovertemplate"] = f"{stem}[{i + 1},{k + 1}] = %{{y:.5g}}<br>t = %{{x:.3f}} s<extra></extra>"
            data.append(line)
    return data


def _line(
    x: FloatArray,
    y: FloatArray,
    name: str,
    colour: str,
    *,
    width: float = 1.5,
    dash: str = "solid",
    opacity: float = 1.0,
) -> Trace:
    return {
        "type": "scatter",
        "mode": "lines",
        "name": html.escape(name),
        "x": _packed(x),
        "y": _packed(y),
        "line": {"color": colour, "width": width, "dash": dash},
        "opacity": opacity,
    }


def _positive(time: FloatArray, values: FloatArray, name: str, colour: str) -> Trace:
    """A line on a logarithmic axis, which has no 0."""
    return _line(time, np.maximum(values, SMALLEST), name, colour)


def _shade(evidence: Evidence, signal: str, copies: int, data: list[Trace], layout: dict[str, Any]) -> str:
    """Shade what lies within the integrator's tolerance, if a run goes there; returns the caption's part.

    copies: how often the signal, a 2-norm, counts the actions. The axis ends a little below the tolerance.
    """
    runs = [run for run in (evidence.result, evidence.plain) if run is not None]
    floors = [float(np.sqrt(copies)) * integrator_floor(run) for run in runs]
    reached = [k for k, run in enumerate(runs) if run[signal].min() < floors[k]]
    if not reached:
        return ""
    floor = floors[reached[-1]]
    ends = evidence.result.time[[0, -1]]
    data.insert(
        0,
        _line(ends, np.array([floor, floor]), "within the tolerance of integration", GREY, width=0.0)
        | {"fill": "tozeroy", "fillcolor": "rgba(119,119,119,0.18)", "hoverinfo": "skip"},
    )
    largest = max(float(run[signal].max()) for run in runs)
    layout["yaxis"]["range"] = [float(np.log10(BELOW_FLOOR * floor)), float(np.log10(2.0 * largest))]
    return f" Shaded: within the integrator's relative tolerance of {runs[reached[-1]].tolerance:g}."


def _chosen(trace: Trace, position: int) -> Trace:
    """A trace that is shown while an option is chosen; the first is at the start."""
    return trace | {"meta": position, "visible": position == 0}


def _packed(values: FloatArray) -> dict[str, str]:
    """Plotly's typed array: single precision is finer than a screen."""
    return {"dtype": "f4", "bdata": base64.b64encode(values.astype("<f4").tobytes()).decode()}


def _over_time(label: str) -> dict[str, Any]:
    return _layout("time (s)", label)


def _layout(x: str, y: str) -> dict[str, Any]:
    axis = {
        "zeroline": False,
        "gridcolor": "#e8e8e8",
        "linecolor": "#999999",
        "showline": True,
        "automargin": True,
    }
    return {
        "height": 420,
        "margin": {"l": 60, "r": 16, "t": 34, "b": 48},
        "font": {"family": "system-ui, sans-serif", "size": 13, "color": "#222222"},
        "plot_bgcolor": "white",
        "paper_bgcolor": "white",
        "hovermode": "closest",
        "legend": {"orientation": "h", "y": -0.2, "yanchor": "top", "x": 0.0},
        "xaxis": {**axis, "title": {"text": x, "standoff": 8}},
        "yaxis": {**axis, "title": {"text": y, "standoff": 12}},
    }


def _name(evidence: Evidence, i: int) -> str:
    """The player's own name where it is known."""
    if evidence.model is None:
        return f"player {i + 1}"
    return evidence.model.player_names[i]


def _drawn(result: Result) -> int:
    """Players that are drawn one by one."""
    return min(result.players, MOST_PLAYERS)


def _left_out(result: Result) -> str:
    more = result.players > MOST_PLAYERS
    return f" The first {MOST_PLAYERS} of {result.players} players are drawn." if more else ""


def _styles(result: Result) -> str:
    """What colours and line styles mean."""
    return "Colour: player; line style: coordinate. " if result.dimension > 1 else "Colour: player. "


def _unit(result: Result, stem: str) -> str:
    """The unit of a signal in brackets; nothing for a dimensionless one."""
    unit = result.unit(stem)
    return f" ({unit})" if unit not in ("", "1") else ""
