"""What it costs to change something at every communication point of the paper's example."""

from __future__ import annotations

import statistics
import time
from pathlib import Path
from typing import Any

import fmpy
from fmpy.fmi2 import FMU2Slave

STOP, STEP = 20.0, 0.02

CHANGES = {
    "an input": ("d_ext[1,1]", 0.0, 0.1),
    "a gain": ("k1", 10.0, 10.01),
    "the weight of an edge": ("a[1,2]", 1.0, 1.001),
}
"""Variable, its own value, and the one that takes turns with it."""


def change_cost(fmu: Path, scratch: Path, rounds: int) -> dict[str, Any]:
    """CPU time in s of a step before which a value is set anew, and of one before which it is set as it was.

    Medians of runs next to each other, so that the calls themselves cancel in the difference.
    """
    folder = fmpy.extract(str(fmu), unzipdir=str(scratch / "changes"))
    description: Any = fmpy.read_model_description(folder)
    reference = {v.name: v.valueReference for v in description.modelVariables}
    slave = FMU2Slave(
        guid=description.guid,
        unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="changes",
    )
    slave.instantiate()
    rows = {}
    for name, (variable, own, other) in CHANGES.items():
        idle, changed = [], []
        for _ in range(rounds):
            idle.append(_seconds_a_step(slave, reference[variable], [own, own]))
            changed.append(_seconds_a_step(slave, reference[variable], [own, other]))
        beyond = statistics.median(b - a for a, b in zip(idle, changed, strict=True))
        rows[name] = {
            "idle": statistics.median(idle),
            "changed": statistics.median(changed),
            "beyond": beyond,
        }
    slave.freeInstance()
    return {"step": STEP, "rows": rows}


def _seconds_a_step(slave: Any, reference: int, values: list[float]) -> float:
    slave.setupExperiment(tolerance=1e-6, startTime=0.0)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    steps = round(STOP / STEP)
    begun = time.process_time()
    for k in range(steps):
        slave.setReal([reference], [values[k % 2]])
        slave.doStep(k * STEP, STEP)
    spent = time.process_time() - begun
    slave.reset()
    return spent / steps
