"""How commands print tables: nothing is cut, on no narrow terminal and not where there is no terminal."""

import re

from rich.console import Console, RenderableType
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

UNLIMITED = 100_000
"""Width in characters where the output is no terminal: whoever reads it finds each row in one line."""


def standard_output() -> Console:
    """Standard output, as wide as its terminal."""
    console = Console(highlight=False)
    return console if console.is_terminal else Console(highlight=False, width=UNLIMITED)


def show(table: Table, console: Console | None = None) -> None:
    """Print a table; where the console is too narrow for its words, row by row, a line for each column."""
    console = console or standard_output()
    for column in table.columns:
        column.overflow, column.no_wrap = "fold", False
    if _fit(table, console) or not table.show_header:
        _print(table, console)
        return
    if table.title is not None:
        console.print(table.title)
    for cells in zip(*(column.cells for column in table.columns), strict=True):
        record = Table.grid(padding=(0, 2, 0, 0))
        for column, cell in zip(table.columns, cells, strict=True):
            record.add_row(column.header, cell)
        for part in record.columns:
            part.overflow = "fold"
        _print(record, console)
        console.print(Text())


def _print(grid: RenderableType, console: Console) -> None:
    """Print a grid; where there is no terminal, without the blanks that make all its lines equally long."""
    if console.is_terminal:
        console.print(grid)
        return
    with console.capture() as captured:
        console.print(grid)
    console.out(re.sub(" +\n", "\n", captured.get()), end="", highlight=False)


def _fit(table: Table, console: Console) -> bool:
    """Set the columns' widths so that no word is broken, the room left given to the longest texts.

    False if the words need more room than there is.
    """
    options = console.options.update(width=UNLIMITED)
    whole = Measurement.get(console, options, table)
    needed = [
        [Measurement.get(console, options, cell) for cell in (column.header, *column.cells)]
        for column in table.columns
    ]
    widths = [max(each.minimum for each in column) for column in needed]
    longest = [max(each.maximum for each in column) for column in needed]
    room = console.width - whole.minimum
    if room < 0:
        return False
    for _ in range(min(room, sum(longest) - sum(widths))):
        lacking = [most - width for most, width in zip(longest, widths, strict=True)]
        widths[lacking.index(max(lacking))] += 1
    for column, width in zip(table.columns, widths, strict=True):
        column.width = width
    return True
