"""The project's own FMU, driven step by step by fmpy as a co-simulation master would."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave

from tests.oracle.game import FloatArray, Game

from .hybrid_model import Solution


class FmuThroughFmpy:
    """One game's FMU with fixed output times, at any tolerance; states hold x alone."""

    def __init__(self, game: Game, times: FloatArray, archive: Path, folder: Path) -> None:
        self.times = times
        self.folder = fmpy.extract(str(archive), unzipdir=str(folder))
        self.description: Any = fmpy.read_model_description(self.folder)
        reference = {v.name: v.valueReference for v in self.description.modelVariables}
        self.outputs = [
            reference[f"x[{i + 1},{coordinate + 1}]"]
            for coordinate in range(game.dimension)
            for i in range(game.players)
        ]

    def solve(self, rtol: float) -> Solution:
        """Integrates; CPU time is that of the fmi2DoStep and fmi2GetReal calls through fmpy."""
        fmu = FMU2Slave(
            guid=self.description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
        )
        fmu.instantiate()
        times = self.times
        fmu.setupExperiment(tolerance=rtol, startTime=float(times[0]), stopTime=float(times[-1]))
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        rows = [fmu.getReal(self.outputs)]
        begun = time.process_time()
        for start, stop in zip(times[:-1].tolist(), times[1:].tolist(), strict=True):
            fmu.doStep(currentCommunicationPoint=start, communicationStepSize=stop - start)
            rows.append(fmu.getReal(self.outputs))
        cpu = time.process_time() - begun
        fmu.terminate()
        fmu.freeInstance()
        return Solution(np.array(rows), cpu, 0)
