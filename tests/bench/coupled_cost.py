"""What players apart cost beside the whole game: `python -m tests.bench.coupled_cost [--rounds 11]`.

One FMU a player, all in one process, exchange what they hear once a communication step, as in `mog periods`:
all take their step, then each is told what the others' outputs are. They take turns with the whole game and
with themselves when they are idle, told the same every time. Each FMU loads the library that it brings, or
all load one file. Prints medians as JSON, CPU times in s of a communication step. Needs the package, so that
the environment of the benchmarks starts it in the project's own.
"""

from __future__ import annotations

import argparse
import json
import statistics
import tempfile
import time
from ctypes import c_double, c_int, c_size_t, c_void_p
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave, fmi2OK, fmi2True

from mixed_order_game import build_fmu, read_model
from mixed_order_game.fmu.build import native_library, shipped_games
from mixed_order_game.fmu.parts import build_part

from .scaling_game import scaling_game

STEP = 0.02
TOLERANCE = 1e-6


class Fmu:
    """An instance that is stepped with as little of Python around the calls as ctypes allows."""

    def __init__(self, file: Path, folder: Path, library: Path | None = None) -> None:
        fmpy.extract(str(file), unzipdir=str(folder))
        description: Any = fmpy.read_model_description(str(folder))
        reference = {v.name: v.valueReference for v in description.modelVariables}
        heard = [v.name for v in description.modelVariables if v.causality == "input"]
        self.heard = [name for name in heard if not name.startswith("d_ext[")]
        self.told = [v.name for v in description.modelVariables if v.causality == "output"]
        self._slave = FMU2Slave(
            guid=description.guid,
            unzipDirectory=str(folder),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=file.stem,
            libraryPath=None if library is None else str(library),
        )
        self._slave.instantiate()
        self.order = next(int(v.start) for v in description.modelVariables if v.name.startswith("order["))
        self._counted = [reference["solver_rhs_evaluations"]]
        self._component = c_void_p(self._slave.component)
        functions: Any = self._slave.dll
        self._do_step = functions["fmi2DoStep"]
        self._do_step.argtypes = [c_void_p, c_double, c_double, c_int]
        self._get, self._set = functions["fmi2GetReal"], functions["fmi2SetReal"]
        for function in (self._get, self._set):
            function.argtypes = [c_void_p, c_void_p, c_size_t, c_void_p]
        self._references = [
            np.array([reference[name] for name in names], np.uint32) for names in (self.heard, self.told)
        ]
        self.inputs, self.outputs = np.zeros(len(self.heard)), np.zeros(len(self.told))
        self._inputs, self._outputs = (
            (self._component, references.ctypes.data, len(values), values.ctypes.data)
            for references, values in zip(self._references, (self.inputs, self.outputs), strict=True)
        )

    def initialize(self) -> None:
        """Up to initialization mode, anew."""
        self._slave.reset()
        self._slave.setupExperiment(tolerance=TOLERANCE, startTime=0.0)
        self._slave.enterInitializationMode()

    def begin(self) -> None:
        """Leave initialization mode."""
        self._slave.exitInitializationMode()

    def step(self, t: float) -> None:
        """Take one step."""
        _require_ok(self._do_step(self._component, t, STEP, fmi2True))

    def read(self) -> None:
        """Get the outputs."""
        _require_ok(self._get(*self._outputs))

    def tell(self) -> None:
        """Set the inputs."""
        _require_ok(self._set(*self._inputs))

    @property
    def evaluations(self) -> int:
        """Right-hand sides since the start."""
        return int(self._slave.getInteger(self._counted)[0])

    def close(self) -> None:
        """Free the instance."""
        self._slave.freeInstance()


def _require_ok(status: int) -> None:
    if status != fmi2OK:
        raise RuntimeError("a call failed")


class Parts:
    """FMUs that hear each other."""

    def __init__(self, fmus: list[Fmu]) -> None:
        self._fmus = fmus
        place = {name: k for k, name in enumerate(name for fmu in fmus for name in fmu.told)}
        self._places = [np.array([place[name] for name in fmu.heard], np.intp) for fmu in fmus]

    def run(self, steps: int, *, idle: bool) -> dict[str, float]:
        """CPU seconds of a communication step, of fmi2DoStep and of the calls that set and get."""
        fmus = self._fmus
        for fmu in fmus:
            fmu.initialize()
        self._exchange()
        for fmu in fmus:
            fmu.begin()
        stepping = exchanging = 0.0
        for k in range(steps):
            begun = time.process_time()
            for fmu in fmus:
                fmu.step(k * STEP)
            done = time.process_time()
            stepping += done - begun
            exchanging += self._exchange(told_anew=not idle)
        return {"step": stepping / steps, "exchange": exchanging / steps}

    def _exchange(self, *, told_anew: bool = True) -> float:
        begun = time.process_time()
        for fmu in self._fmus:
            fmu.read()
        spent = time.process_time() - begun
        if told_anew:
            told = np.concatenate([fmu.outputs for fmu in self._fmus])
            for fmu, places in zip(self._fmus, self._places, strict=True):
                fmu.inputs[:] = told[places]
        begun = time.process_time()
        for fmu in self._fmus:
            fmu.tell()
        return spent + time.process_time() - begun


def coupled_cost(game: Path, stop: float, rounds: int, scratch: Path) -> dict[str, Any]:
    """Medians of rounds in which the whole game, its parts and the idle parts take turns."""
    numbers = range(1, read_model(game).players + 1)
    files = [build_part(game, [i], scratch / f"{i}.fmu") for i in numbers]
    whole = Fmu(build_fmu(game, scratch / "whole.fmu"), scratch / "whole")
    apart = {
        "own": [Fmu(file, scratch / f"own_{file.stem}") for file in files],
        "one": [Fmu(file, scratch / f"one_{file.stem}", native_library()) for file in files],
    }
    steps = round(stop / STEP)
    measured: dict[str, list[float]] = {}
    for _ in range(rounds):
        alone = Parts([whole]).run(steps, idle=True)
        figures = {"whole": alone["step"]}
        for library, fmus in apart.items():
            idle = Parts(fmus).run(steps, idle=True)
            coupled = Parts(fmus).run(steps, idle=False)
            figures |= {
                f"{library}_idle": idle["step"],
                f"{library}_idle_ratio": idle["step"] / alone["step"],
                f"{library}_coupled": coupled["step"],
                f"{library}_coupled_ratio": coupled["step"] / alone["step"],
                f"{library}_exchange": coupled["exchange"],
            }
        for name, value in figures.items():
            measured.setdefault(name, []).append(value)
    evaluations: dict[str, list[float]] = {"whole": [whole.evaluations / steps]}
    for fmu in apart["own"]:
        evaluations.setdefault(f"order {fmu.order}", []).append(fmu.evaluations / steps)
    for fmu in [whole, *apart["own"], *apart["one"]]:
        fmu.close()
    medians = {name: statistics.median(values) for name, values in measured.items()}
    ranges = {name: [min(counts), max(counts)] for name, counts in evaluations.items()}
    return {"players": len(numbers), "stop": stop, "evaluations": ranges, **medians}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=11)
    arguments = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scaling_20.toml"
        file.write_text(scaling_game(20), encoding="utf-8")
        five = shipped_games()["five_vehicles"]
        for game, stop in ((five, 20.0), (file, 10.0)):
            scratch = Path(folder) / game.stem
            scratch.mkdir()
            rows.append(coupled_cost(game, stop, arguments.rounds, scratch))
    print(json.dumps({"step": STEP, "rows": rows}))


if __name__ == "__main__":
    main()
