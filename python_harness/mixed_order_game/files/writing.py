"""How files are written, by every command and function alike.

A file appears whole or not at all. It never replaces an input, and replaces a file of another kind only when
forced; it goes through symbolic links, keeps the permissions of what it replaces and else follows the umask.
"""

import csv
import json
import os
import stat
import zipfile
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from ..errors import ExistingFileError, ResultError, reason
from ..extras import need
from ..names import parse_name
from .reading import suffix_of

PARTIAL_PREFIX, PARTIAL_SUFFIX = ".mog-", ".part"
"""Names of files that are still being written, or were when their process was killed."""

LARGEST_JUDGED = 64_000_000
"""Bytes of an existing file up to which its kind is looked for."""


@dataclass(frozen=True)
class Kind:
    """A kind of file that is written, and how one that exists is known to be of it."""

    name: str  # with its article
    suffixes: tuple[str, ...]
    known: Callable[[Path], bool] | None  # None: written by hand as well, never replaced unasked

    def takes(self, path: Path) -> bool:
        """Whether the file's suffix is one of this kind, in small letters or capitals."""
        return suffix_of(path) in self.suffixes

    @property
    def ending(self) -> str:
        """What the file must end in, as in '.csv or .parquet'."""
        *most, last = self.suffixes
        return f"{', '.join(most)} or {last}" if most else last


def check_output(
    path: Path | str, kind: Kind, *, inputs: Iterable[Path | str | None] = (), force: bool = False
) -> Path:
    """The path, if a file of this kind may be written there; for the time before the work is done.

    inputs: files that the work reads. force: replace a file of any kind.
    Raises ResultError for another suffix, an input, a file of another kind and a place that takes no file.
    """
    path = Path(path)
    if not kind.takes(path):
        raise ResultError(f"{path} must end in {kind.ending}")
    target = _target(path)
    for each in inputs:
        if each is not None and _same(target, each):
            raise ResultError(f"{path} is what is read here: name another file")
    if suffix_of(path) == ".parquet":
        need("pyarrow")
    if os.path.lexists(target):
        _check_existing(path, target, kind, force=force)
    else:
        check_folder(target.parent)
    return path


def check_folder(folder: Path) -> None:
    """Raises ResultError unless the folder is one that takes files, or can be made."""
    while not os.path.lexists(folder):
        folder = folder.parent
    if not folder.is_dir():
        raise ResultError(f"cannot write into {folder}: it is not a folder")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise ResultError(f"cannot write into {folder}: permission denied")


def write_file(
    path: Path | str,
    kind: Kind,
    write: Callable[[IO[bytes]], object],
    *,
    inputs: Iterable[Path | str | None] = (),
    force: bool = False,
) -> Path:
    """Write a file of some kind where check_output allows it. Returns the path. Raises ResultError."""
    path = check_output(path, kind, inputs=inputs, force=force)
    write_whole(path, write)
    return path


def write_whole(path: Path, write: Callable[[IO[bytes]], object]) -> None:
    """Write under a temporary name and rename, so that no half-written file keeps the name.

    For files in folders of our own; others go through write_file. Raises ResultError.
    """
    partial = None
    try:
        target = _target(path)
        target.parent.mkdir(parents=True, exist_ok=True)
        partial = target.with_name(f"{PARTIAL_PREFIX}{os.urandom(8).hex()}{PARTIAL_SUFFIX}")
        with partial.open("xb") as file:
            write(file)
        if target.exists():
            partial.chmod(stat.S_IMODE(target.stat().st_mode))
        partial.replace(target)
    except OSError as error:
        raise ResultError(f"cannot write {path}: {reason(error)}") from error
    finally:
        if partial is not None:
            with suppress(OSError):  # it is gone, or never was where nothing can be written
                partial.unlink()


def is_partial(path: Path) -> bool:
    """Whether a file is one that a killed process left half-written."""
    return path.name.startswith(PARTIAL_PREFIX) and path.name.endswith(PARTIAL_SUFFIX)


