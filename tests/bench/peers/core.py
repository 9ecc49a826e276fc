"""The bare core, run by the program core_run."""

from __future__ import annotations

import json
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.oracle.game import FloatArray


@dataclass(frozen=True)
class CoreRun:
    """What core_run reports; times in s."""

    states: int
    level: str
    steps: int
    rate_evaluations: int
    setups: int
    solves: int
    events: int
    peak_mb: float
    reading: float  # the game, until it can run
    cpu: list[float]
    trajectory: FloatArray  # (T, 2 N D): x, then z or v, coordinate-major

    @property
    def median(self) -> float:
        """Median CPU time of the repetitions."""
        return float(np.median(self.cpu))


@dataclass(frozen=True)
class Core:
    """One game file with equally spaced outputs."""

    program: Path
    game: Path
    stop: float
    outputs: int

    def run(self, rtol: float, *, repetitions: int = 1, solver: str = "structured") -> CoreRun:
        """Runs the game in a process of its own; the absolute tolerance is 0.01 rtol."""
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "trajectory"
            options = {
                "--stop": self.stop,
                "--outputs": self.outputs,
                "--rtol": rtol,
                "--repetitions": repetitions,
                "--solver": solver,
                "--write": file,
            }
            words = [str(word) for pair in options.items() for word in pair]
            done = subprocess.run(
                [str(self.program), str(self.game), *words], check=True, capture_output=True, text=True
            )
            trajectory = np.fromfile(file).reshape(self.outputs + 1, -1)
        return CoreRun(trajectory=trajectory, **json.loads(done.stdout))
