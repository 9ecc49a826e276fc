"""Progress on stderr: bars or a spinner on a terminal, elsewhere a line now and then."""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import typer

from .verbosity import is_quiet

LINE_EVERY = 10.0
"""Time in s between lines of progress when stderr is not a terminal."""


@contextmanager
def counted_progress(what: str) -> Iterator[Callable[[int, int], None]]:
    """Runs done of all with the time left, on stderr: a bar on a terminal, elsewhere a line now and then."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    if is_quiet():
        yield lambda _done, _total: None
        return
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


@contextmanager
def progress_by_name() -> Iterator[Callable[[str, float], None]]:
    """Progress bars on stderr, one for each name; none when stderr is not a terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    console = Console(stderr=True)
    with Progress(
        *columns, console=console, transient=True, disable=is_quiet() or not console.is_terminal
    ) as bars:
        tasks: dict[str, TaskID] = {}

        def show(name: str, part: float) -> None:
            if name not in tasks:
                tasks[name] = bars.add_task(name, total=1.0)
            bars.update(tasks[name], completed=part if math.isfinite(part) else 0.0)

        yield show


@contextmanager
def step_named(what: str) -> Iterator[Callable[[str, float], None]]:
    """A spinner on stderr that names the step; nothing when stderr is not a terminal."""
    from rich.console import Console

    console = Console(stderr=True)
    if is_quiet() or not console.is_terminal:
        yield lambda _name, _part: None
        return
    with console.status(what, spinner="line") as status:
        yield lambda name, part: status.update(f"{name} {part:.0%}" if part else name)