def _target(path: Path) -> Path:
    """Where the file comes to lie when every symbolic link is followed."""
    try:
        return path.resolve()
    except (OSError, RuntimeError) as error:  # links in a circle
        raise ResultError(f"cannot write {path}: {reason(error)}") from error


def _same(target: Path, other: Path | str) -> bool:
    try:
        return target.samefile(other)
    except OSError:  # one of them does not exist
        return False


def _check_existing(path: Path, target: Path, kind: Kind, *, force: bool) -> None:
    if target.is_dir():
        raise ResultError(f"cannot write {path}: it is a folder")
    if not target.is_file():
        raise ResultError(f"cannot write {path}: it is not a regular file")
    if not os.access(target, os.W_OK):
        raise ResultError(f"cannot write {path}: it is read-only")
    if force or target.stat().st_size == 0:
        return
    if kind.known is None:
        raise ExistingFileError(f"{path} exists: name another file or add --force (in Python force=True)")
    if not _known(target, kind.known):
        told = f"{path} exists and is not {kind.name}"
        raise ExistingFileError(f"{told}: name another file or add --force (in Python force=True)")


def _known(path: Path, known: Callable[[Path], bool]) -> bool:
    try:
        return known(path)
    except (OSError, ValueError, RecursionError, csv.Error, zipfile.BadZipFile):
        return False


def _is_fmu(path: Path) -> bool:
    with zipfile.ZipFile(path) as archive:
        return {"modelDescription.xml", "resources/game.toml"} <= set(archive.namelist())


def _is_structure(path: Path) -> bool:
    with zipfile.ZipFile(path) as archive:
        return "SystemStructure.ssd" in archive.namelist()


def _is_result(path: Path) -> bool:
    if suffix_of(path) == ".parquet":
        try:
            return b"mixed_order_game" in (need("pyarrow.parquet").read_schema(path).metadata or {})
        except need("pyarrow").ArrowException:
            return False
    return "x_star" in _stems(path)  # every run records it


def _stems(path: Path) -> set[str]:
    """Kinds of variables in the header of a CSV file whose first column is time; none for other files."""
    with path.open(encoding="utf-8-sig", newline="") as file:
        header = next(csv.reader([file.readline(LARGEST_JUDGED)]), [])
    return {parse_name(name)[0] for name in header[1:]} if header[:1] == ["time"] else set()


def _holds(mark: bytes) -> Callable[[Path], bool]:
    return lambda path: path.stat().st_size <= LARGEST_JUDGED and mark in path.read_bytes()


def _is_json(key: str, value: Any = None) -> Callable[[Path], bool]:
    """A JSON object with an entry, of that value if one is given."""

    def known(path: Path) -> bool:
        data = json.loads(path.read_text(encoding="utf-8"))
        return isinstance(data, dict) and key in data and value in (None, data[key])

    return known


FMU = Kind("an FMU of a game", (".fmu",), _is_fmu)
SSP = Kind("a system structure", (".ssp",), _is_structure)
GAME = Kind("a game file", (".toml",), None)
RESULT = Kind("a result", (".csv", ".parquet"), _is_result)
DISTURBANCE = Kind("a table of d_ext", (".csv",), lambda path: _stems(path) == {"d_ext"})
GRAPH_SCHEDULE = Kind("a table of edges", (".csv",), lambda path: _stems(path) == {"a"})
FIGURE = Kind("a figure of this package", (".pdf", ".svg", ".png"), _holds(b"mixed-order-game"))
PAGE = Kind("a page of mog report", (".html",), _holds(b'<meta name="generator" content="mixed-order-game">'))
CLAIMS = Kind("a list of judged claims", (".json",), _is_json("claims"))
SCHEMA = Kind("the schema of games", (".json",), _is_json("title", "Mixed-order game"))
