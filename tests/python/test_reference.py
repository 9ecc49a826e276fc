"""Trajectories of FMUs against the oracle's references, which share no code with the core."""

from pathlib import Path

import numpy as np
import pytest

from mixed_order_game import run
from tests.conftest import FmuOf
from tests.oracle.make_reference import CASES, REFERENCE, TIGHT_SPHERE

TOLERANCE = 1e-8
EVERYWHERE, SETTLED, SETTLED_AFTER = 2e-5, 2e-6, 3.0  # of a signal's largest value, at least of 1
SIGNALS = ("x", "v", "z", "u", "W_norm2")
SCALARS = {"k1", "k2", "k3", "k4", "beta", "delta", "epsilon"}
MATRICES = {"cost_linear", "disturbance_amplitude", "disturbance_frequency", "disturbance_phase", "d_ext"}


def variables_of(name: str, value: np.ndarray) -> dict[str, float]:
    """A changed array of the reference as FMU variables."""
    if name in SCALARS:
        return {name: float(value)}
    if name == "adjacency":
        return {
            f"a[{i + 1},{j + 1}]": value[i, j] for i in range(len(value)) for j in range(i + 1, len(value))
        }
    return {
        f"{name}[{','.join(str(k + 1) for k in index)}]": float(entry)
        for index, entry in np.ndenumerate(value)
    }


@pytest.mark.parametrize("name", list(CASES))
def test_matches_the_reference(name: str, fmu_of: FmuOf) -> None:
    case = CASES[name]
    with np.load(REFERENCE / f"{name}.npz") as file:
        reference = dict(file)
    changes: dict[float, dict[str, float]] = {}
    if "breakpoint_time" in reference:
        changed = {key for _, values in case.changes for key in values}
        for k, when in enumerate(reference["breakpoint_time"]):
            changes[float(when)] = {
                variable: value
                for key in sorted(changed)
                for variable, value in variables_of(key, reference[key][k]).items()
            }
    result = run(
        fmu_of(Path(case.game).stem),
        stop_time=case.stop,
        step=case.stop / case.intervals,
        tolerance=TOLERANCE,
        outputs=["x", "u", "W_norm2", "nash_error", "y", "solver_events", *_states(reference)],
        changes=changes,
    )
    np.testing.assert_allclose(result.time, reference["t"], atol=1e-12)
    np.testing.assert_allclose(result["x_star[1,1]"][0], reference["x_star"][0, 0], atol=1e-10)
    late = result.time >= SETTLED_AFTER
    for signal in SIGNALS:
        expected = reference[signal]
        actual = np.nan_to_num(getattr(result, signal)) if _has(result.columns, signal) else 0.0 * expected
        error = np.abs(actual - expected) / max(1.0, np.abs(expected).max())
        assert error.max() < EVERYWHERE, f"{signal}: {error.max():.2e}"
        assert error[late].max(initial=0.0) < SETTLED, f"{signal} late: {error[late].max():.2e}"
    np.testing.assert_allclose(result.nash_error, reference["nash_error"], rtol=0.0, atol=20.0 * EVERYWHERE)
    if not changes:
        assert result["solver_events"][-1] == reference["switch_count"]
    np.testing.assert_allclose(result.y[-1], reference["y_final"], rtol=0.0, atol=SETTLED)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-4, 1e-5, 1e-6, 1e-8])
def test_matches_the_weights_on_a_tight_sphere(tolerance: float, fmu_of: FmuOf) -> None:
    """beta = 8e5 and a layer of 4e-9: where columns slide and leave, the sign of e is below the tolerance."""
    case = TIGHT_SPHERE
    with np.load(REFERENCE / "tight_sphere.npz") as file:
        reference = dict(file)
    result = run(
        fmu_of(Path(case.game).stem),
        stop_time=case.stop,
        step=case.stop / case.intervals,
        tolerance=tolerance,
        outputs=["x", "W", "solver_events"],
    )
    np.testing.assert_allclose(result.x, reference["x"], rtol=0.0, atol=2.0 * tolerance)
    largest = np.abs(reference["W"]).max()
    np.testing.assert_allclose(result.W, reference["W"], rtol=0.0, atol=2.0 * tolerance * largest)
    assert result["solver_events"][-1] <= 2 * reference["switch_count"]


def _states(reference: dict[str, np.ndarray]) -> list[str]:
    return [name for name in ("v", "z") if np.any(reference[name])]


def _has(columns: object, signal: str) -> bool:
    return any(name.startswith(f"{signal}[") for name in columns)  # type: ignore[attr-defined]
