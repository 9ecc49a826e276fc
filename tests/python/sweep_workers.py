"""Work functions for the tests of sweeps, in a module of their own that worker processes can import."""

import os
import time
from collections.abc import Sequence
from pathlib import Path

from mixed_order_game.studies.sampler import Settings
from mixed_order_game.studies.worker import Case, Outcome, Source, run_chunk

FOLDER = "MOG_TEST_FOLDER"
"""Environment variable: a folder in which the workers of one test leave what they did."""


def noted(source: Source, settings: Settings, cases: Sequence[Case]) -> list[Outcome]:
    """run_chunk, with a file for every row that was run, named by the row and the process."""
    folder = Path(os.environ[FOLDER])
    for case in cases:
        with (folder / f"{case.row}.run").open("a") as file:
            file.write(f"{os.getpid()}\n")
    return run_chunk(source, settings, cases)


def dies_once(source: Source, settings: Settings, cases: Sequence[Case]) -> list[Outcome]:
    """The first worker that gets row 7 is gone before it finishes."""
    folder = Path(os.environ[FOLDER])
    outcomes = noted(source, settings, cases)
    if any(case.row == 7 for case in cases) and not (folder / "died").exists():
        (folder / "died").touch()
        os._exit(3)
    return outcomes


def dies_of_row_seven(source: Source, settings: Settings, cases: Sequence[Case]) -> list[Outcome]:
    """Row 7 kills every worker."""
    if any(case.row == 7 for case in cases):
        os._exit(3)
    return noted(source, settings, cases)


def dies(_source: Source, _settings: Settings, _cases: Sequence[Case]) -> list[Outcome]:
    """Every row kills its worker."""
    os._exit(3)


def slow(source: Source, settings: Settings, cases: Sequence[Case]) -> list[Outcome]:
    """run_chunk, slowly enough to be interrupted."""
    outcomes = []
    for case in cases:
        time.sleep(0.06)
        outcomes += noted(source, settings, [case])
    return outcomes


def tells_of_threads(source: Source, settings: Settings, cases: Sequence[Case]) -> list[Outcome]:
    """What the worker's environment says of threads for linear algebra, in place of a status."""
    del source, settings
    told = os.environ.get("OPENBLAS_NUM_THREADS", "any number")
    return [Outcome(case.row, None, told, 0.0) for case in cases]
