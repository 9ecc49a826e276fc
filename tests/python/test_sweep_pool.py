"""Workers that die, here and on a Dask cluster: nothing is lost, and what kills its workers is told."""

import gc
import os
import signal
import subprocess
import sys
import time
import weakref
from collections.abc import Iterator, Sequence
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mixed_order_game import read_model
from mixed_order_game.studies.pool import WORKER_DIED, LocalPool, run_cases
from mixed_order_game.studies.sampler import Settings
from mixed_order_game.studies.sweep.conduct import sweep
from mixed_order_game.studies.sweep.definition import Sweep
from mixed_order_game.studies.worker import Case, Outcome, PoolError, Source, _loaded, run_chunk
from mixed_order_game.version import package_version
from tests.python import sweep_workers
from tests.python.test_sweep import runs_of

SHORT = Settings(stop_time=0.2)


@pytest.fixture
def notes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "notes"
    folder.mkdir()
    monkeypatch.setenv(sweep_workers.FOLDER, str(folder))
    return folder


def definition(fmu: Path, rows: int = 40) -> Sweep:
    return Sweep(fmu=fmu, grid={"k1": tuple(5.0 + 0.5 * k for k in range(rows))}, settings=SHORT)


def test_a_worker_that_dies_loses_nothing(fmu: Path, tmp_path: Path, notes: Path) -> None:
    result = sweep(definition(fmu), tmp_path / "s", jobs=2, work=sweep_workers.dies_once)
    assert (notes / "died").exists()
    np.testing.assert_array_equal(result.table["row"], np.arange(40))
    assert set(result.table["status"].to_pylist()) == {"ok"}
    assert runs_of(notes)[7] >= 2
    undisturbed = sweep(definition(fmu), tmp_path / "t", jobs=1)
    np.testing.assert_array_equal(result["control_energy"], undisturbed["control_energy"])


def test_a_row_that_kills_its_workers_is_told(fmu: Path, tmp_path: Path, notes: Path) -> None:
    result = sweep(definition(fmu, 20), tmp_path / "s", jobs=2, work=sweep_workers.dies_of_row_seven)
    assert result.failed.tolist() == [7]
    assert result.table["status"][7].as_py() == WORKER_DIED
    assert len(runs_of(notes)) == 19


def test_a_machine_on_which_workers_die_is_told(fmu: Path, tmp_path: Path) -> None:
    with pytest.raises(PoolError, match="10 workers died in a row"):
        sweep(definition(fmu), tmp_path / "s", jobs=2, work=sweep_workers.dies)


class Counted:
    """A pool of two workers that have each chunk done at once, in 1/64 s a row."""

    workers = 2

    def __init__(self) -> None:
        self.chunks: list[int] = []

    def submit(self, _settings: Settings, cases: Sequence[Case]) -> "Future[list[Outcome]]":
        self.chunks.append(len(cases))
        done: Future[list[Outcome]] = Future()
        done.set_result([Outcome(case.row, None, "ok", 1 / 64) for case in cases])
        return done

    def died(self, _error: BaseException) -> bool:
        return False

    def revive(self) -> bool:
        return False

    def close(self) -> None:
        pass


def test_chunks_take_a_fifth_of_a_second_and_less_in_the_end() -> None:
    pool, cases = Counted(), [Case(row, {}) for row in range(200)]
    outcomes = run_cases(pool, SHORT, iter(cases), len(cases))
    assert sorted(each.row for chunk in outcomes for each in chunk) == list(range(200))
    assert pool.chunks[:4] == [1, 1, 1, 1]  # as long as no run has told what it takes
    assert pool.chunks[4:] == [*[12] * 13, 10, 7, 5, 4, 3, 2, 2, *[1] * 7]


ASKS = """
import sys
from mixed_order_game import read_model
from mixed_order_game.studies.pool import LocalPool
from mixed_order_game.studies.sampler import Settings
from mixed_order_game.studies.worker import Case
sys.path.append(sys.argv[1])
import sweep_workers
pool = LocalPool(read_model(sys.argv[2]), 1, sweep_workers.tells_of_threads)
print(pool.submit(Settings(), [Case(0, {})]).result()[0].status)
pool.close()
"""


@pytest.mark.parametrize("asked", [None, "3"])
def test_workers_start_threads_only_when_asked(fmu: Path, asked: str | None) -> None:
    own = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    environment = own if asked is None else {**own, "OPENBLAS_NUM_THREADS": asked}
    command = [sys.executable, "-c", ASKS, str(Path(__file__).parent), str(fmu)]
    told = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout
    assert told == (asked or "1") + "\n"


