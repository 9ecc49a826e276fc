"""What the commands sweep, tune and compare share: reading options, progress with the time left."""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

import typer

from ..arguments import value_of_text
from ..designs import DesignError, Range, range_of_text
from ..graphs import CommunicationGraph, GraphError, graph_of_model, graphs_of_text
from ..model import Model, Value
from ..names import split_names

Parsed = TypeVar("Parsed")

LINE_EVERY = 10.0
"""Time in s between lines of progress when stderr is not a terminal."""


def settings_of(texts: Iterable[str], hint: str = "--set") -> dict[str, Value]:
    """NAME=VALUE, each name once."""
    return pairs_of(texts, value_of_text, hint)


def pairs_of(texts: Iterable[str], parse: Callable[[str], Parsed], hint: str) -> dict[str, Parsed]:
    """NAME=TEXT, each name once, its text parsed. Raises typer.BadParameter."""
    pairs: dict[str, Parsed] = {}
    for text in texts:
        name, separator, rest = (part.strip() for part in text.partition("="))
        if not (name and separator and rest):
            raise typer.BadParameter(f"NAME=... expected, not {text!r}", param_hint=hint)
        if name in pairs:
            raise typer.BadParameter(f"{name} is given twice", param_hint=hint)
        try:
            pairs[name] = parse(rest)
        except (DesignError, ValueError) as error:
            raise typer.BadParameter(f"{name}: {error}", param_hint=hint) from None
    return pairs


def range_option(text: str | None, hint: str) -> Range | None:
    """LOW:HIGH. Raises typer.BadParameter."""
    try:
        return None if text is None else range_of_text(text)
    except DesignError as error:
        raise typer.BadParameter(str(error), param_hint=hint) from None


def graphs_option(texts: Sequence[str], model: Model, seed: int) -> tuple[CommunicationGraph, ...]:
    """Graphs of all texts in turn, each once. Raises typer.BadParameter."""
    graphs: dict[CommunicationGraph, None] = {}
    for text in texts:
        try:
            found = graphs_of_text(text, model.players, seed=seed, own=graph_of_model(model))
        except GraphError as error:
            raise typer.BadParameter(str(error), param_hint="--graphs") from None
        graphs |= dict.fromkeys(found)
    return tuple(graphs)


def names_option(texts: Iterable[str], hint: str) -> list[str]:
    """Comma-separated names of all texts. Raises typer.BadParameter for a text that holds none."""
    names: list[str] = []
    for text in texts:
        found = split_names(text)
        if not found:
            raise typer.BadParameter(f"names separated by commas expected, not {text!r}", param_hint=hint)
        names += found
    return names


@contextmanager
def counted_progress(what: str) -> Iterator[Callable[[int, int], None]]:
    """Runs done of all with the time left, on stderr: a bar on a terminal, elsewhere a line now and then."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    if not console.is_terminal:
        yield _lines(what)
        return
    columns = (
        TextColumn(what),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(elapsed_when_finished=True),
    )
    with Progress(*columns, console=console, transient=True) as bars:
        task = bars.add_task(what, total=None)
        yield lambda done, total: bars.update(task, completed=done, total=total)


def _lines(what: str) -> Callable[[int, int], None]:
    first: list[tuple[float, int]] = []
    told = [time.monotonic()]

    def show(done: int, total: int) -> None:
        now = time.monotonic()
        if not first:
            first.append((now, done))
        begin, before = first[0]
        if now - told[0] >= LINE_EVERY and done > before:
            told[0] = now
            left = (now - begin) / (done - before) * (total - done)
            typer.echo(f"{what}: {done} of {total}, {left:.0f} s left", err=True)

    return show
