"""Runs of one FMU spread over processes: the cores of this machine, or the workers of a Dask cluster.

Both pools look alike to run_cases: they take a chunk of cases and give a future. A chunk whose worker died
is run again row by row; a row that kills a worker of its own is told as failed, so that one bad row cannot
stop a sweep.
"""

import asyncio
import atexit
import contextlib
import hashlib
import multiprocessing
import os
import shutil
import signal
import tempfile
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import connection
from pathlib import Path
from time import thread_time
from typing import Any, Protocol

from ..errors import MixedOrderGameError, ModelError, SimulationError
from ..extras import need
from ..fmu.model import Value
from ..interrupts import blocked_interrupt
from ..results.metrics import Metrics
from ..version import package_version
from .sampler import Sampler, Settings

LARGEST_CHUNK = 16
CHUNKS_PER_WORKER = 16
QUEUED_PER_WORKER = 2
READY_EVERY = 0.1
"""Time in s after which run_cases tells again that it is ready for a signal."""

DEATHS_IN_A_ROW = 10
"""Deaths of workers without one finished run in between that end a sweep: then the machine is to blame."""

WORKER_DIED = "the worker process died during this run"


class PoolError(MixedOrderGameError):
    """Workers that cannot be reached, or that die whatever they run."""


@dataclass(frozen=True)
class Case:
    """One run: its row in the table and the start values that differ from the FMU's."""

    row: int
    values: Mapping[str, Value]


@dataclass(frozen=True)
class Outcome:
    """What became of a case: its figures, or None and the reason; CPU time of its thread in s."""

    row: int
    metrics: Metrics | None
    status: str  # ok, or the error in one sentence
    cpu_seconds: float


@dataclass(frozen=True)
class Source:
    """The FMU for a worker: a path on this machine, or its bytes for another one."""

    key: str  # fingerprint of the bytes
    package_version: str
    path: Path | None = None
    content: bytes | None = None


Work = Callable[[Source, Settings, Sequence[Case]], list[Outcome]]

_loaded = threading.local()


def run_chunk(source: Source, settings: Settings, cases: Sequence[Case]) -> list[Outcome]:
    """Run cases one after the other on this thread's instance of the FMU, loaded on first use."""
    if source.package_version != package_version():
        told = f"{package_version()} there, {source.package_version} here"
        raise PoolError(f"a worker has another version of mixed-order-game: {told}")
    sampler = _sampler(source)
    outcomes = []
    for case in cases:
        begin = thread_time()
        try:
            found, status = sampler.measure(case.values, settings), "ok"
        except SimulationError as error:
            found, status = None, str(error)
        outcomes.append(Outcome(case.row, found, status, thread_time() - begin))
    return outcomes


def _sampler(source: Source) -> Sampler:
    held: tuple[str, Sampler] | None = getattr(_loaded, "sampler", None)
    if held is not None and held[0] == source.key:
        return held[1]
    if held is not None:
        held[1].close()
        atexit.unregister(held[1].close)
        _loaded.sampler = None
    if source.path is not None:
        sampler = Sampler(source.path)
    else:
        with tempfile.TemporaryDirectory(prefix="mixed-order-game-") as folder:
            path = Path(folder) / "MixedOrderGame.fmu"
            path.write_bytes(source.content or b"")
            sampler = Sampler(path)
    _loaded.sampler = (source.key, sampler)
    atexit.register(sampler.close)
    return sampler


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

    def __init__(self, fmu: Path, jobs: int, work: Work = run_chunk) -> None:
        self.workers = jobs
        self._work = work
        self._source = Source(_fingerprint(fmu), package_version(), path=fmu.resolve())
        self._folder = tempfile.TemporaryDirectory(prefix="mixed-order-game-")
        self._open()

    def submit(self, settings: Settings, cases: Sequence[Case]) -> "Future[list[Outcome]]":
        """Give a chunk to a worker."""
        with blocked_interrupt():  # for the workers that are started here, which import for a while first
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
        context = multiprocessing.get_context("spawn")
        # Nobody writes into this pipe: its end tells the workers that this side is gone.
        reader, self._writer = context.Pipe(duplex=False)
        self._executor = ProcessPoolExecutor(
            self.workers, context, initializer=_begin, initargs=(reader, self._folder.name)
        )
        self._reader = reader

    def _end(self) -> None:
        self._writer.close()
        self._executor.shutdown(wait=True, cancel_futures=True)
        self._reader.close()


