"""Games in which events of all kinds meet come through at every tolerance, at a cost near its neighbours'."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from mixed_order_game.fmu.build import build_fmu
from mixed_order_game.fmu.run import Simulator
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
