"""Runs an FMU with fmuloader: `python fmuloader_simulate.py FMU STEPS STEP EVERY CSV VARIABLE...`.

Sets tolerance_relative to 1e-8 and writes the variables at the start and after every EVERY steps. Halfway the
state is serialized, put into a second instance, and both have to go on with the same bits.
"""

import sys
import zipfile
from pathlib import Path
from xml.etree import ElementTree as ET

from fmuloader.fmi2 import Fmi2Slave, Fmi2Type


def main() -> None:
    fmu, steps, step, every, csv, *names = sys.argv[1:]
    with zipfile.ZipFile(fmu) as archive:
        description = ET.fromstring(archive.read("modelDescription.xml"))  # noqa: S314 - our own file
    references = {
        variable.attrib["name"]: int(variable.attrib["valueReference"])
        for variable in description.iter("ScalarVariable")
    }
    wanted = [references[name] for name in names]

    def started() -> Fmi2Slave:
        slave = Fmi2Slave(fmu, model_identifier="MixedOrderGame")
        slave.instantiate("game", Fmi2Type.CO_SIMULATION, guid=description.attrib["guid"])
        slave.set_real([references["tolerance_relative"]], [1e-8])
        slave.setup_experiment(stop_time=int(steps) * float(step))
        slave.enter_initialization_mode()
        slave.exit_initialization_mode()
        return slave

    lines = [";".join(["time", *names])]
    with started() as slave, started() as twin:
        for k in range(int(steps) + 1):
            values = slave.get_real(wanted)
            if k % int(every) == 0:
                lines.append(";".join(repr(value) for value in (k * float(step), *values)))
            if 2 * k > int(steps) and twin.get_real(wanted) != values:
                sys.exit(f"an instance from a serialized state differs at {k * float(step):g} s")
            if 2 * k == int(steps):
                state = slave.get_fmu_state()
                copy = twin.deserialize_fmu_state(slave.serialize_fmu_state(state))
                twin.set_fmu_state(copy)
                twin.free_fmu_state(copy)
                slave.free_fmu_state(state)
            for each in (slave, twin) if 2 * k >= int(steps) else (slave,):
                if k < int(steps):
                    each.do_step(k * float(step), float(step))
        for each in (slave, twin):
            each.terminate()
            each.free_instance()
    Path(csv).write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
