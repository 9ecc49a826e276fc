"""Carries a sweep out: opens the folder, runs what is not finished, writes rows as they come, joins them."""

from collections.abc import Callable
from pathlib import Path

from ...fmu.model import read_model
from ...game.graphs import all_connected
from ...interrupts import noted_signals
from ..pool import Work, open_pool, run_cases, run_chunk
from ..sampler import Settings
from .definition import Sweep
from .store import Store, locked
from .table import SweepResult, load_sweep

SweepProgress = Callable[[int, int], None]
"""Called with the rows finished and the rows of the sweep, first with those of an earlier start."""

PAPER_NEIGHBOURHOOD = 0.00125
PAPER_SETTLE_TIME = 16.0
"""What the paper's example shows with its own graph: largest |x - x*| of 0.00123 from 16 s on."""


def sweep(
    definition: Sweep,
    output: Path | str,
    *,
    jobs: int | None = None,
    scheduler: str | None = None,
    restart: bool = False,
    progress: SweepProgress | None = None,
    work: Work = run_chunk,
) -> SweepResult:
    """Run a sweep into the folder output and give its table.

    Rows that the folder holds already are not run again, unless restart discards them.
    jobs: processes on this machine; default one a usable core. Worker processes import the calling script:
    keep the call below `if __name__ == "__main__":` there.
    scheduler: address of a Dask scheduler, such as tcp://127.0.0.1:8786, whose workers run the rows instead.
    work: what a worker does with a chunk of rows, a function that it can import.
    Ctrl-C raises KeyboardInterrupt between two rows; the rows that are finished are in the folder.
    Raises SweepError for a folder with other contents, PoolError for workers that cannot be had.
    """
    output = Path(output)
    with locked(output), noted_signals() as take_signals:
        store = Store(output, definition, restart=restart)
        finished = store.finished()
        cases = [definition.case(row) for row in range(definition.rows) if row not in finished]
        done = definition.rows - len(cases)
        if progress is not None:
            progress(done, definition.rows)
        if cases:
            pool = open_pool(definition.model.path, jobs=jobs, scheduler=scheduler, work=work)
            try:
                for outcomes in run_cases(pool, definition.settings, cases, ready=take_signals):
                    store.append(outcomes)
                    done += len(outcomes)
                    if progress is not None:
                        progress(done, definition.rows)
            finally:
                pool.close()
        store.join()
    return load_sweep(output)


def connected_graphs_example(fmu: Path | str) -> Sweep:
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
