"""Runs an FMU with libcosim: `python libcosim_simulate.py FMU STEPS STEP EVERY CSV VARIABLE...`.

Sets tolerance_relative to 1e-8 and writes the variables after every EVERY steps.
"""

import sys
from pathlib import Path

from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

from mixed_order_game import read_model


def main() -> None:
    fmu, steps, step, every, csv, *names = sys.argv[1:]
    model = read_model(fmu)
    references = [model.variable(name).reference for name in names]
    execution = CosimExecution.from_step_size(step_size=round(float(step) * 1e9))  # ns
    slave = execution.add_local_slave(CosimLocalSlave(fmu_path=fmu, instance_name="game"))
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    execution.real_initial_value(slave, model.variable("tolerance_relative").reference, 1e-8)
    lines = [";".join(["time", *names])]
    for k in range(int(every), int(steps) + 1, int(every)):
        if not execution.step(int(every)):
            sys.exit(f"the step to {k * float(step):g} s failed")
        values = (k * float(step), *observer.last_real_values(slave, references))
        lines.append(";".join(repr(value) for value in values))
    Path(csv).write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
