"""Games in which events of all kinds meet come through at every tolerance, at a cost near its neighbours'."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from mixed_order_game.fmu.build import build_fmu
from mixed_order_game.fmu.run import Simulator
from mixed_order_game.studies.sensitivities import sensitivities
from tests.games_with_events import game_with_events

TOLERANCES = (1e-3, 1e-4, 2e-5, 1e-6, 1e-7, 1e-8, 1e-10)


@pytest.mark.parametrize("seed", [17, 18, 39])
def test_every_tolerance_serves(seed: int, tmp_path: Path) -> None:
    (tmp_path / "game.toml").write_text(game_with_events(seed))
    fmu = build_fmu(tmp_path / "game.toml", tmp_path / "game.fmu")
    outputs = ["x", "solver_steps", "solver_events"]
    with Simulator(fmu) as simulator:
        runs = [simulator.run(stop_time=6.0, step=6.0, tolerance=tol, outputs=outputs) for tol in TOLERANCES]
    steps = [run["solver_steps"][-1] for run in runs]
    assert all(fine < 6.0 * coarse for coarse, fine in pairwise(steps))
    assert len({run["solver_events"][-1] for run in runs}) == 1
    for run, tolerance in zip(runs[:-1], TOLERANCES, strict=False):
        assert np.max(np.abs(run.x[-1] - runs[-1].x[-1])) < 2e3 * tolerance


def test_sensitivities_are_differences_of_runs(tmp_path: Path) -> None:
    """Where a step with an event ends as a wave jumps, so that the integrator stops there twice."""
    (tmp_path / "game.toml").write_text(game_with_events(13))
    fmu = build_fmu(tmp_path / "game.toml", tmp_path / "game.fmu")
    with Simulator(fmu) as simulator:
        k3 = float(simulator.model.variable("k3").start or 0.0)
        low, high = (
            simulator.run(start_values={"k3": part * k3}, stop_time=6.0, step=1.0, tolerance=1e-12)
            for part in (1.0 - 1e-4, 1.0 + 1e-4)
        )
    expected = (high.x - low.x) / (2e-4 * k3)
    for tolerance, part in ((1e-6, 0.2), (1e-9, 0.01)):
        found = sensitivities(fmu, ["k3"], stop_time=6.0, step=1.0, tolerance=tolerance)["k3"]
        assert np.max(np.abs(found - expected)) < part * np.max(np.abs(expected))
