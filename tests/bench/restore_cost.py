"""What saving and restoring a state costs: `python -m tests.bench.restore_cost [--players 5 50 200]`.

For the paper's game (N = 5) and the scaling family: CPU time of fmi2GetFMUstate and fmi2SetFMUstate at many
times of a run, beside that of the run itself; the restored state is checked. Prints a Markdown table.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmpy
from fmpy.fmi2 import FMU2Slave

from mixed_order_game import build_fmu, default_game

from .scaling_game import scaling_game

STEP = 0.1  # s
STOP = {5: 20.0, 50: 10.0, 200: 5.0}  # s


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--players", type=int, nargs="+", default=[5, 50, 200])
    print("| N | states | bytes | save | restore, median | restore, longest | a run of 1 s |")
    print("|---|---|---|---|---|---|---|")
    for players in parser.parse_args().players:
        with tempfile.TemporaryDirectory() as folder:
            print(row(players, Path(folder)), flush=True)


def row(players: int, folder: Path) -> str:
    """The table's line for N players."""
    game = default_game()
    if players != 5:
        game = folder / "game.toml"
        game.write_text(scaling_game(players), encoding="utf-8")
    fmu = build_fmu(game, folder / "game.fmu")
    description = fmpy.read_model_description(str(fmu), validate=False)
    fmpy.extract(str(fmu), unzipdir=folder / "fmu")
    slave = FMU2Slave(
        guid=description.guid,
        modelIdentifier="MixedOrderGame",
        unzipDirectory=str(folder / "fmu"),
        instanceName="measured",
    )
    slave.instantiate()
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    outputs = [v.valueReference for v in description.modelVariables if v.causality == "output"]
    stop = STOP.get(players, 5.0)
    running, saving, restoring = 0.0, [], []
    size = 0
    for k in range(round(stop / STEP)):
        running += _cpu(lambda k=k: slave.doStep(k * STEP, STEP))  # type: ignore[misc]
        values = slave.getReal(outputs)
        saved: list[Any] = []
        saving.append(_cpu(lambda saved=saved: saved.append(slave.getFMUstate())))  # type: ignore[misc]
        restoring.append(_cpu(lambda saved=saved: slave.setFMUstate(saved[0])))  # type: ignore[misc]
        if slave.getReal(outputs) != values:
            raise SystemExit(f"N = {players}: the state restored at {(k + 1) * STEP:g} s differs")
        size = len(slave.serializeFMUstate(saved[0]))
        slave.freeFMUstate(saved[0])
    slave.terminate()
    slave.freeInstance()
    states = len(description.derivatives) or (2 + players + 11) * players * 2
    times = (statistics.median(saving), statistics.median(restoring), max(restoring), running / stop)
    return f"| {players} | {states} | {size} | {' | '.join(f'{1e3 * each:.3g} ms' for each in times)} |"


def _cpu(action: Callable[[], object]) -> float:
    begun = time.process_time()
    action()
    return time.process_time() - begun


if __name__ == "__main__":
    main()
