"""What a sweep costs beyond its runs: `python -m tests.bench.sweep_cost [--graphs 200] [--rounds 3]`.

For connected graphs of the paper's example, alternately: CPU time of a sweep in one process and of one
fmi2DoStep over the horizon for each graph; then wall time of two processes beside one. Prints medians as
JSON, times in s. Needs the package, so that the environment of the benchmarks starts it in the project's own.
"""

from __future__ import annotations

import argparse
import json
import resource
import statistics
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import fmpy
from fmpy.fmi2 import FMU2Slave

from mixed_order_game.fmu.build import default_fmu
from mixed_order_game.fmu.model import read_model
from mixed_order_game.game.graphs import CommunicationGraph
from mixed_order_game.studies.sweep.conduct import connected_graphs_example, sweep
from mixed_order_game.studies.sweep.definition import Sweep


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--graphs", type=int, default=200)
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    definition = connected_graphs_example(default_fmu())
    definition = replace(definition, graphs=definition.graphs[-arguments.graphs :])
    alone, swept, ratios, speedups = [], [], [], []
    for _ in range(arguments.rounds):
        runs = steps_alone(definition.graphs) / len(definition.graphs)
        (cpu, wall), (_, wall_of_two) = (sweep_with(definition, jobs) for jobs in (1, 2))
        alone.append(runs)
        swept.append(cpu / len(definition.graphs))
        ratios.append(swept[-1] / runs)
        speedups.append(wall / wall_of_two)
    measured = {"step": alone, "run": swept, "ratio": ratios, "speedup": speedups}
    medians = {name: statistics.median(values) for name, values in measured.items()}
    print(json.dumps({"graphs": len(definition.graphs), **medians}))


def steps_alone(graphs: tuple[CommunicationGraph, ...]) -> float:
    """CPU seconds of the steps alone, one a graph."""
    model = read_model(default_fmu())
    with tempfile.TemporaryDirectory() as folder:
        fmpy.extract(str(model.path), unzipdir=folder)
        slave = FMU2Slave(
            guid=model.guid, modelIdentifier="MixedOrderGame", unzipDirectory=folder, instanceName="alone"
        )
        slave.instantiate()
        spent = 0.0
        for graph in graphs:
            values = graph.start_values(model)
            slave.setupExperiment(tolerance=1e-6, startTime=0.0)
            slave.setReal([model.variable(name).reference for name in values], [*values.values()])
            slave.enterInitializationMode()
            slave.exitInitializationMode()
            begun = time.process_time()
            slave.doStep(0.0, model.stop_time)
            spent += time.process_time() - begun
            slave.reset()
        slave.freeInstance()
    return spent


def sweep_with(definition: Sweep, jobs: int) -> tuple[float, float]:
    """CPU seconds, those of its processes included, and wall seconds."""
    with tempfile.TemporaryDirectory() as folder:
        begun, wall = _cpu(), time.perf_counter()
        sweep(definition, Path(folder) / "sweep", jobs=jobs)
        return _cpu() - begun, time.perf_counter() - wall


def _cpu() -> float:
    usage = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in usage)


if __name__ == "__main__":
    main()
