"""A thousand instances of the FMU's binary, alive together and one after another, do not grow."""

from pathlib import Path

import fmpy
import pytest
from fmpy.fmi2 import FMU2Slave

from mixed_order_game import read_model

INSTANCES = 1000


def resident_kib() -> int:
    line = next(
        line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmRSS")
    )
    return int(line.split()[1])


@pytest.fixture(scope="module")
def unpacked(fmu: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    folder = tmp_path_factory.mktemp("unpacked")
    fmpy.extract(str(fmu), unzipdir=folder)
    return read_model(fmu).guid, folder


def start(unpacked: tuple[str, Path], name: str) -> FMU2Slave:
    guid, folder = unpacked
    slave = FMU2Slave(
        guid=guid, modelIdentifier="MixedOrderGame", unzipDirectory=str(folder), instanceName=name
    )
    slave.instantiate()
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    return slave


def test_one_after_another_does_not_grow(unpacked: tuple[str, Path]) -> None:
    keeper = start(unpacked, "keeper")  # keeps the library loaded

    def cycle(count: int) -> None:
        for k in range(count):
            slave = start(unpacked, f"instance {k}")
            slave.doStep(0.0, 0.01)
            slave.terminate()
            slave.fmi2FreeInstance(slave.component)

    cycle(50)
    before = resident_kib()
    cycle(INSTANCES)
    assert resident_kib() - before < 8 * 1024
    keeper.fmi2FreeInstance(keeper.component)


def test_together_they_are_independent_and_small(unpacked: tuple[str, Path]) -> None:
    first = start(unpacked, "first")
    before = resident_kib()
    others = [start(unpacked, f"instance {k}") for k in range(INSTANCES)]
    each = (resident_kib() - before) / INSTANCES
    assert each < 2048, f"{each:.0f} KiB an instance"
    reference = next(v.reference for v in _variables(unpacked) if v.name == "x[1,1]")
    values = set()
    for slave in (first, others[0], others[-1]):
        slave.doStep(0.0, 0.1)
        values.add(slave.getReal([reference])[0])
    assert len(values) == 1
    assert others[1].getReal([reference]) == [-5.0]
    for slave in (first, *others):
        slave.fmi2FreeInstance(slave.component)


def _variables(unpacked: tuple[str, Path]) -> list["_Named"]:
    description = fmpy.read_model_description(str(unpacked[1]), validate=False)
    return [_Named(v.name, v.valueReference) for v in description.modelVariables]


class _Named:
    def __init__(self, name: str, reference: int) -> None:
        self.name, self.reference = name, reference
