"""Switching graphs and external disturbances from files: edges a[i,j] and inputs d_ext[i,l] over time.

A schedule of graphs is a TOML file with whole graphs or a CSV file with edge weights; disturbances are a CSV
file. Names in CSV headers contain commas and stand in double quotes; the csv module reads and writes them.
"""

import csv
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import MixedOrderGameError
from ..files.reading import ReadError, expect_file, number_of, read_table, read_text, suffix_of, toml_of
from ..files.writing import DISTURBANCE, GRAPH_SCHEDULE, Kind, write_file
from ..game.graphs import CommunicationGraph, edge_values, graphs_of_text
from ..names import parse_name
from .model import Model, Value, check_value

FloatArray = NDArray[np.float64]

LARGEST_ENTRIES = 1_000_000
"""Most entries of a schedule, repetitions included."""

TIME = "time"


class ScheduleError(MixedOrderGameError, ValueError):
    """A schedule or disturbance file that cannot be read or does not fit the game."""


@dataclass(frozen=True)
class GraphSchedule:
    """Edge weights to set at times, in s; a period repeats them. Weights by the FMU's names a[i,j].

    Before the first time the FMU's own graph is in force.
    """

    entries: tuple[tuple[float, Mapping[str, float]], ...]
    period: float | None = None

    def __post_init__(self) -> None:
        times = [time for time, _ in self.entries]
        if not times:
            raise ScheduleError("the schedule names no graph")
        if not all(np.isfinite(times)) or any(b <= a for a, b in pairwise(times)):
            raise ScheduleError("the times of the schedule do not go up")
        if self.period is not None and not (np.isfinite(self.period) and self.period > times[-1] - times[0]):
            raise ScheduleError(f"the period {self.period:g} s is not longer than the schedule")

    def start_values(self, start_time: float = 0.0) -> dict[str, Value]:
        """Edge weights in force at the beginning of the run, for start_values of a run; may be empty."""
        values: dict[str, Value] = {}
        for time, weights in self._between(start_time, start_time):
            if time <= start_time:
                values |= weights
        return values

    def changes(self, stop_time: float, start_time: float = 0.0) -> dict[float, dict[str, Value]]:
        """What is set between start and stop, for changes of a run."""
        return {
            time: dict(weights)
            for time, weights in self._between(start_time, stop_time)
            if start_time < time < stop_time
        }

    def _between(self, start: float, stop: float) -> Iterable[tuple[float, Mapping[str, float]]]:
        """Every entry until stop from the one before the repetition that holds start."""
        if self.period is None:
            yield from self.entries
            return
        first = self.entries[0][0]
        begin = max(0, int((start - first) / self.period) - 1)
        end = max(0, int((stop - first) / self.period)) + 1
        if (end - begin) * len(self.entries) > LARGEST_ENTRIES:
            raise ScheduleError(f"the period {self.period:g} s gives more than {LARGEST_ENTRIES} graphs")
        for k in range(begin, end):
            for time, weights in self.entries:
                yield time + k * self.period, weights


def graph_schedule(
    model: Model, graphs: Mapping[float, CommunicationGraph], *, period: float | None = None
) -> GraphSchedule:
    """A schedule of whole graphs by their time in s. Raises GraphError for a graph the game cannot take."""
    entries = tuple((float(time), graphs[time].start_values(model)) for time in sorted(graphs))
    return GraphSchedule(entries, period)


def read_graph_schedule(path: Path | str, model: Model) -> GraphSchedule:
    """Read a schedule of graphs, .toml or .csv, for a game.

    TOML: a table [[graph]] per switch with time in s and either edges = [[1, 2], [2, 3, 0.5]] or a kind such
    as graph = "ring" (see game.graph_kinds); optional period in s.
    CSV: the column time in s and columns a[i,j]; an empty cell keeps the weight, as does an edge without a
    column.
    Raises ScheduleError naming the file.
    """
    path = Path(path)
    readers = {".toml": _read_toml, ".csv": _read_edges}
    suffix = suffix_of(path)
    if suffix not in readers:
        raise ScheduleError(f"{path} must end in .toml or .csv")
    expect_file(path, "schedule", ScheduleError)
    try:
        return readers[suffix](path, model)
    except ReadError as error:
        raise ScheduleError(f"{path} cannot be read: {error}") from error
    except MixedOrderGameError as error:
        raise ScheduleError(f"{path}: {error}") from error