def _begin(reader: connection.Connection, folder: str) -> None:
    """Begin a worker: unpack into the pool's own folder, leave Ctrl-C to the parent and end when it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    tempfile.tempdir = folder
    threading.Thread(target=_end_with, args=(reader, folder), daemon=True).start()


def _end_with(reader: connection.Connection, folder: str) -> None:
    connection.wait([reader])
    shutil.rmtree(folder, ignore_errors=True)
    os._exit(1)


class DaskPool:
    """Workers of a Dask cluster; the FMU goes to them as bytes, so that they need not share a file system."""

    def __init__(self, fmu: Path, scheduler: str, work: Work = run_chunk) -> None:
        client: Any = need("distributed").Client
        try:
            self._client: Any = client(scheduler, timeout="10s", set_as_default=False)
        except (OSError, ValueError) as error:
            raise PoolError(f"there is no Dask scheduler at {scheduler}: {error}") from error
        self._work = work
        self._address = scheduler
        content = fmu.read_bytes()
        self._source = self._client.scatter(
            Source(_fingerprint(fmu), package_version(), content=content), broadcast=bool(self._threads())
        )

    @property
    def workers(self) -> int:
        """Threads of the cluster at this moment, at least one."""
        return max(1, self._threads())

    def _threads(self) -> int:
        try:
            return sum(self._client.nthreads().values())
        except (OSError, CancelledError, asyncio.CancelledError) as error:
            raise self._gone() from error

    def submit(self, settings: Settings, cases: Sequence[Case]) -> "Future[list[Outcome]]":
        """Give a chunk to a worker; Dask runs it elsewhere if that worker dies, a few times."""
        given: Future[list[Outcome]] = Future()

        def hand_over(done: Any) -> None:
            if not given.set_running_or_notify_cancel():
                return
            try:
                given.set_result(done.result())
            except asyncio.CancelledError:  # Dask's, when it lost its scheduler; not an Exception
                given.set_exception(CancelledError())
            except Exception as error:  # noqa: BLE001 - whatever it is, run_cases shall see it
                given.set_exception(error)

        try:
            future = self._client.submit(self._work, self._source, settings, cases, pure=False)
        except Exception as error:
            raise self._gone() from error
        given.add_done_callback(lambda it: future.cancel() if it.cancelled() else None)
        future.add_done_callback(hand_over)
        return given

    def died(self, error: BaseException) -> bool:
        """Whether several workers died of a chunk, or its outcomes were lost on their way."""
        from distributed.scheduler import KilledWorker

        return isinstance(error, KilledWorker | CancelledError | OSError)

    def revive(self) -> bool:
        """Dask's nannies start workers again; without a scheduler there is nothing to go on with."""
        if self._client.status != "running":
            raise self._gone()
        return False

    def _gone(self) -> PoolError:
        return PoolError(f"the Dask scheduler at {self._address} is gone")

    def close(self) -> None:
        """Leave the cluster; it goes on without us."""
        self._client.close()


def open_pool(
    fmu: Path, *, jobs: int | None = None, scheduler: str | None = None, work: Work = run_chunk
) -> Pool:
    """The workers wished: of a Dask scheduler, or so many processes here (default: one a usable core).

    Raises PoolError for a count that is not positive or a scheduler that cannot be reached.
    """
    if not fmu.is_file():
        raise ModelError(f"there is no FMU {fmu}")
    if scheduler is not None:
        return DaskPool(fmu, scheduler, work)
    if jobs is not None and jobs < 1:
        raise PoolError(f"jobs = {jobs} is not positive")
    return LocalPool(fmu, usable_cores() if jobs is None else jobs, work)


def usable_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_cases(
    pool: Pool,
    settings: Settings,
    cases: Sequence[Case],
    *,
    chunk: int | None = None,
    ready: Callable[[], None] = lambda: None,
) -> Iterator[list[Outcome]]:
    """Run cases and give their outcomes in chunks as they finish; every case has one outcome in the end.

    ready: called several times a second where an exception that it raises loses nothing.
    Raises VariableError for values that the FMU does not take, PoolError if workers die whatever they run.
    """
    size = chunk or max(1, min(LARGEST_CHUNK, len(cases) // (pool.workers * CHUNKS_PER_WORKER)))
    chunks = [cases[k : k + size] for k in range(0, len(cases), size)]
    return _Dispatch(pool, settings, chunks, ready).outcomes()


class _Dispatch:
    """Chunks that wait and chunks that run. What a dead worker lost waits again, one row a chunk."""

    def __init__(
        self,
        pool: Pool,
        settings: Settings,
        chunks: Iterable[Sequence[Case]],
        ready: Callable[[], None],
    ) -> None:
        self._pool = pool
        self._settings = settings
        self._ready = ready
        self._waiting = deque(chunks)
        self._running: dict[Future[list[Outcome]], Sequence[Case]] = {}
        self._lost: list[Sequence[Case]] = []
        self._deaths = 0  # since the last finished run

    def outcomes(self) -> Iterator[list[Outcome]]:
        try:
            while self._waiting or self._running:
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
        while (
            self._waiting and not self._lost and len(self._running) < QUEUED_PER_WORKER * self._pool.workers
        ):
            chunk = self._waiting.popleft()
            try:
                self._running[self._pool.submit(self._settings, chunk)] = chunk
            except BrokenProcessPool:
                self._lost.append(chunk)

    def _collect(self, futures: Iterable["Future[list[Outcome]]"]) -> Iterator[list[Outcome]]:
        """Outcomes of futures that have ended."""
        for future in futures:
            chunk = self._running.pop(future)
            outcomes = _outcomes(self._pool, future)
            if outcomes is None:
                self._lost.append(chunk)
            else:
                self._deaths = 0
                yield outcomes

    def _recover(self) -> Iterator[list[Outcome]]:
        """Workers in place of dead ones; lost chunks wait again by rows, lost rows run on their own."""
        if self._pool.revive():
            yield from self._collect(list(self._running))
        lost, self._lost = self._lost, []
        for chunk in lost:
            if len(chunk) > 1:
                self._waiting.extendleft([case] for case in chunk)
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


def _fingerprint(fmu: Path) -> str:
    return hashlib.sha256(fmu.read_bytes()).hexdigest()