def test_starting_workers_leaves_the_environment_as_it_is(fmu: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    pool = LocalPool(read_model(fmu), 1)
    try:
        pool.submit(SHORT, [Case(0, {})]).result()
    finally:
        pool.close()
    assert "OPENBLAS_NUM_THREADS" not in os.environ


def test_a_worker_keeps_one_fmu_only(fmu: Path) -> None:
    source = Source("first", package_version(), path=fmu)
    kept = []
    for key in ("first", "second", "third", "third"):
        run_chunk(replace(source, key=key), SHORT, [Case(0, {"k1": 5.0})])
        kept.append(weakref.ref(_loaded.sampler[1]))
    gc.collect()
    assert [sampler() is not None for sampler in kept] == [False, False, True, True]
    assert kept[2]() is kept[3]()


def test_workers_leave_nothing_behind(fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import tempfile

    (tmp_path / "scratch").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "scratch"))
    sweep(definition(fmu, 4), tmp_path / "s", jobs=2)
    assert list((tmp_path / "scratch").iterdir()) == []


class Cluster:
    """A Dask scheduler and two workers, each a process of its own, on loopback."""

    def __init__(self, folder: Path) -> None:
        self.processes: list[subprocess.Popen[bytes]] = []
        self.folder = folder
        paths = os.pathsep.join(path for path in sys.path if path)
        self.environment = {**os.environ, "PYTHONPATH": paths, "DASK_DISTRIBUTED__ADMIN__TICK__LIMIT": "60s"}
        contact = folder / "scheduler.json"
        self.start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--no-show")
        self.address = self.wait_for_address(contact)
        for _ in range(2):
            self.start("worker", self.address, "--nthreads", "1", "--no-nanny", "--no-dashboard")

    def start(self, kind: str, *arguments: str) -> None:
        command = [sys.executable, "-m", "dask", kind, *arguments]
        if kind == "scheduler":
            command += ["--scheduler-file", str(self.folder / "scheduler.json")]
        else:
            command += ["--local-directory", str(self.folder)]
        log = (self.folder / f"{kind}-{len(self.processes)}.log").open("wb")
        with log:
            self.processes.append(
                subprocess.Popen(command, env=self.environment, stdout=log, stderr=log, cwd=self.folder)
            )

    def wait_for_address(self, contact: Path) -> str:
        import json

        deadline = time.monotonic() + 120.0
        while True:
            assert time.monotonic() < deadline
            assert self.processes[0].poll() is None, (self.folder / "scheduler-0.log").read_text()
            try:
                return str(json.loads(contact.read_text())["address"])
            except (OSError, ValueError):
                time.sleep(0.05)

    def stop(self) -> None:
        for process in reversed(self.processes):
            process.kill()
        for process in self.processes:
            process.wait(30.0)


@pytest.fixture
def cluster(tmp_path: Path, notes: Path) -> Iterator[Cluster]:
    assert notes.is_dir()
    pytest.importorskip("distributed")
    (tmp_path / "dask").mkdir()
    running = Cluster(tmp_path / "dask")
    yield running
    running.stop()


def test_dask_cluster_with_a_worker_that_is_killed(
    fmu: Path, tmp_path: Path, notes: Path, cluster: Cluster
) -> None:
    wanted = definition(fmu, 60)
    told: list[int] = []

    def kill_one(done: int, _total: int) -> None:
        told.append(done)
        seen = {pid for path in notes.glob("*.run") for pid in path.read_text().split()}
        if len(seen) == 2 and cluster.processes[2].poll() is None:
            cluster.processes[2].send_signal(signal.SIGKILL)

    result = sweep(
        wanted, tmp_path / "s", scheduler=cluster.address, work=sweep_workers.slow, progress=kill_one
    )
    assert told[0] == 0
    assert told[-1] == 60
    np.testing.assert_array_equal(result.table["row"], np.arange(60))
    assert not result.failed.size
    workers = {pid for path in notes.glob("*.run") for pid in path.read_text().split()}
    assert workers == {str(process.pid) for process in cluster.processes[1:]}
    assert cluster.processes[2].poll() == -signal.SIGKILL
    local = sweep(wanted, tmp_path / "t", jobs=1)
    for name in ("settling_time", "control_energy", "final_error", "events"):
        np.testing.assert_array_equal(result[name], local[name])


def test_dask_scheduler_that_goes_away(fmu: Path, tmp_path: Path, cluster: Cluster) -> None:
    def kill(done: int, _total: int) -> None:
        if done and cluster.processes[0].poll() is None:
            cluster.processes[0].send_signal(signal.SIGKILL)

    wanted = definition(fmu, 60)
    with pytest.raises(PoolError, match=f"the Dask scheduler at {cluster.address} is gone"):
        sweep(wanted, tmp_path / "s", scheduler=cluster.address, work=sweep_workers.slow, progress=kill)
    told: list[int] = []
    result = sweep(wanted, tmp_path / "s", jobs=1, progress=lambda done, _: told.append(done))
    assert told[0] > 0
    assert result.complete


def test_no_scheduler_there(fmu: Path, tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    with pytest.raises(PoolError, match="no Dask scheduler at nonsense"):
        sweep(definition(fmu, 2), tmp_path / "s", scheduler="nonsense://127.0.0.1:1")