def _read_toml(path: Path, model: Model) -> GraphSchedule:
    data = toml_of(read_text(path))
    _known(data, {"graph", "period"}, "the schedule")
    tables = data.get("graph")
    if not isinstance(tables, list) or not tables or not all(isinstance(each, dict) for each in tables):
        raise ScheduleError("a table [[graph]] for every switch expected")
    entries = []
    for number, table in enumerate(tables, start=1):
        where = f"graph {number}"
        _known(table, {"time", "edges", "graph"}, where)
        time = _number(table.get("time"), f"the time of {where}")
        if ("edges" in table) == ("graph" in table):
            raise ScheduleError(f"{where} needs either edges or graph")
        if "edges" in table:
            weights = edge_values(model, _edges(table["edges"], model, where))
        else:
            chosen = graphs_of_text(str(table["graph"]), model.players)
            if len(chosen) != 1:
                raise ScheduleError(f"{where} = {table['graph']!r} stands for {len(chosen)} graphs")
            weights = chosen[0].start_values(model)
        entries.append((time, weights))
    period = None if "period" not in data else _number(data["period"], "the period")
    return GraphSchedule(tuple(entries), period)


def _edges(edges: Any, model: Model, where: str) -> dict[tuple[int, ...], float]:
    """Weights by the indices of a: [i, j] with i < j, or of a directed game [from, to] as to, from."""
    players = model.players
    weights: dict[tuple[int, ...], float] = {}
    if not isinstance(edges, list) or not all(
        isinstance(each, list) and len(each) in (2, 3) for each in edges
    ):
        raise ScheduleError(f"the edges of {where} are not a list of [i, j] and [i, j, weight]")
    for edge in edges:
        if not all(isinstance(end, int) and not isinstance(end, bool) for end in edge[:2]):
            raise ScheduleError(f"{edge} of {where} does not begin with two players")
        i, j = edge[1::-1] if model.directed else sorted(edge[:2])
        weight = _number(edge[2], f"the weight of {i}-{j}") if len(edge) > 2 else 1.0  # noqa: PLR2004 - [i, j, w]
        if i == j or not 1 <= min(i, j) <= max(i, j) <= players or weight < 0.0 or (i, j) in weights:
            raise ScheduleError(f"{edge} of {where} is no new edge of {players} players with a weight >= 0")
        weights[i, j] = weight
    return weights


def _read_edges(path: Path, model: Model) -> GraphSchedule:
    names, rows = _read_table(path)
    for name in names:
        if parse_name(name)[0] != "a":
            raise ScheduleError(f'the column {name} is not an edge such as "a[1,2]"')
        model.variable(name)
    entries = []
    for time, cells in rows:
        weights = {name: cell for name, cell in zip(names, cells, strict=True) if not np.isnan(cell)}
        for name, weight in weights.items():
            check_value(model.variable(name), weight, during_run=True)
        entries.append((time, weights))
    return GraphSchedule(tuple(entries))


@dataclass(frozen=True, eq=False)
class Disturbance:
    """External disturbance d_ext over time, to be given as inputs to a run: a function of the time in s.

    Between two rows it holds the earlier one, or goes straight if linear. 0 before the first row; the last
    row holds on. Raises ScheduleError for times that do not go up, values that are not finite, other shapes.
    """

    time: FloatArray  # (T,), s, going up
    values: FloatArray  # (T, N, D)
    linear: bool = False

    def __post_init__(self) -> None:
        _check_shapes(self.time, self.values)
        if not np.all(np.isfinite(self.time)) or np.any(np.diff(self.time) <= 0.0):
            raise ScheduleError("the times of the disturbance do not go up")
        if not np.all(np.isfinite(self.values)):
            raise ScheduleError("the disturbance must be finite")

    def __call__(self, time: float) -> FloatArray:
        """d_ext (N, D) at a time."""
        return self.at(time)[0]

    def at(self, time: float) -> tuple[FloatArray, FloatArray]:
        """d_ext (N, D) at a time, and its rate in 1/s from there on."""
        row = int(np.searchsorted(self.time, time, side="right")) - 1
        nothing = np.zeros(self.values.shape[1:])
        if row < 0:
            return nothing, nothing
        if not self.linear or row == len(self.time) - 1:
            return self.values[row], nothing
        rate = (self.values[row + 1] - self.values[row]) / (self.time[row + 1] - self.time[row])
        return self.values[row] + rate * (time - self.time[row]), rate


def read_disturbance(path: Path | str, model: Model, *, linear: bool = False) -> Disturbance:
    """Read d_ext for a game from a CSV file: the column time in s and columns d_ext[i,l].

    Inputs without a column are 0. Raises ScheduleError naming the file.
    """
    path = Path(path)
    if suffix_of(path) != ".csv":
        raise ScheduleError(f"{path} must end in .csv")
    expect_file(path, "disturbance file", ScheduleError)
    try:
        return _disturbance(path, model, linear=linear)
    except ReadError as error:
        raise ScheduleError(f"{path} cannot be read: {error}") from error
    except ScheduleError as error:
        raise ScheduleError(f"{path}: {error}") from error


