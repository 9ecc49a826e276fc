"""A sweep's folder: its definition, and the rows as Parquet files that appear as runs finish.

sweep.json holds the definition and its fingerprint, rows/*.parquet the rows; after the last row they are
joined into results.parquet. A file appears whole or not at all, so that an interruption at any moment leaves
only rows that are finished.
"""

import json
import shutil
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ...errors import MixedOrderGameError, ResultError, reason
from ...files.writing import is_partial, write_whole
from ...results.metrics import METRIC_UNITS
from ..worker import Outcome
from .definition import Sweep

DEFINITION = "sweep.json"
RESULTS = "results.parquet"
ROWS = "rows"
LOCK = ".lock"
WRITE_EVERY = 0.2
"""Time in s between two files of rows: each takes some milliseconds of what runs them."""

COUNTS = ("row", "graph_edges", "initial_state", "sample")
METADATA_KEY = b"mixed_order_game_sweep"


class SweepError(MixedOrderGameError):
    """A sweep's folder that cannot be used."""


class Store:
    """The folder of one sweep, for writing. Raises SweepError if it holds another sweep's rows."""

    def __init__(self, folder: Path, sweep: Sweep, *, restart: bool = False) -> None:
        self.folder = folder
        self._sweep = sweep
        self._next = 0
        self._waiting: list[dict[str, Any]] = []
        self._written: float | None = None
        self._schema = schema_of(sweep)
        definition = folder / DEFINITION
        for path in (*folder.glob("*"), *(folder / ROWS).glob("*")):
            if is_partial(path):  # left by a start that was killed
                path.unlink(missing_ok=True)
        if restart:  # the definition last: without it the folder is nobody's
            shutil.rmtree(folder / ROWS, ignore_errors=True)
            for path in (folder / RESULTS, definition):
                path.unlink(missing_ok=True)
        if definition.is_file():
            self._check(definition)
        elif folder.is_dir() and any(path.name != LOCK for path in folder.iterdir()):
            raise SweepError(f"{folder} is not empty and holds no sweep: choose another folder")
        else:
            data = {"fingerprint": sweep.fingerprint, "rows": sweep.rows, **sweep.provenance}
            write_whole(definition, lambda file: file.write((json.dumps(data, indent=2) + "\n").encode()))
        self._next = 1 + max((int(path.stem) for path in _parts(folder)), default=-1)

    def _check(self, definition: Path) -> None:
        try:
            held = json.loads(definition.read_text(encoding="utf-8"))["fingerprint"]
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise SweepError(f"{definition} is not the definition of a sweep: {reason(error)}") from error
        if held != self._sweep.fingerprint:
            raise SweepError(
                f"{self.folder} holds another sweep (other values, FMU or package): "
                "choose another folder, or restart to discard its rows"
            )

    def finished(self) -> set[int]:
        """Rows that are in the folder."""
        rows = [np.asarray(_read(path, columns=["row"])["row"]) for path in _files(self.folder)]
        return set(np.concatenate(rows).tolist()) if rows else set()

    def append(self, outcomes: Sequence[Outcome]) -> None:
        """Take rows; they are written together, WRITE_EVERY after the last ones."""
        self._waiting += [self._row(outcome) for outcome in outcomes]
        self.write_due()

    def write_due(self) -> None:
        """Write the rows that wait, if the last ones were written WRITE_EVERY ago."""
        if self._written is None:  # the workers are still starting
            pa.array([], pa.float64())  # at its first array PyArrow imports pandas, where that is installed
            self._written = monotonic()
        if self._waiting and monotonic() - self._written >= WRITE_EVERY:
            self.close()

    def close(self) -> None:
        """Write the rows that wait, as one file."""
        if not self._waiting:
            return
        path = self.folder / ROWS / f"{self._next:08d}.parquet"
        self._write(path, pa.Table.from_pylist(self._waiting, schema=self._schema))
        self._next += 1
        self._waiting.clear()
        self._written = monotonic()

    def join(self) -> None:
        """Join all rows into results.parquet, in their order."""
        if _parts(self.folder):
            table = read_rows(self.folder)
            self._write(self.folder / RESULTS, table.cast(self._schema))
            shutil.rmtree(self.folder / ROWS, ignore_errors=True)

    def _row(self, outcome: Outcome) -> dict[str, Any]:
        found = outcome.metrics
        figures = {} if found is None else {name: getattr(found, name) for name in METRIC_UNITS}
        figures["cpu_seconds"] = outcome.cpu_seconds
        known = {name: value for name, value in figures.items() if not np.isnan(value)}  # the others are null
        return {**self._sweep.describe(outcome.row), **known, "status": outcome.status}

    def _write(self, path: Path, table: pa.Table) -> None:
        write_whole(path, lambda file: pq.write_table(table, file))


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep other sweeps out of a folder. Raises SweepError if one is at work there."""
    from filelock import FileLock, Timeout

    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = FileLock(folder / LOCK, timeout=0)
        lock.acquire()
    except Timeout:
        raise SweepError(f"another sweep is at work in {folder}") from None
    except OSError as error:
        raise ResultError(f"cannot write into {folder}: {reason(error)}") from error
    try:
        yield
    finally:
        lock.release()


def schema_of(sweep: Sweep) -> pa.Schema:
    """Columns of a sweep's table, with its provenance."""
    kinds = {"graph": pa.string()} | dict.fromkeys(COUNTS, pa.int64())
    switches = {
        name for name, values in sweep.grid.items() if all(isinstance(value, bool) for value in values)
    }
    kinds |= dict.fromkeys(switches, pa.bool_())
    fields = [pa.field(name, kinds.get(name, pa.float64())) for name in sweep.describe(0)]
    fields += [pa.field(name, pa.float64()) for name in (*METRIC_UNITS, "cpu_seconds")]
    fields.append(pa.field("status", pa.string()))
    return pa.schema(fields, metadata={METADATA_KEY: json.dumps(sweep.provenance).encode()})


def read_rows(folder: Path) -> pa.Table:
    """All rows of a folder so far, in their order. Raises SweepError if it holds none."""
    tables = [_read(path) for path in _files(folder)]
    if not tables:
        raise SweepError(f"there are no rows of a sweep in {folder}")
    table = pa.concat_tables(tables).sort_by("row")
    rows = np.asarray(table["row"])
    keep = np.concatenate([[True], rows[1:] != rows[:-1]])
    return table if keep.all() else table.filter(pa.array(keep))


def read_definition(folder: Path) -> dict[str, Any]:
    """The contents of sweep.json. Raises SweepError if the folder holds no sweep."""
    try:
        data: dict[str, Any] = json.loads((folder / DEFINITION).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise SweepError(f"{folder} holds no sweep: {reason(error)}") from error
    return data


def _files(folder: Path) -> Iterable[Path]:
    joined = folder / RESULTS
    return [*([joined] if joined.is_file() else []), *_parts(folder)]


def _parts(folder: Path) -> list[Path]:
    return sorted(path for path in (folder / ROWS).glob("*.parquet") if path.stem.isdigit())


def _read(path: Path, columns: list[str] | None = None) -> pa.Table:
    try:
        return pq.read_table(path, columns=columns)
    except (OSError, pa.ArrowException) as error:
        raise SweepError(f"{path} cannot be read: {reason(error)}") from error
