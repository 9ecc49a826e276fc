"""The trajectories of one run as NumPy arrays, their files and their conversions.

N players, D coordinates, q neurons, T samples. Actions carry the game's own length unit, time is in s.
"""

import csv
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import NotRecordedError, ResultError, reason
from ..extras import need
from ..files.reading import ReadError, expect_file, number_of, read_table, suffix_of
from ..files.writing import RESULT, write_file
from ..names import indices_of, parse_name
from ..notebook import digits, folded, page, paragraph, table
from ..times import in_seconds, time_slack
from .metrics import (
    JUDGED,
    METRIC_UNITS,
    Metrics,
    final_begin,
    judged_metrics,
    sampled_metrics,
    settling_time,
)

if TYPE_CHECKING:
    import pandas as pd
    import xarray
    from matplotlib.axes import Axes


FloatArray = NDArray[np.float64]

METADATA_KEY = b"mixed_order_game"
MOST_SHOWN = 10
"""Players whose ends a notebook lists."""

DIMENSIONS = {
    1: ("player",),
    2: ("player", "coordinate"),
}
SPECIAL_DIMENSIONS = {
    "y": ("player", "estimated_player", "coordinate"),
    "W": ("player", "neuron", "coordinate"),
}


@dataclass(frozen=True, eq=False, repr=False)
class Result:
    """Samples of one run. What a CSV file cannot hold (parameters and below) is empty when read from one."""

    time: FloatArray  # (T,), s
    columns: Mapping[str, FloatArray]  # variable name -> (T,)
    units: Mapping[str, str] = field(default_factory=dict)
    parameters: Mapping[str, float | bool] = field(
        default_factory=dict
    )  # all parameters and inputs at the start
    title: str = ""
    guid: str = ""
    package_version: str = ""
    stop_time: float = float("nan")  # s
    step: float = float("nan")  # s
    tolerance: float = float("nan")  # relative
    messages: tuple[str, ...] = ()  # what the FMU logged
    changed: Mapping[str, float | bool] = field(
        default_factory=dict
    )  # parameters and inputs that differ from the FMU's start values
    seed: int | None = None  # of whatever was drawn for the run; None if nothing was

    def __post_init__(self) -> None:
        for name, column in self.columns.items():
            if column.shape != self.time.shape:
                raise ResultError(f"{name} has {column.shape} samples, time has {self.time.shape}")

    def __repr__(self) -> str:
        span = f"{self.time[0]:.15g} to {in_seconds(self.time[-1])}" if len(self.time) else "empty"
        error = (
            f", nash_error {self['nash_error'][-1]:.3g} at the end" if "nash_error" in self.columns else ""
        )
        title = f"{self.title}: " if self.title else ""
        return f"<Result {title}{len(self.time)} samples, {span}, {len(self.columns)} signals{error}>"

    def __getitem__(self, name: str) -> FloatArray:
        """(T,) samples of one variable, such as result["x[1,2]"]. Raises ResultError if not recorded."""
        try:
            return self.columns[name]
        except KeyError:
            found = indices_of(self.columns, name)
            if found:
                first = next(iter(found.values()))
                raise NotRecordedError(f"{name} has indices: name one variable, such as {first}") from None
            raise NotRecordedError(f"{name} was not recorded: name it in the outputs of the run") from None

    def _repr_html_(self) -> str:
        """For notebooks: where the run ended, what is measured on it, what it holds."""
        parts = [paragraph(repr(self)[1:-1])]
        stems = {parse_name(name)[0] for name in self.columns}
        if {"x", "x_star"} <= stems:
            parts += [self._ends(), self._figures()]
        if self.changed:
            parts.append(paragraph("changed: " + ", ".join(f"{k} = {v}" for k, v in self.changed.items())))
        parts.append(folded(f"{len(self.columns)} signals", paragraph(", ".join(self.columns))))
        return page(self.title or "Stored run", *parts)

    def _ends(self) -> str:
        x, x_star = self.x[-1], self.x_star
        shown = min(self.players, MOST_SHOWN)
        rows = [
            (
                str(i + 1),
                ", ".join(map(digits, x[i])),
                ", ".join(map(digits, x_star[i])),
                digits(float(np.linalg.norm(x[i] - x_star[i]))),
            )
            for i in range(shown)
        ]
        more = [] if shown == self.players else [(f"and {self.players - shown} more", "", "", "")]
        return table(["player", "x at the end", "x*", "|x - x*|"], [*rows, *more])

    def _figures(self) -> str:
        found = self.metrics
        rows = [
            (name.replace("_", " "), digits(getattr(found, name)), unit)
            for name, unit in METRIC_UNITS.items()
        ]
        return table(["figure", "value", "unit"], rows)

    @property
    def players(self) -> int:
        """N, from the names of the actions."""
        return max(index[0] for index in self._actions)

    @property
    def dimension(self) -> int:
        """D, from the names of the actions."""
        return max(index[1] for index in self._actions)

    @property
    def _actions(self) -> Mapping[tuple[int, ...], str]:
        found = indices_of(self.columns, "x_star") or indices_of(self.columns, "x")
        if not found:
            raise NotRecordedError("neither x_star nor x was recorded: the number of players is unknown")
        return found

    @property
    def x(self) -> FloatArray:
        """Actions, (T, N, D). Like every signal below: raises ResultError if not recorded."""
        return self._signal("x")

    @property
    def v(self) -> FloatArray:
        """Velocities, (T, N, D), 1/s; NaN for order 1, or everywhere if no player has order 2."""
        if not indices_of(self.columns, "v") and self._all_first_order:
            return np.full((len(self.time), self.players, self.dimension), np.nan)
        return self._signal("v")

    @property
    def _all_first_order(self) -> bool:
        """Whether it is known that no player has order 2."""
        references = len(indices_of(self.columns, "z")) == self.players * self.dimension
        return references or (bool(self.parameters) and not indices_of(self.parameters, "v0"))

    @property
    def z(self) -> FloatArray:
        """References, (T, N, D); NaN for order 2, or everywhere if no player has order 1."""
        if not indices_of(self.columns, "z") and self._all_second_order:
            return np.full((len(self.time), self.players, self.dimension), np.nan)
        return self._signal("z")

    @property
    def _all_second_order(self) -> bool:
        """Whether it is known that no player has order 1."""
        velocities = len(indices_of(self.columns, "v")) == self.players * self.dimension
        return velocities or (bool(self.parameters) and not indices_of(self.parameters, "z0"))

    @property
    def xbar(self) -> FloatArray:
        """What players share, (T, N, D): the reference z of order 1, the action x of order 2."""
        return np.where(np.isnan(self.z), self.x, self.z)

    @property
    def u(self) -> FloatArray:
        """Controls, (T, N, D)."""
        return self._signal("u")

    @property
    def phi(self) -> FloatArray:
        """Robust terms, (T, N, D)."""
        return self._signal("phi")

    @property
    def nn(self) -> FloatArray:
        """Outputs of the RBF networks W_i^T S_i, (T, N, D)."""
        return self._signal("nn")

    @property
    def W_norm2(self) -> FloatArray:
        """w'w of every weight column, (T, N, D)."""
        return self._signal("W_norm2")

    @property
    def y(self) -> FloatArray:
        """Estimates, (T, N, N, D): y[:, i, j] is player i's estimate of player j; recorded only on demand."""
        return self._array("y", (self.players, self.players, self.dimension))

    @property
    def W(self) -> FloatArray:
        """Weights, (T, N, q, D); recorded only on demand."""
        neurons = max((index[1] for index in indices_of(self.columns, "W")), default=0)
        return self._array("W", (self.players, neurons, self.dimension))

    @property
    def x_star(self) -> FloatArray:
        """Nash equilibrium of the costs in force at the end of the run, (N, D)."""
        return np.asarray(self._signal("x_star")[-1])

    @property
    def equilibria(self) -> FloatArray:
        """Nash equilibrium at each sample, (T, N, D), of the costs in force there."""
        return self._signal("x_star")

    @property
    def nash_error(self) -> FloatArray:
        """2-norm of x - x*, (T,), x* of the costs in force at each time."""
        return self["nash_error"]

    def unit(self, stem: str) -> str:
        """Unit of a signal, such as "1/s or 1/s2" for u of players of both orders; empty if none is known."""
        return " or ".join(sorted({self.units[name] for name in indices_of(self.units, stem).values()}))

    def largest_error(self, begin: float = -np.inf, end: float = np.inf) -> float:
        """Largest |x_il - x*_il| over players, coordinates and the samples in [begin, end], in s."""
        return _largest(self.x - self.equilibria, self.window(begin, end))

    def largest_velocity(self, begin: float = -np.inf, end: float = np.inf) -> float:
        """Largest |v_il| over second-order players and the samples in [begin, end]; 0 if all have order 1."""
        return _largest(np.nan_to_num(self.v), self.window(begin, end))

    @property
    def metrics(self) -> Metrics:
        """Settling time, overshoot, control energy, final error, events; raises as measured does."""
        return self.measured()

    def measured(self, *, band: float | None = None, settle_time: float | None = None) -> Metrics:
        """The metrics, as the FMU judged the run; by the samples where it did not, or not so.

        band: norm of x - x* that counts as settled; default that of the run, 2 % of the initial one.
        settle_time: time in s from which the final error is taken; default that of the run, its last fifth.
        Raises ResultError if the FMU did not judge the run and x or x_star was not recorded, or if nothing
        was from settle_time on.
        """
        count = self.columns.get("solver_events")
        events = float("nan") if count is None else float(count[-1])
        if not self.columns.keys() >= {*JUDGED, "nash_error"}:
            return self._sampled(events, band, settle_time)
        judged = judged_metrics(
            {name: float(self[name][-1]) for name in JUDGED},
            initial_error=float(self.nash_error[0]),
            band=float(self.parameters.get("settling_band", 0.0)),
            events=events,
        )
        from_then = float(self.parameters.get("judge_from", final_begin(self.time[0], self.time[-1], None)))
        if band is not None and band != judged.band:
            settling = settling_time(self.time, self.nash_error, band)
            judged = replace(judged, settling_time=settling, band=band)
        if settle_time is not None and settle_time != from_then:
            judged = replace(judged, final_error=self.largest_error(settle_time))
        return judged

    def _sampled(self, events: float, band: float | None, settle_time: float | None) -> Metrics:
        return sampled_metrics(
            self.time,
            self.x - self.equilibria,
            self.u if indices_of(self.columns, "u") else None,
            events=events,
            band=band,
            settle_time=settle_time,
        )

    def window(self, begin: float, end: float) -> NDArray[np.bool_]:
        """(T,), true for samples in [begin, end], in s, rounding forgiven. Raises ResultError if none is."""
        slack = time_slack(*self.time[[0, -1]]) if len(self.time) else 0.0
        chosen = (self.time >= begin - slack) & (self.time <= end + slack)
        if not chosen.any():
            raise ResultError(f"there is no sample from {begin:.15g} to {in_seconds(end)}")
        return chosen

    def _signal(self, stem: str) -> FloatArray:
        return self._array(stem, (self.players, self.dimension))

    def _array(self, stem: str, shape: tuple[int, ...]) -> FloatArray:
        array = gather(self.columns, stem, shape)
        if array is None:
            raise NotRecordedError(f"{stem} was not recorded: name it in the outputs of the run")
        return array

    def plot(self, kind: str = "positions", axes: "Axes | None" = None, *, width: float = 3.5) -> "Axes":
        """Draw one figure of the run.

        Parameters
        ----------
        kind
            What is drawn, one of `mixed_order_game.results.plot.KINDS`: positions, velocities, error, plane,
            graph, control, weights or estimates.
        axes
            Matplotlib axes to draw into; a figure of its own when left out.
        width
            Width of a figure of its own in inches; 3.5 is a column of a two-column paper.

        Returns
        -------
        matplotlib.axes.Axes
            The axes; `results.plot.save_figure` writes them as PDF, SVG or PNG.

        Raises
        ------
        MissingPackageError
            If Matplotlib is not installed.
        PlotError
            For another kind, and for a figure that this game does not have.
        ResultError
            If a signal that it needs was not recorded.

        Examples
        --------
        >>> result = mog.run(stop_time=0.5)
        >>> result.plot("error").get_yscale()
        'log'
        """
        need("matplotlib")
        from .plot import draw

        return draw(self, kind, axes, width=width)

    def to_pandas(self) -> "pd.DataFrame":
        """One row a sample, indexed by time, one column a variable."""
        pandas = need("pandas")
        frame: pd.DataFrame = pandas.DataFrame(dict(self.columns), index=pandas.Index(self.time, name="time"))
        return frame

    def to_xarray(self) -> "xarray.Dataset":
        """One array a signal, dimensions time, player, coordinate, ...; 1-based labels; NaN where none is."""
        package = need("xarray")
        arrays: dict[str, Any] = {}
        labels: dict[str, FloatArray | NDArray[np.int_]] = {"time": self.time}
        for stem in dict.fromkeys(parse_name(name)[0] for name in self.columns):
            found = indices_of(self.columns, stem)
            rank = len(next(iter(found)))
            if rank == 0:
                arrays[stem] = ("time", self.columns[stem], {"units": self.unit(stem)})
                continue
            dimensions = SPECIAL_DIMENSIONS.get(stem, DIMENSIONS.get(rank))
            if dimensions is None:
                raise ResultError(f"{stem} has {rank} indices, which have no names")
            sizes = {"player": self.players, "estimated_player": self.players, "coordinate": self.dimension}
            shape = [sizes.get(name) or max(i[k] for i in found) for k, name in enumerate(dimensions)]
            labels |= {name: np.arange(1, size + 1) for name, size in zip(dimensions, shape, strict=True)}
            values = self._array(stem, tuple(shape))
            arrays[stem] = (("time", *dimensions), values, {"units": self.unit(stem)})
        dataset: xarray.Dataset = package.Dataset(arrays, coords=labels, attrs=self._metadata(flat=True))
        return dataset

    def save(self, path: Path | str, *, force: bool = False) -> Path:
        """Write a .csv file (values only) or a .parquet file (with the metadata). Returns the path.

        Values are exact in both. Replaces a result, with force any file. Raises ResultError for another
        suffix and for a file that cannot be written or is not replaced.
        """
        write = self._write_csv if suffix_of(path) == ".csv" else self._write_parquet
        return write_file(path, RESULT, write, force=force)

    def _write_csv(self, file: IO[bytes]) -> None:
        import io

        text = io.TextIOWrapper(file, encoding="utf-8", newline="")
        writer = csv.writer(text, quoting=csv.QUOTE_NONNUMERIC, lineterminator="\n")
        writer.writerow(["time", *self.columns])
        writer.writerows(np.column_stack([self.time, *self.columns.values()]).tolist())
        text.flush()
        text.detach()

    def _write_parquet(self, file: IO[bytes]) -> None:
        table = need("pyarrow").table({"time": self.time, **self.columns})
        metadata = json.dumps(self._metadata()).encode()
        need("pyarrow.parquet").write_table(table.replace_schema_metadata({METADATA_KEY: metadata}), file)

    def _metadata(self, *, flat: bool = False) -> dict[str, Any]:
        stems = {parse_name(name)[0] for name in self.columns}
        metadata: dict[str, Any] = {
            "title": self.title,
            "guid": self.guid,
            "package_version": self.package_version,
            "stop_time": self.stop_time,
            "step": self.step,
            "tolerance": self.tolerance,
        }
        nested = {
            "parameters": dict(self.parameters),
            "changed": dict(self.changed),
            "seed": self.seed,
            "metrics": self.metrics.as_json() if {"x", "x_star"} <= stems or {*JUDGED} <= stems else {},
            "units": dict(self.units),
            "messages": list(self.messages),
        }
        return metadata | ({name: json.dumps(each) for name, each in nested.items()} if flat else nested)