def _disturbance(path: Path, model: Model, *, linear: bool) -> Disturbance:
    names, rows = _read_table(path)
    inputs = {variable.name: index for index, variable in model.indexed("d_ext").items()}
    values = np.zeros((len(rows), model.players, model.dimension))
    for column, name in enumerate(names):
        if name not in inputs:
            raise ScheduleError(f'{name} is not an external disturbance of the game such as "d_ext[1,2]"')
        i, k = inputs[name]
        values[:, i - 1, k - 1] = [cells[column] for _, cells in rows]
    if np.isnan(values).any():
        raise ScheduleError("a cell is empty")
    return Disturbance(np.array([time for time, _ in rows]), values, linear)


def write_disturbance(path: Path | str, time: ArrayLike, values: ArrayLike, *, force: bool = False) -> Path:
    """Write d_ext, time (T,) in s and values (T, N, D), as the CSV file that read_disturbance reads.

    Replaces a table of d_ext, with force any file. Raises ScheduleError for other shapes, ResultError if the
    file cannot be written or is not replaced.
    """
    times, array = np.asarray(time, dtype=np.float64), np.asarray(values, dtype=np.float64)
    _check_shapes(times, array)
    _, players, dimension = array.shape
    names = [f"d_ext[{i},{k}]" for i in range(1, players + 1) for k in range(1, dimension + 1)]
    rows = np.column_stack([times, array.reshape(len(times), -1)])
    return _write_table(path, DISTURBANCE, names, rows.tolist(), force=force)


def write_graph_schedule(path: Path | str, schedule: GraphSchedule, *, force: bool = False) -> Path:
    """Write a schedule without period as the CSV file that read_graph_schedule reads.

    Replaces a table of edges, with force any file. Raises ScheduleError for a schedule with a period,
    ResultError if the file cannot be written or is not replaced.
    """
    if schedule.period is not None:
        raise ScheduleError("a CSV file holds no period: write the entries of one run, or TOML")
    names = list(dict.fromkeys(name for _, weights in schedule.entries for name in weights))
    rows = [[time, *(weights.get(name, "") for name in names)] for time, weights in schedule.entries]
    return _write_table(path, GRAPH_SCHEDULE, names, rows, force=force)


def _check_shapes(time: FloatArray, values: FloatArray) -> None:
    if time.ndim != 1 or values.ndim != 3 or len(values) != len(time):  # noqa: PLR2004 - (T, N, D)
        raise ScheduleError(f"time {time.shape} and values {values.shape} are not (T,) and (T, N, D)")


def _read_table(path: Path) -> tuple[list[str], list[tuple[float, list[float]]]]:
    """Names of the columns but time, and rows (time, cells); NaN for an empty cell."""
    header, body = read_table(path)
    if not body:
        raise ScheduleError("there are no rows below the header")
    rows: list[tuple[float, list[float]]] = []
    for number, line in enumerate(body, start=2):
        cells = [float("nan") if not cell.strip() else _cell(cell, number) for cell in line]
        if np.isnan(cells[0]) or (rows and cells[0] <= rows[-1][0]):
            raise ScheduleError(f"the times do not go up at row {number}")
        rows.append((cells[0], cells[1:]))
    return header[1:], rows


def _write_table(
    path: Path | str, kind: Kind, names: Sequence[str], rows: Iterable[Sequence[object]], *, force: bool
) -> Path:
    import io

    def write(file: IO[bytes]) -> None:
        text = io.TextIOWrapper(file, encoding="utf-8", newline="")
        writer = csv.writer(text, quoting=csv.QUOTE_NONNUMERIC, lineterminator="\n")
        writer.writerow([TIME, *names])
        csv.writer(text, lineterminator="\n").writerows(rows)
        text.flush()
        text.detach()

    return write_file(path, kind, write, force=force)


def _cell(text: str, row: int) -> float:
    value = number_of(text, row)
    if not np.isfinite(value):
        raise ScheduleError(f"row {row}: {text!r} is not finite")
    return value


def _number(value: object, what: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        raise ScheduleError(f"{what} must be a number, not {value!r}")
    return float(value)


def _known(table: Mapping[str, Any], keys: set[str], where: str) -> None:
    unknown = sorted(table.keys() - keys)
    if unknown:
        raise ScheduleError(f"{where} has an unknown key {unknown[0]}")
