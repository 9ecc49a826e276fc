"""A second importer, libcosim, gets the same trajectory as fmpy."""

import zipfile
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from mixed_order_game import read_model, run
from mixed_order_game.fmu.build import cached_fmu
from mixed_order_game.fmu.parts import build_ssp

cosim = pytest.importorskip("libcosimpy.CosimExecution", reason="libcosimpy exists for x86_64 only")

STEP, STEPS = 0.02, 250


def test_libcosim_agrees_with_fmpy(fmu: Path) -> None:
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    model = read_model(fmu)
    names = [variable.name for stem in ("x", "v", "u") for variable in model.indexed(stem).values()]
    references = [model.variable(name).reference for name in names]
    execution = CosimExecution.from_step_size(step_size=int(STEP * 1e9))
    slave = execution.add_local_slave(CosimLocalSlave(fmu_path=str(fmu), instance_name="game"))
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    execution.real_initial_value(slave, model.variable("k1").reference, 12.0)
    execution.real_initial_value(slave, model.variable("tolerance_relative").reference, 1e-8)
    assert execution.step(STEPS)
    values = np.array(observer.last_real_values(slave, references))
    stop = STEP * STEPS
    expected = run(fmu, start_values={"k1": 12.0}, stop_time=stop, step=STEP, tolerance=1e-8)
    np.testing.assert_allclose(values, [expected[name][-1] for name in names], rtol=0.0, atol=1e-6)


def test_libcosim_runs_a_system_structure(tmp_path: Path) -> None:
    """What players hear is one step old: the difference from the whole game is proportional to the step."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver

    stop = 1.0
    with zipfile.ZipFile(build_ssp("five_vehicles", tmp_path / "five.ssp")) as archive:
        archive.extractall(tmp_path / "five")
    names = [f"x[{i},1]" for i in range(1, 6)]
    whole = run(cached_fmu("five_vehicles"), stop_time=stop, step=stop, tolerance=1e-8)
    models = [read_model(tmp_path / "five" / "resources" / f"player_{i}.fmu") for i in range(1, 6)]
    differences = []
    for step in (0.02, 0.01, 0.005):
        execution = CosimExecution.from_ssp_file(ssp_path=str(tmp_path / "five"), step_size=int(step * 1e9))
        observer = CosimObserver.create_last_value()
        execution.add_observer(observer)
        assert execution.step(round(stop / step))
        values = [
            observer.last_real_values(
                execution.slave_index_from_instance_name(f"player_{i}"), [model.variable(name).reference]
            )[0]
            for i, (model, name) in enumerate(zip(models, names, strict=True), 1)
        ]
        differences.append(
            max(abs(value - whole[name][-1]) for value, name in zip(values, names, strict=True))
        )
    assert all(fine < 0.65 * coarse for coarse, fine in pairwise(differences)), differences
