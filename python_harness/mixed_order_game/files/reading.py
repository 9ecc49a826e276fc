"""How a user's files are read: their kind, UTF-8 text, and tables of numbers over time.

A byte order mark at the beginning of a text means nothing, as in the FMU's own reader of games.
"""

import csv
import difflib
import io
import re
import stat
import tomllib
from pathlib import Path
from typing import Any

from ..errors import MixedOrderGameError, missing, reason

BYTE_ORDER_MARKS_OF_UTF_16 = (b"\xff\xfe", b"\xfe\xff")
SEPARATOR = re.compile(r'(?:sep=|"?time"? *)([;\t|])')
"""At the beginning of a table that is not separated by commas."""


class ReadError(MixedOrderGameError, ValueError):
    """A file that is not what it is read as; the text tells what stands there, not the file's name."""


def suffix_of(path: Path | str) -> str:
    """The suffix in small letters; other systems also write it in capitals."""
    return Path(path).suffix.lower()


def expect_file(path: Path, what: str, error: type[MixedOrderGameError]) -> None:
    """Raise the error, in words, unless the path leads to a file that can be read."""
    try:
        mode = path.stat().st_mode
        if stat.S_ISREG(mode):
            path.open("rb").close()
            return
    except (FileNotFoundError, NotADirectoryError, ValueError):  # ValueError: no file can have this name
        raise missing(error)(f"there is no {what} {path}{_with_a_near_name(path)}") from None
    except OSError as found:
        raise error(f"{path} cannot be read: {reason(found)}") from found
    kind = "a folder" if stat.S_ISDIR(mode) else "not a regular file"
    raise error(f"{path} is {kind}, expected {'an' if what == 'FMU' else 'a'} {what}")


def _with_a_near_name(path: Path) -> str:
    """The nearest names beside a missing file, as the end of a sentence; empty where none is near."""
    try:
        files = {each.stem: each for each in path.parent.iterdir() if suffix_of(each) == suffix_of(path)}
    except (OSError, ValueError):
        return ""
    near = [str(files[stem]) for stem in difflib.get_close_matches(path.stem, files, n=3)]
    return f"; did you mean {' or '.join(near)}?" if near else ""


def text_of(content: bytes) -> str:
    """UTF-8 text, a byte order mark left out. Raises ReadError."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        if content[:2] in BYTE_ORDER_MARKS_OF_UTF_16:
            raise ReadError("it is UTF-16 text, expected UTF-8") from None
        line = error.object.count(b"\n", 0, error.start) + 1
        byte = error.object[error.start]
        raise ReadError(f"line {line} holds the byte 0x{byte:02X}, expected UTF-8 text") from None


def read_text(path: Path) -> str:
    """The text of a file. Raises ReadError."""
    try:
        return text_of(path.read_bytes())
    except OSError as error:
        raise ReadError(reason(error)) from error


def toml_of(text: str) -> dict[str, Any]:
    """The tables of a TOML document. Raises ReadError."""
    try:
        return tomllib.loads(text)
    except ValueError as error:
        raise ReadError(f"it is not TOML: {error}") from error
    except RecursionError:
        raise ReadError("it is nested too deeply") from None


def read_table(path: Path) -> tuple[list[str], list[list[str]]]:
    """Header and rows of a CSV file whose first column is time, without empty lines. Raises ReadError."""
    text = read_text(path)
    separator = SEPARATOR.match(text)
    if separator is not None:
        raise ReadError(f"the separator is {separator[1]!r}, expected commas (and points in numbers)")
    try:
        lines = [line for line in csv.reader(io.StringIO(text, newline=""), strict=True) if line]
    except csv.Error as error:
        raise ReadError(f"it is not CSV: {error}") from error
    header, *rows = lines or [[]]
    header = [name.strip() for name in header]
    cut = next((name for name in header if name.count("[") != name.count("]")), None)
    if cut is not None:
        raise ReadError(f"the name {cut} is cut at its comma: names stand in double quotes")
    if header[:1] != ["time"] or len(set(header)) != len(header):
        raise ReadError("the first line must name time and then every variable once, names in double quotes")
    for number, row in enumerate(rows, start=2):
        if len(row) != len(header):
            raise ReadError(
                f"row {number} has {len(row)} cell{'s' * (len(row) != 1)}, the header has {len(header)}"
            )
    return header, rows


def number_of(cell: str, row: int) -> float:
    """The number in a cell. Raises ReadError."""
    try:
        return float(cell)
    except ValueError:
        raise ReadError(f"row {row}: {cell!r} is not a number") from None
