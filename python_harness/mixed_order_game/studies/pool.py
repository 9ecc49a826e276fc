"""Runs of one FMU spread over processes: the cores of this machine, or the workers of a Dask cluster.

Both pools look alike to run_cases: they take a chunk of cases and give a future. A chunk whose worker died
is run again row by row; a row that kills a worker of its own is told as failed, so that one bad row cannot
stop a sweep.
"""

import contextlib
import multiprocessing
import os
import shutil
import signal
import sys
import tempfile
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from itertools import islice
from multiprocessing import connection
from multiprocessing.context import BaseContext
from typing import Protocol

from ..errors import ModelError
from ..fmu.model import Model
from ..interrupts import blocked_interrupt
from .sampler import Settings
from .worker import Case, Outcome, PoolError, Source, Work, run_chunk, take_model

LARGEST_CHUNK = 32
CHUNK_SECONDS = 0.2
"""CPU time of a chunk's runs, as long as one of them takes no more."""

BLAS_THREADS = "OPENBLAS_NUM_THREADS"
"""Environment variable that NumPy's OpenBLAS reads when it is loaded."""

QUEUED_PER_WORKER = 2
READY_EVERY = 0.1
"""Time in s after which run_cases tells again that it is ready for a signal."""

DEATHS_IN_A_ROW = 10
"""Deaths of workers without one finished run in between that end a sweep: then the machine is to blame."""

WORKER_DIED = "the worker process died during this run"


class Pool(Protocol):
    """Workers that run chunks of cases."""

    @property
    def workers(self) -> int:
        """Runs at the same time."""

    def submit(self, settings: Settings, cases: Sequence[Case]) -> "Future[list[Outcome]]":
        """Give a chunk to a worker."""

    def died(self, error: BaseException) -> bool:
        """Whether a future failed because its worker died."""

    def revive(self) -> bool:
        """Make good for a dead worker; true if that has ended every other chunk as well."""

    def close(self) -> None:
        """End the workers, at once."""


class LocalPool:
    """Processes on this machine. They end at once when this process closes the pool, or ends in any way."""

    def __init__(self, model: Model, jobs: int, work: Work = run_chunk) -> None:
        self.workers = jobs
        self._work = work
        self._model = replace(model, path=model.path.resolve())
        self._source = Source.of(self._model.path)
        self._folder = tempfile.TemporaryDirectory(prefix="mixed-order-game-")
        self._open()

    def submit(self, settings: Settings, cases: Sequence[Case]) -> "Future[list[Outcome]]":
        """Give a chunk to a worker."""
        # for the workers that are started here, which import for a while first
        with blocked_interrupt(), _without_threads():
            return self._executor.submit(self._work, self._source, settings, cases)

    def died(self, error: BaseException) -> bool:
        """Whether a future failed because a worker died; which one of them is not known."""
        return isinstance(error, BrokenProcessPool | CancelledError)

    def revive(self) -> bool:
        """A new pool in place of the broken one, whose chunks have all ended."""
        self._end()
        self._open()
        return True

    def close(self) -> None:
        """End the workers, whatever they are doing, and remove what they unpacked."""
        self._end()
        self._folder.cleanup()

    def _open(self) -> None:
        context = _context()
        # Nobody writes into this pipe: its end tells the workers that this side is gone.
        reader, self._writer = context.Pipe(duplex=False)
        self._executor = ProcessPoolExecutor(
            self.workers,
            context,
            initializer=_begin,
            initargs=(reader, self._folder.name, self._model, dict(os.environ)),
        )
        self._reader = reader

    def _end(self) -> None:
        self._writer.close()
        self._executor.shutdown(wait=True, cancel_futures=True)
        self._reader.close()


def _context() -> BaseContext:
    """How workers begin: on Linux as forks of a process that imports what they need and does nothing else.

    It stays for the next sweep. Elsewhere each worker imports for itself.
    """
    if sys.platform != "linux":
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([run_chunk.__module__])
    return context


@contextlib.contextmanager
def _without_threads() -> Iterator[None]:
    """Processes started inside start no threads for NumPy's linear algebra, unless the user asked for some.

    Workers have none to do, and each would spin on the others' cores while it imports.
    """
    if BLAS_THREADS in os.environ:
        yield
        return
    os.environ[BLAS_THREADS] = "1"
    try:
        yield
    finally:
        del os.environ[BLAS_THREADS]


