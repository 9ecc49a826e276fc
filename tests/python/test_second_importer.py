"""A second importer, libcosim, gets the same trajectory as fmpy."""

from pathlib import Path

import numpy as np
import pytest

from mixed_order_game import read_model, run

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
