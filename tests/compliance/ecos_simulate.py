"""Runs an FMU with Ecos: `python ecos_simulate.py FMU STEPS STEP EVERY CSV VARIABLE...`.

Sets tolerance_relative to 1e-8 and writes the variables at the start and after every EVERY steps.
"""

import sys
from pathlib import Path

from ecospy import EcosSimulation, EcosSimulationStructure
from ecospy.EcosParameterSet import EcosParameterSet


def main() -> None:
    fmu, steps, step, every, csv, *names = sys.argv[1:]
    structure = EcosSimulationStructure()
    structure.add_model("game", fmu)
    parameters = EcosParameterSet()
    parameters.add_real("game::tolerance_relative", 1e-8)
    structure.add_parameter_set("accurate", parameters)
    lines = [";".join(["time", *names])]
    with EcosSimulation(structure=structure, step_size=float(step)) as simulation:
        simulation.init(parameter_set="accurate")
        for k in range(int(steps) + 1):
            if k % int(every) == 0:
                values = [simulation.get_real(f"game::{name}") for name in names]
                lines.append(";".join(repr(value) for value in (k * float(step), *values)))
            if k < int(steps):
                simulation.step(1)
        simulation.terminate()
    Path(csv).write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
