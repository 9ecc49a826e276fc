"""Runs a system structure of players' FMUs with libcosim.

`python libcosim_ssp.py SSP STOP STEP CSV ACTION...`
Writes the actions, such as x[1,2], at the end.
"""

import sys
import tempfile
import zipfile
from pathlib import Path

from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver

from mixed_order_game import read_model


def main() -> None:
    ssp, stop, step, csv, *names = sys.argv[1:]
    with tempfile.TemporaryDirectory() as folder:
        with zipfile.ZipFile(ssp) as archive:
            archive.extractall(folder)
        models = {file.stem: read_model(file) for file in Path(folder, "resources").glob("*.fmu")}
        execution = CosimExecution.from_ssp_file(ssp_path=folder, step_size=round(float(step) * 1e9))  # ns
        observer = CosimObserver.create_last_value()
        execution.add_observer(observer)
        if not execution.step(round(float(stop) / float(step))):
            sys.exit(f"the steps to {stop} s failed")
        values = []
        for name in names:
            part = next(part for part, model in models.items() if f"u{name[1:]}" in model.variables)
            reference = models[part].variable(name).reference
            values += observer.last_real_values(execution.slave_index_from_instance_name(part), [reference])
    lines = [";".join(["time", *names]), ";".join(repr(value) for value in (float(stop), *values))]
    Path(csv).write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
