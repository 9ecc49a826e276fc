"""Runs a system structure of players' FMUs with Ecos.

`python ecos_ssp.py SSP STOP STEP CSV ACTION...`
Writes the actions, such as x[1,2], at the end.
"""

import sys
from pathlib import Path

from ecospy import EcosSimulation
from fmpy.ssp.ssd import read_ssd


def main() -> None:
    ssp, stop, step, csv, *names = sys.argv[1:]
    holder = {
        connector.name: component.name
        for component in read_ssd(ssp).system.elements
        for connector in component.connectors
        if connector.kind == "output"
    }
    with EcosSimulation(ssp_path=ssp, step_size=float(step)) as simulation:
        simulation.init()
        simulation.step(round(float(stop) / float(step)))
        values = [simulation.get_real(f"{holder[name]}::{name}") for name in names]
        simulation.terminate()
    lines = [";".join(["time", *names]), ";".join(repr(value) for value in (float(stop), *values))]
    Path(csv).write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
