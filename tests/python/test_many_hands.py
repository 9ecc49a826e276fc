"""One Simulator by several threads, by its own callbacks and by forked processes."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from mixed_order_game import SimulationError, Simulator
from mixed_order_game.studies.sampler import Sampler, Settings


def test_threads_that_share_a_simulator_wait_for_each_other(fmu: Path) -> None:
    gains = [5.0, 10.0, 20.0, 40.0] * 3
    with Sampler(fmu) as simulator:

        def run(k: int) -> float:
            values = {"k1": gains[k]}
            if k % 2:
                return simulator.measure(values, Settings(stop_time=1.0)).control_energy
            return float(simulator.run(start_values=values, stop_time=1.0).nash_error[-1])

        alone = [run(k) for k in range(len(gains))]
        with ThreadPoolExecutor(4) as threads:
            assert list(threads.map(run, range(len(gains)))) == alone


def test_loading_in_threads_keeps_the_working_directory(
    fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with ThreadPoolExecutor(4) as threads:
        for simulator in threads.map(Simulator, [fmu] * 8):
            simulator.close()
    assert Path.cwd() == tmp_path


def test_a_run_cannot_use_or_close_its_own_simulator(fmu: Path) -> None:
    with Simulator(fmu) as simulator:
        uses: list[Callable[[], object]] = [lambda: simulator.run(stop_time=0.1), simulator.close]
        for use in uses:
            with pytest.raises(SimulationError, match="the simulator is in the middle of a run"):
                simulator.run(stop_time=0.1, progress=lambda _, use=use: use())  # type: ignore[misc]
        assert simulator.run(stop_time=0.1).time[-1] == 0.1


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_a_forked_process_leaves_the_files_to_its_parent(fmu: Path) -> None:
    def in_child(action: Callable[[], bool]) -> bool:
        child = os.fork()
        if child == 0:
            fine = False
            try:
                fine = action()
            finally:
                os._exit(0 if fine else 1)
        return os.waitpid(child, 0)[1] == 0

    with Simulator(fmu) as simulator:
        expected = simulator.run(stop_time=0.1).x

        def run_and_close() -> bool:
            same = np.array_equal(simulator.run(stop_time=0.1).x, expected)
            simulator.close()
            return same

        def refused() -> bool:
            with pytest.raises(SimulationError, match="forked"):
                simulator.run(stop_time=0.1)
            simulator.close()
            return True

        assert in_child(run_and_close)
        children: list[bool] = []
        with ThreadPoolExecutor(1) as thread:
            thread.submit(
                simulator.run, stop_time=0.1, progress=lambda _: children.append(in_child(refused))
            ).result()
        assert all(children)
        np.testing.assert_array_equal(simulator.run(stop_time=0.1).x, expected)
