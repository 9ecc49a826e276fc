"""Runs a system structure of players' FMUs with fmpy.

`python fmpy_ssp.py SSP STOP STEP CSV ACTION...`
Writes the actions, such as x[1,2], at the end.
"""

import sys
from pathlib import Path

from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import read_ssd


def main() -> None:
    ssp, stop, step, csv, *names = sys.argv[1:]
    rows = simulate_ssp(ssp, stop_time=float(stop) - 0.5 * float(step), step_size=float(step))
    holder = {
        connector.name: component.name
        for component in read_ssd(ssp).system.elements
        for connector in component.connectors
        if connector.kind == "output"
    }
    values = [float(rows[f"{holder[name]}.{name}"][-1]) for name in names]
    lines = [";".join(["time", *names]), ";".join(repr(value) for value in (float(stop), *values))]
    Path(csv).write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