def _begin(reader: connection.Connection, folder: str, model: Model, environment: dict[str, str]) -> None:
    """Begin a worker: unpack into the pool's own folder, leave Ctrl-C to the parent and end when it ends.

    environment: the parent's, which may have changed since what the worker was forked from began.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ.update(environment)
    tempfile.tempdir = folder
    take_model(model)
    threading.Thread(target=_end_with, args=(reader, folder), daemon=True).start()


def _end_with(reader: connection.Connection, folder: str) -> None:
    connection.wait([reader])
    shutil.rmtree(folder, ignore_errors=True)
    os._exit(1)


def open_pool(
    model: Model, *, jobs: int | None = None, scheduler: str | None = None, work: Work = run_chunk
) -> Pool:
    """The workers wished: of a Dask scheduler, or so many processes here (default: one a usable core).

    Raises PoolError for a count that is not positive or a scheduler that cannot be reached.
    """
    if not model.path.is_file():
        raise ModelError(f"there is no FMU {model.path}")
    if scheduler is not None:
        from .dask_pool import DaskPool

        return DaskPool(model.path, scheduler, work)
    if jobs is not None and jobs < 1:
        raise PoolError(f"jobs = {jobs} is not positive")
    return LocalPool(model, usable_cores() if jobs is None else jobs, work)


def usable_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_cases(
    pool: Pool,
    settings: Settings,
    cases: Iterable[Case],
    count: int,
    *,
    ready: Callable[[], None] = lambda: None,
) -> Iterator[list[Outcome]]:
    """Run count cases and give their outcomes in chunks as they finish; every case has one in the end.

    cases: taken as the workers get to them.
    ready: called several times a second where an exception that it raises loses nothing.
    Raises VariableError for values that the FMU does not take, PoolError if workers die whatever they run.
    """
    return _Dispatch(pool, settings, cases, count, ready).outcomes()


class _Dispatch:
    """Cases that wait and chunks that run. What a dead worker lost runs again, one row a chunk."""

    def __init__(
        self,
        pool: Pool,
        settings: Settings,
        cases: Iterable[Case],
        count: int,
        ready: Callable[[], None],
    ) -> None:
        self._pool = pool
        self._settings = settings
        self._ready = ready
        self._cases = iter(cases)
        self._left = count  # of the cases
        self._again: deque[Sequence[Case]] = deque()
        self._running: dict[Future[list[Outcome]], Sequence[Case]] = {}
        self._lost: list[Sequence[Case]] = []
        self._deaths = 0  # since the last finished run
        self._seconds = CHUNK_SECONDS  # CPU time of a run, by the last chunk that has ended

    def outcomes(self) -> Iterator[list[Outcome]]:
        try:
            while self._again or self._left or self._running:
                self._fill()
                if self._running and not self._lost:
                    yield from self._collect(self._wait_for(self._running))
                if self._lost:
                    yield from self._recover()
        finally:
            for future in self._running:
                future.cancel()

    def _wait_for(self, futures: Iterable["Future[list[Outcome]]"]) -> Iterable["Future[list[Outcome]]"]:
        """Those of the futures that have ended, as soon as one has."""
        while True:
            self._ready()
            done = wait(futures, timeout=READY_EVERY, return_when=FIRST_COMPLETED).done
            if done:
                return done

    def _fill(self) -> None:
        """Keep the workers busy, until the pool turns out to be broken."""
        most = QUEUED_PER_WORKER * self._pool.workers
        while (self._again or self._left) and not self._lost and len(self._running) < most:
            chunk = self._again.popleft() if self._again else self._next(most)
            try:
                self._running[self._pool.submit(self._settings, chunk)] = chunk
            except BrokenProcessPool:
                self._lost.append(chunk)

    def _next(self, queued: int) -> Sequence[Case]:
        """As many cases as take CHUNK_SECONDS; in the end fewer, so that no worker waits long for another."""
        by_time = CHUNK_SECONDS / max(self._seconds, CHUNK_SECONDS / LARGEST_CHUNK)
        size = max(1, int(min(by_time, self._left / queued)))
        self._left -= size
        return list(islice(self._cases, size))

    def _collect(self, futures: Iterable["Future[list[Outcome]]"]) -> Iterator[list[Outcome]]:
        """Outcomes of futures that have ended."""
        for future in futures:
            chunk = self._running.pop(future)
            outcomes = _outcomes(self._pool, future)
            if outcomes is None:
                self._lost.append(chunk)
            else:
                self._deaths = 0
                self._seconds = sum(outcome.cpu_seconds for outcome in outcomes) / len(outcomes)
                yield outcomes

    def _recover(self) -> Iterator[list[Outcome]]:
        """Workers in place of dead ones; lost chunks wait again by rows, lost rows run on their own."""
        if self._pool.revive():
            yield from self._collect(list(self._running))
        lost, self._lost = self._lost, []
        for chunk in lost:
            if len(chunk) > 1:
                self._again.extend([case] for case in chunk)
                continue
            outcome = self._alone(chunk[0])
            self._deaths = self._deaths + 1 if outcome.status == WORKER_DIED else 0
            if self._deaths == DEATHS_IN_A_ROW:
                raise PoolError(f"{self._deaths} workers died in a row without finishing a run")
            yield [outcome]

    def _alone(self, case: Case) -> Outcome:
        """Run a case while nothing else of ours can kill its worker; told as failed if it still dies."""
        with contextlib.suppress(BrokenProcessPool):
            future = self._pool.submit(self._settings, [case])
            self._wait_for([future])
            outcomes = _outcomes(self._pool, future)
            if outcomes is not None:
                return outcomes[0]
        self._pool.revive()
        return Outcome(case.row, None, WORKER_DIED, float("nan"))


def _outcomes(pool: Pool, future: "Future[list[Outcome]]") -> list[Outcome] | None:
    """Outcomes of a future that has ended; None if its worker died."""
    try:
        return future.result()
    except Exception as error:
        if pool.died(error):
            return None
        raise
