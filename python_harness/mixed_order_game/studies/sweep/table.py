"""The rows of a sweep, their summary and the medians over what was not asked for."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from ...errors import NotRecordedError, ResultError
from ...extras import need
from ...notebook import digits, page, table
from ...results.metrics import METRIC_UNITS
from .store import SweepError, read_definition, read_rows

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Spread:
    """One figure over the rows that have it; NaN and -1 if none has."""

    name: str
    count: int
    least: float
    median: float
    most: float
    row_of_most: int


@dataclass(frozen=True, eq=False, repr=False)
class SweepResult:
    """The finished rows of a sweep: one row a run, NaN where a run was refused or has no such figure."""

    folder: Path
    table: pa.Table
    definition: Mapping[str, Any]  # sweep.json: fingerprint, rows, provenance, definition

    def __repr__(self) -> str:
        failed = f", {len(self.failed)} refused" if len(self.failed) else ""
        return f"<SweepResult {self.definition['title']}: {len(self)} of {self.rows} rows{failed}>"

    def __len__(self) -> int:
        return int(self.table.num_rows)

    def __getitem__(self, column: str) -> FloatArray:
        """A column of numbers, one entry a row, such as result["settling_time"]. Raises ResultError."""
        if column not in self.table.column_names:
            raise NotRecordedError(
                f"the sweep has no column {column}: it has {', '.join(self.table.column_names)}"
            )
        values = self.table[column]
        if pa.types.is_string(values.type):
            raise ResultError(f"{column} is text: it is in the table")
        return np.array([np.nan if value is None else float(value) for value in values.to_pylist()])

    def _repr_html_(self) -> str:
        """For notebooks: least, median and most of every figure."""
        rows = [
            (
                each.name.replace("_", " "),
                *map(digits, (each.least, each.median, each.most)),
                METRIC_UNITS[each.name],
                str(each.row_of_most) if each.count else "-",
            )
            for each in self.summary()
        ]
        header = ["figure", "least", "median", "most", "unit", "row of the most"]
        return page(repr(self)[1:-1], table(header, rows))

    def plot(
        self, x: str, y: str, value: str = "final_error", axes: "Axes | None" = None, *, width: float = 3.5
    ) -> "Axes":
        """Draw the median of a figure over two columns as a heat map.

        Parameters
        ----------
        x, y
            Columns that vary in the sweep, such as "k1".
        value
            The figure, one of the columns after them, such as "settling_time".
        axes, width
            As for `Result.plot`, and so are what is returned and the need of Matplotlib.

        Raises
        ------
        ResultError
            For a column that does not exist.
        PlotError
            If x or y does not vary.
        """
        need("matplotlib")
        from .figures import plot_heat_map

        return plot_heat_map(self, x, y, value, axes, width=width)

    @property
    def rows(self) -> int:
        """Rows of the whole sweep, finished or not."""
        return int(self.definition["rows"])

    @property
    def complete(self) -> bool:
        """Whether every row is finished."""
        return len(self) == self.rows

    @property
    def failed(self) -> NDArray[np.int_]:
        """Rows whose run the FMU refused or gave up; the column status tells why."""
        status = np.array(self.table["status"].to_pylist(), dtype=object)
        failed: NDArray[np.int_] = np.asarray(self.table["row"])[status != "ok"]
        return failed

    @property
    def axes(self) -> tuple[str, ...]:
        """Columns that tell what was varied."""
        end = self.table.column_names.index(next(iter(METRIC_UNITS)))
        return tuple(self.table.column_names[1:end])

    def misses(self, neighbourhood: float) -> NDArray[np.int_]:
        """Rows whose final error is not below neighbourhood, those that failed included."""
        return np.asarray(self.table["row"])[~(self["final_error"] < neighbourhood)]

    def summary(self) -> list[Spread]:
        """Least, median and most of every figure."""
        spreads = []
        rows = np.asarray(self.table["row"])
        for name in METRIC_UNITS:
            values = self[name]
            kept = np.flatnonzero(~np.isnan(values))
            if not kept.size:
                spreads.append(Spread(name, 0, np.nan, np.nan, np.nan, -1))
                continue
            most = kept[np.argmax(values[kept])]
            least, median = float(values[kept].min()), float(np.median(values[kept]))
            spreads.append(Spread(name, len(kept), least, median, float(values[most]), int(rows[most])))
        return spreads

    def medians(self, by: Sequence[str], value: str) -> dict[tuple[float, ...], float]:
        """Median of a figure for every combination of values of some columns; NaN counts for nothing."""
        keys = np.column_stack([self[name] for name in by])
        groups, members = np.unique(keys, axis=0, return_inverse=True)
        values = self[value]
        medians = {}
        for k, group in enumerate(groups):
            chosen = values[(members.ravel() == k) & ~np.isnan(values)]
            medians[tuple(group.tolist())] = float(np.median(chosen)) if chosen.size else float("nan")
        return medians

    def to_pandas(self) -> "pd.DataFrame":
        """The table as a data frame, one row a run."""
        need("pandas")  # which pyarrow imports by itself
        frame: pd.DataFrame = self.table.to_pandas()
        return frame.set_index("row")


def load_sweep(folder: Path | str) -> SweepResult:
    """The rows that a folder holds so far. Raises SweepError if it holds none."""
    folder = Path(folder)
    definition = read_definition(folder)
    if not {"rows", "title", "definition"} <= definition.keys():
        raise SweepError(f"{folder} holds no sweep: its definition lacks entries")
    return SweepResult(folder, read_rows(folder), definition)
