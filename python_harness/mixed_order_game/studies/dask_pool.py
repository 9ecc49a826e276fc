"""The workers of a Dask cluster, as a pool that looks like the one of this machine."""

import asyncio
from collections.abc import Sequence
from concurrent.futures import CancelledError, Future
from pathlib import Path
from typing import Any

from ..extras import need
from .sampler import Settings
from .worker import Case, Outcome, PoolError, Source, Work, run_chunk


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
        source = Source.of(fmu, elsewhere=True)
        self._source = self._client.scatter(source, broadcast=bool(self._threads()))

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