def gather(
    columns: Mapping[str, NDArray[np.float64]], stem: str, shape: Sequence[int]
) -> NDArray[np.float64] | None:
    """Columns stem[i,...] of (T,) samples as one array (T, *shape), NaN where there is no column.

    None if no column of that stem exists.
    """
    found = indices_of(columns, stem)
    if not found:
        return None
    samples = len(columns[next(iter(found.values()))])
    array = np.full((*shape, samples), np.nan)
    for index, name in found.items():
        array[tuple(position - 1 for position in index)] = columns[name]
    return np.ascontiguousarray(np.moveaxis(array, -1, 0))


def load(path: Path | str) -> Result:
    """Read a result that `Result.save` or `mog run` wrote.

    Parameters
    ----------
    path
        A .parquet file, or a .csv file, which holds the values alone.

    Returns
    -------
    Result

    Raises
    ------
    ResultError
        If the file is missing (a FileNotFoundError, too) or is no result.

    Examples
    --------
    >>> path = mog.run("rivalling_pairs", stop_time=0.1).save("rivals.csv")
    >>> mog.load(path).x.shape
    (6, 4, 2)
    """
    path = Path(path)
    readers = {".csv": _read_csv, ".parquet": _read_parquet}
    suffix = suffix_of(path)
    if suffix not in readers:
        raise ResultError(f"{path} must end in .csv or .parquet")
    expect_file(path, "result file", ResultError)
    try:
        return readers[suffix](path)
    except (ReadError, ValueError, KeyError, TypeError, OSError) as error:
        raise ResultError(f"{path} is not a result of this package: {reason(error)}") from error


def _read_csv(path: Path) -> Result:
    header, lines = read_table(path)
    rows = [[number_of(cell, number) for cell in line] for number, line in enumerate(lines, start=2)]
    values = np.array(rows, dtype=np.float64).reshape(len(rows), len(header))
    columns = {name: np.ascontiguousarray(values[:, k]) for k, name in enumerate(header)}
    return Result(time=columns.pop("time"), columns=columns)


def _read_parquet(path: Path) -> Result:
    table = need("pyarrow.parquet").read_table(path)
    held = (table.schema.metadata or {}).get(METADATA_KEY)
    if held is None:
        raise ReadError("it does not tell of which game and run it is")
    metadata = json.loads(held)
    metadata["messages"] = tuple(metadata["messages"])
    metadata.pop("metrics", None)  # Result computes them from its columns
    columns = {name: table.column(name).to_numpy() for name in table.column_names}
    return Result(time=columns.pop("time"), columns=columns, **metadata)


def _largest(array: FloatArray, chosen: NDArray[np.bool_]) -> float:
    return float(np.max(np.abs(array[chosen])))
