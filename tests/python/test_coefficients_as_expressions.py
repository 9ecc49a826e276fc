"""The paper's game of coefficients written wholly as expressions moves as before.

Summed in the order of the coefficients, a cost gives the same bits. In another order rounding chooses other
steps, and the two runs differ by what the integrator's error is.
"""

from pathlib import Path

import numpy as np
import pytest

import mixed_order_game as mog
from mixed_order_game.fmu.build import build_fmu
from tests.bench.expression_games import PAPER_GAME, five_vehicles

OTHER_ORDER = (
    "sum(i * (x[i,k]^2 + x[i,k]) for k in 1..D) + i"
    " + sum(C[i,j] * sum((x[i,k] - x[j,k])^2 for k in 1..D) for j in 1..N)"
)
TOLERANCES = (1e-8, 1e-10, 1e-12)


def trajectories(fmu: Path, tolerance: float) -> np.ndarray:
    """x, z and v over 20 s."""
    run = mog.run(fmu, step=0.1, tolerance=tolerance, outputs=["x", "z", "v"])
    return np.array([run.columns[name] for name in run.columns if name[0] in "xzv"])


@pytest.fixture(scope="module")
def coefficients(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_fmu(PAPER_GAME, tmp_path_factory.mktemp("paper") / "game.fmu")


def expressions(text: str, folder: Path) -> Path:
    game = folder / "game.toml"
    game.write_text(text, encoding="utf-8")
    return build_fmu(game, folder / "game.fmu")


def test_in_the_same_order_they_move_bit_for_bit(coefficients: Path, tmp_path: Path) -> None:
    fmu = expressions(five_vehicles(), tmp_path)
    assert np.array_equal(trajectories(fmu, 1e-10), trajectories(coefficients, 1e-10))


def test_in_another_order_the_difference_falls_with_the_tolerance(coefficients: Path, tmp_path: Path) -> None:
    fmu = expressions(five_vehicles(OTHER_ORDER), tmp_path)
    loose, middle, tight = (
        np.abs(trajectories(fmu, tolerance) - trajectories(coefficients, tolerance)).max()
        for tolerance in TOLERANCES
    )
    assert 5.0 * tight < middle < 0.2 * loose < 1e-6
    assert tight < 1e-8
