"""What a worker of a sweep does: it loads an FMU once, and runs the chunks of cases that it is given.

Every process of a pool imports this before its first run.
"""

import atexit
import hashlib
import tempfile
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import thread_time
from typing import Self

from ..errors import MixedOrderGameError, SimulationError
from ..fmu.model import Model, Value
from ..results.metrics import Metrics
from ..version import package_version
from .sampler import Sampler, Settings


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

    @classmethod
    def of(cls, fmu: Path, *, elsewhere: bool = False) -> Self:
        """The FMU for workers on this machine, or elsewhere."""
        content = fmu.read_bytes()
        key, version = hashlib.sha256(content).hexdigest(), package_version()
        return cls(key, version, content=content) if elsewhere else cls(key, version, path=fmu.resolve())


Work = Callable[[Source, Settings, Sequence[Case]], list[Outcome]]

_loaded = threading.local()
_models: dict[Path, Model] = {}


def take_model(model: Model) -> None:
    """What this process need not read of an FMU, because another one has."""
    _models[model.path] = model


def run_chunk(source: Source, settings: Settings, cases: Sequence[Case]) -> list[Outcome]:
    """Run cases one after the other on this thread's instance of the FMU, loaded on first use."""
    if source.content is not None and source.package_version != package_version():
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
        sampler = Sampler(_models.get(source.path, source.path))
    else:
        with tempfile.TemporaryDirectory(prefix="mixed-order-game-") as folder:
            path = Path(folder) / "MixedOrderGame.fmu"
            path.write_bytes(source.content or b"")
            sampler = Sampler(path)
    _loaded.sampler = (source.key, sampler)
    atexit.register(sampler.close)
    return sampler
