"""Signals: never lost, nothing left behind, no traceback, and what was found so far is kept."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from mixed_order_game import Simulator
from mixed_order_game.cli.app import app
from mixed_order_game.interrupts import end_as_exceptions, noted_signals
from mixed_order_game.studies.sampler import Sampler, Settings
from mixed_order_game.studies.tune import tune


def press(number: int = signal.SIGINT) -> None:
    os.kill(os.getpid(), number)


class PressedWhenFinalized:
    def __del__(self) -> None:
        press()


def test_a_finalizer_does_not_swallow_an_interrupt() -> None:
    before = signal.getsignal(signal.SIGINT)
    reached = []

    def work() -> None:
        with noted_signals() as take:
            take()
            PressedWhenFinalized()
            reached.append("after the finalizer")
            take()
            reached.append("never")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert reached == ["after the finalizer"]
    assert signal.getsignal(signal.SIGINT) is before


def test_an_interrupt_is_taken_at_the_end_at_the_latest() -> None:
    with pytest.raises(KeyboardInterrupt), noted_signals():
        press()


def test_a_second_interrupt_does_not_wait() -> None:
    reached = []

    def work() -> None:
        with noted_signals():
            press()
            reached.append("first")
            press()
            reached.append("second")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert reached == ["first"]


def test_what_ignores_signals_goes_on_ignoring_them() -> None:
    before = {number: signal.signal(number, signal.SIG_IGN) for number in (signal.SIGINT, signal.SIGHUP)}
    try:
        end_as_exceptions()
        with noted_signals() as take:
            press()
            press(signal.SIGHUP)
            take()
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def test_other_threads_leave_signals_alone() -> None:
    before = signal.getsignal(signal.SIGINT)
    seen = []

    def inside() -> None:
        with noted_signals():
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=inside)
    thread.start()
    thread.join()
    assert seen == [before]


def test_a_run_is_interrupted_and_the_simulator_usable(fmu: Path) -> None:
    times: list[float] = []

    def progress(now: float) -> None:
        times.append(now)
        if len(times) == 3:
            press()
            times.append(-1.0)  # not in the middle of what is called

    with Simulator(fmu) as simulator:
        with pytest.raises(KeyboardInterrupt):
            simulator.run(progress=progress)
        assert times[2:] == [pytest.approx(0.06), -1.0]
        assert simulator.run(stop_time=0.1).time[-1] == 0.1


@pytest.mark.parametrize("stage", ["linear loop", "polishing"])
def test_tune_keeps_the_best_so_far(stage: str, fmu: Path) -> None:
    def progress(name: str, part: float) -> None:
        if name == stage and part < 0.3:
            press()

    found = tune(fmu, 1.0, gains=["k1", "k2"], seed=1, progress=progress)
    assert found.interrupted
    assert found.as_json()["interrupted"] is True
    with Sampler(fmu) as sampler:
        assert sampler.measure(found.gains, Settings(stop_time=4.0)) == found.metrics[0]
    assert (dict(found.gains) == dict(found.start_gains)) == (stage == "linear loop")
    if stage == "polishing":
        assert found.met


PRESSES_AT_AN_IMPORT = """
import os, signal, sys

class Press:
    def find_spec(self, name, path=None, target=None):
        if name == {name!r}:
            os.kill(os.getpid(), signal.SIGINT)
            sys.meta_path.remove(self)

sys.meta_path.insert(0, Press())
sys.argv = ["mog", *{arguments!r}]
from mog_command import main
main()
"""


def mog_interrupted_at_the_import_of(name: str, *arguments: object) -> "subprocess.CompletedProcess[str]":
    script = PRESSES_AT_AN_IMPORT.format(name=name, arguments=[str(each) for each in arguments])
    return subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)


@pytest.mark.parametrize("name", ["mixed_order_game", "numpy", "typer", "matplotlib.axes"])
def test_no_traceback_in_the_first_second(name: str, fmu: Path) -> None:
    done = mog_interrupted_at_the_import_of(name, "plot", fmu)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "mog: interrupted\n")


def test_tune_prints_the_best_so_far(fmu: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def evolution(cost: Callable[[np.ndarray], float], _box: object, **_options: object) -> None:
        press()
        cost(np.zeros(1))

    monkeypatch.setattr("scipy.optimize.differential_evolution", evolution)
    arguments = ["tune", str(fmu), "--settling-time", "1", "--gains", "k1"]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 130
    assert "use: --set k1=10" in done.stdout
    assert done.stderr.endswith("mog: interrupted; these are the best gains so far\n")


@pytest.mark.parametrize(("how", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)])
def test_a_command_that_is_ended_leaves_nothing(
    how: signal.Signals, code: int, fmu: Path, tmp_path: Path
) -> None:
    """As soon as the library of the unpacked FMU is in its memory, and while it runs."""
    command = [sys.executable, "-m", "mixed_order_game", "run", str(fmu), "--stop-time", "1e5", "--output"]
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    with subprocess.Popen(
        [*command, str(tmp_path / "run.csv")], env=environment, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            maps = Path(f"/proc/{process.pid}/maps")
            deadline = time.monotonic() + 60.0
            while "MixedOrderGame.so" not in maps.read_text():
                assert time.monotonic() < deadline
                assert process.poll() is None
                time.sleep(0.01)
            process.send_signal(how)
            told = process.communicate(timeout=60.0)[1]
        finally:
            process.kill()
    assert process.returncode == code
    assert told == ("mog: interrupted\n" if how == signal.SIGINT else "")
    assert list(tmp_path.iterdir()) == []


def test_ctrl_c_while_a_sweep_starts_its_workers(fmu: Path, tmp_path: Path) -> None:
    """A terminal sends it to the workers, too, which are still importing."""
    grid = "k1=" + ",".join(map(str, range(1, 401)))
    arguments = ["sweep", str(fmu), "--grid", grid, "--jobs", "2", "--output", str(tmp_path / "s")]
    with subprocess.Popen(
        [sys.executable, "-m", "mixed_order_game", *arguments],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
        deadline = time.monotonic() + 60.0
        while len(children.read_text().split()) < 2:  # multiprocessing's tracker and the first worker
            assert time.monotonic() < deadline
            assert process.poll() is None
            time.sleep(0.005)
        os.killpg(process.pid, signal.SIGINT)
        told = process.communicate(timeout=60.0)[1]
    assert process.returncode == 130
    assert told == f"mog: interrupted; the same command goes on with the rows in {tmp_path / 's'}\n"
