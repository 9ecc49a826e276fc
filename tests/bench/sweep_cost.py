"""What a sweep costs beyond its runs: `python -m tests.bench.sweep_cost [--graphs 200] [--rounds 3]`.

For connected graphs of the paper's example, alternately: CPU time of a sweep in one process and of one
fmi2DoStep over the horizon for each graph; wall time of two processes beside one; and, as what the machine
allows, the same of FMI calls alone, without a sweep. Prints medians as JSON, times in s. Needs the package,
so that the environment of the benchmarks starts it in the project's own.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import statistics
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import psutil

import mixed_order_game as mog  # light to import, as in a script of a user, which every worker reads

if TYPE_CHECKING:
    from collections.abc import Sequence
    from threading import Barrier

    from mixed_order_game.game.graphs import CommunicationGraph


def main() -> None:
    """Measure and print."""
    from mixed_order_game.fmu.build import default_fmu
    from mixed_order_game.studies.sweep.conduct import connected_graphs_example

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--graphs", type=int, default=200)
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    definition = connected_graphs_example(default_fmu())
    definition = replace(definition, graphs=definition.graphs[-arguments.graphs :])
    measured: dict[str, list[float]] = {}
    for _ in range(arguments.rounds):
        runs = calls_alone(definition.graphs) / len(definition.graphs)
        (cpu, wall), (_, wall_of_two) = (sweep_with(definition, jobs) for jobs in (1, 2))
        alone, alone_of_two = (wall_of_calls(definition.graphs, processes) for processes in (1, 2))
        run = cpu / len(definition.graphs)
        figures = {
            "step": runs,
            "run": run,
            "ratio": run / runs,
            "speedup": wall / wall_of_two,
            "limit": alone / alone_of_two,
        }
        for name, value in figures.items():
            measured.setdefault(name, []).append(value)
    medians = {name: statistics.median(values) for name, values in measured.items()}
    print(json.dumps({"graphs": len(definition.graphs), **medians}))


def calls_alone(graphs: Sequence[CommunicationGraph], barrier: Barrier | None = None) -> float:
    """CPU seconds of fmi2DoStep over the horizon, one a graph, on one instance.

    barrier: passed when the instance is there, and again after the last graph.
    """
    import fmpy
    from fmpy.fmi2 import FMU2Slave

    from mixed_order_game.fmu.build import default_fmu

    model = mog.read_model(default_fmu())
    with tempfile.TemporaryDirectory() as folder:
        fmpy.extract(str(model.path), unzipdir=folder)
        slave = FMU2Slave(
            guid=model.guid, modelIdentifier="MixedOrderGame", unzipDirectory=folder, instanceName="alone"
        )
        slave.instantiate()
        starts = [graph.start_values(model) for graph in graphs]
        spent = 0.0
        if barrier is not None:
            barrier.wait()
        for values in starts:
            slave.setupExperiment(tolerance=1e-6, startTime=0.0)
            slave.setReal([model.variable(name).reference for name in values], [*values.values()])
            slave.enterInitializationMode()
            slave.exitInitializationMode()
            begun = time.process_time()
            slave.doStep(0.0, model.stop_time)
            spent += time.process_time() - begun
            slave.reset()
        if barrier is not None:
            barrier.wait()
        slave.freeInstance()
    return spent


def wall_of_calls(graphs: Sequence[CommunicationGraph], processes: int) -> float:
    """Wall seconds of the FMI calls for all graphs, spread over processes that are ready beforehand."""
    context = multiprocessing.get_context("spawn")
    barrier = context.Barrier(processes + 1)
    workers = [
        context.Process(target=calls_alone, args=(graphs[k::processes], barrier)) for k in range(processes)
    ]
    for worker in workers:
        worker.start()
    barrier.wait()
    begun = time.perf_counter()
    barrier.wait()
    wall = time.perf_counter() - begun
    for worker in workers:
        worker.join()
    return wall


def sweep_with(definition: mog.Sweep, jobs: int) -> tuple[float, float]:
    """CPU seconds, those of its processes included, and wall seconds."""
    with tempfile.TemporaryDirectory() as folder:
        begun, wall = _cpu(), time.perf_counter()
        mog.sweep(definition, Path(folder) / "sweep", jobs=jobs)
        return _cpu() - begun, time.perf_counter() - wall


def _cpu() -> float:
    """CPU seconds of this process and of all below it, those that have ended included."""
    this = psutil.Process()
    processes = [this, *this.children(recursive=True)]
    return sum(sum(each.cpu_times()[:4]) for each in processes)  # user, system, and those of ended children


if __name__ == "__main__":
    main()
