"""Carries a sweep out: opens the folder, runs what is not finished, writes rows as they come, joins them."""

from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

from ...errors import ResultError
from ...files.temporary import temporary_folder
from ...fmu.build import GameSource
from ...fmu.model import read_model
from ...game.graphs import all_connected
from ...interrupts import noted_signals
from ..designs import DesignError
from ..pool import open_pool, run_cases
from ..sampler import Settings
from ..worker import Work, run_chunk
from .definition import Sweep
from .store import Store, locked
from .table import SweepResult, load_sweep

SweepProgress = Callable[[int, int], None]
"""Called with the rows finished and the rows of the sweep, first with those of an earlier start."""

PAPER_NEIGHBOURHOOD = 0.00125
PAPER_SETTLE_TIME = 16.0
"""What the paper's example shows with its own graph: largest |x - x*| of 0.00123 from 16 s on."""


def sweep(
    game: GameSource | Sweep = None,
    output: Path | str | None = None,
    *,
    jobs: int | None = None,
    scheduler: str | None = None,
    restart: bool = False,
    progress: SweepProgress | None = None,
    work: Work = run_chunk,
    **design: Any,
) -> SweepResult:
    """Run a game many times and give the table: one row a run.

    Parameters
    ----------
    game
        An FMU (.fmu), a game file (.toml), a game of the package by its name, a `Game`; the paper's example
        when left out.
        Or a `Sweep`, the whole definition.
    output
        Folder for the rows. Rows that it holds already are not run again. Without a folder, the rows are kept
        in memory alone.
    jobs
        Processes on this machine; default one a usable core. Worker processes import the calling script: keep
        the call below `if __name__ == "__main__":` there.
    scheduler
        Address of a Dask scheduler, such as tcp://127.0.0.1:8786, whose workers run the rows instead.
    restart
        Whether the rows that the folder holds are discarded.
    progress
        Called with the rows finished and the rows of the sweep.
    work
        What a worker does with a chunk of rows, a function that it can import.
    **design
        What varies, as the fields of `Sweep` have it: fixed, grid, ranges, samples, sampling, graphs,
        initial_states, initial_actions, initial_velocities, seed, settings, neighbourhood.

    Returns
    -------
    SweepResult
        The table, with summary, medians and heat maps.

    Raises
    ------
    SweepError
        For a folder with other contents.
    PoolError
        For workers that cannot be had.
    VariableError, GraphError, DesignError
        For a design that the FMU does not take or that makes no sense.
    KeyboardInterrupt
        By Ctrl-C, between two rows; the rows that are finished are in the folder.

    Examples
    --------
    >>> found = mog.sweep("rivalling_pairs", grid={"k2": (0.5, 1.0, 2.0)}, jobs=1)
    >>> found["k2"].tolist(), found["final_error"].shape
    ([0.5, 1.0, 2.0], (3,))
    """
    if isinstance(game, Sweep):
        if design:
            raise DesignError(f"{next(iter(design))} is given besides a definition, which has its own")
        definition = game
    else:
        definition = Sweep(game, **design)
    if output is None:
        with temporary_folder(ResultError) as folder:
            return _carried_out(definition, folder, jobs, scheduler, restart, progress, work)
    return _carried_out(definition, Path(output), jobs, scheduler, restart, progress, work)


def _carried_out(
    definition: Sweep,
    output: Path,
    jobs: int | None,
    scheduler: str | None,
    restart: bool,  # noqa: FBT001 - as sweep has it
    progress: SweepProgress | None,
    work: Work,
) -> SweepResult:
    with locked(output), noted_signals() as take_signals:
        store = Store(output, definition, restart=restart)
        finished = store.finished()
        rows = [row for row in range(definition.rows) if row not in finished]
        done = definition.rows - len(rows)
        if progress is not None:
            progress(done, definition.rows)

        def ready() -> None:
            take_signals()
            store.write_due()

        if rows:
            pool = open_pool(definition.model, jobs=jobs, scheduler=scheduler, work=work)
            with closing(pool), closing(store):
                cases = map(definition.case, rows)
                for outcomes in run_cases(pool, definition.settings, cases, len(rows), ready=ready):
                    store.append(outcomes)
                    done += len(outcomes)
                    if progress is not None:
                        progress(done, definition.rows)
        store.join()
    return load_sweep(output)


def connected_graphs_example(fmu: GameSource) -> Sweep:
    """The built-in example: every connected graph on the game's players, robust and perturbed.

    For the paper's example, 728 graphs, no run may leave |x - x*| < 0.00125 from 16 s on; for other games no
    such figure is known and none is asked for.
    """
    model = read_model(fmu)
    paper = model.is_paper_example
    return Sweep(
        fmu=model.path,
        fixed={"robust": True, "perturbed": True},
        graphs=tuple(all_connected(model.players)),
        settings=Settings(
            stop_time=model.stop_time, step=model.step, settle_time=PAPER_SETTLE_TIME if paper else None
        ),
        neighbourhood=PAPER_NEIGHBOURHOOD if paper else None,
    )
