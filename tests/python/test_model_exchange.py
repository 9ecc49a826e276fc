"""Model exchange by FMPy: equal to the oracle's references and to co-simulation, with as many events."""

import re
from pathlib import Path

import fmpy
import numpy as np
import pytest
from numpy.typing import NDArray

from mixed_order_game import build_fmu, default_game
from tests.conftest import FmuOf
from tests.oracle.make_reference import CASES, REFERENCE

SIGNAL = re.compile(r"(x|v|z|W_norm2)\[(\d+),(\d+)\]")
GAMES = [
    "five_vehicles",  # 22 events
    "small_weight_bound",
    "interleaved_orders",
    "vector_centers",
    "weighted_graph",
    "robust_unperturbed",
    "five_vehicles_plain",
    "two_scalar_players",
]


def simulate(path: Path, kind: str, stop: float, step: float, **options: object) -> NDArray[np.void]:
    description = fmpy.read_model_description(path, validate=False)
    names = [variable.name for variable in description.modelVariables]
    signals = [name for name in names if SIGNAL.fullmatch(name)]
    result: NDArray[np.void] = fmpy.simulate_fmu(
        path,
        stop_time=stop,
        output_interval=step,
        output=[*signals, "nash_error", "solver_events", "solver_steps"],
        record_events=False,
        fmi_type=kind,
        model_description=description,
        **options,
    )
    return result


def largest_difference(a: NDArray[np.void], b: NDArray[np.void]) -> float:
    """Of all signals, each relative to its largest value, at least 1."""
    np.testing.assert_allclose(a["time"], b["time"], atol=1e-9)
    names = [name for name in a.dtype.names or () if "[" in name or name == "nash_error"]
    return max(float(np.abs(a[name] - b[name]).max() / max(1.0, np.abs(b[name]).max())) for name in names)


@pytest.mark.parametrize("name", GAMES)
def test_cvode_matches_the_reference(name: str, fmu_of: FmuOf) -> None:
    case = CASES[name]
    path = fmu_of(Path(case.game).stem)
    with np.load(REFERENCE / f"{name}.npz") as file:
        reference = dict(file)
    result = simulate(
        path, "ModelExchange", case.stop, case.stop / case.intervals, solver="CVode", relative_tolerance=1e-9
    )
    np.testing.assert_allclose(result["time"], reference["t"], atol=1e-9)
    for column in result.dtype.names or ():
        match = SIGNAL.fullmatch(column)
        if match is None:
            continue
        signal, i, coordinate = match[1], int(match[2]) - 1, int(match[3]) - 1
        expected = reference[signal][:, i, coordinate]
        error = np.abs(result[column] - expected).max() / max(1.0, np.abs(reference[signal]).max())
        assert error < 2e-5, f"{column}: {error:.2e}"
    assert result["solver_events"][-1] == reference["switch_count"]
    assert np.all(result["solver_steps"] == 0), "the steps are the importer's"


@pytest.mark.parametrize("name", ["five_vehicles", "interleaved_orders"])
def test_the_error_falls_with_the_tolerance(name: str, fmu_of: FmuOf) -> None:
    path, stop = fmu_of(name), 4.0
    exact = simulate(path, "CoSimulation", stop, 0.02, start_values={"tolerance_relative": 1e-10})
    errors = [
        largest_difference(
            simulate(path, "ModelExchange", stop, 0.02, solver="CVode", relative_tolerance=tolerance), exact
        )
        for tolerance in (1e-4, 1e-6, 1e-8)
    ]
    assert errors[0] < 0.2
    assert errors[1] < errors[0] / 3.0
    assert errors[2] < 1e-4


@pytest.mark.parametrize("name", ["five_vehicles", "small_weight_bound"])
def test_explicit_euler_is_of_first_order(name: str, fmu_of: FmuOf) -> None:
    path, stop = fmu_of(name), 0.5
    errors = []
    for step in (2e-4, 1e-4):
        exact = simulate(path, "CoSimulation", stop, step, start_values={"tolerance_relative": 1e-9})
        euler = simulate(path, "ModelExchange", stop, step, solver="Euler", step_size=step)
        errors.append(largest_difference(euler, exact))
        assert euler["solver_events"][-1] == exact["solver_events"][-1]
    assert errors[1] < 3e-2
    assert errors[1] == pytest.approx(errors[0] / 2.0, rel=0.1)


def test_inputs_act(fmu: Path) -> None:
    gust = np.array(
        [(0.0, 0.0), (1.0, 0.0), (1.0, 20.0), (1.5, 20.0), (1.5, 0.0)],
        dtype=[("time", float), ("d_ext[1,1]", float)],
    )
    exchanged = simulate(fmu, "ModelExchange", 3.0, 0.02, input=gust, relative_tolerance=1e-9)
    stepped = simulate(fmu, "CoSimulation", 3.0, 0.02, input=gust, start_values={"tolerance_relative": 1e-9})
    still = simulate(fmu, "ModelExchange", 3.0, 0.02, relative_tolerance=1e-9)
    assert largest_difference(exchanged, still) > 0.01
    assert largest_difference(exchanged, stepped) < 2e-5


def test_a_grazing_column_does_not_chatter(fmu_of: FmuOf) -> None:
    path = fmu_of("two_scalar_players")
    options = {"solver": "CVode", "relative_tolerance": 1e-6}
    free = simulate(path, "ModelExchange", 10.0, 0.005, start_values={"W_max": 1e9}, **options)
    columns = [name for name in free.dtype.names or () if name.startswith("W_norm2")]
    column = max(columns, key=lambda name: free[name].max())
    values = free[column]
    peaks = values[1:-1][(values[1:-1] > values[:-2]) & (values[1:-1] >= values[2:])]
    assert len(peaks) > 0
    for below in (1e-3, 1e-6, 1e-9):
        bound = float(peaks.max()) * (1.0 - below)
        result = simulate(path, "ModelExchange", 10.0, 0.005, start_values={"W_max": bound}, **options)
        assert result["solver_events"][-1] <= 8 * len(peaks)
        assert max(result[name].max() for name in columns) < bound * (1.0 + 1e-4)


def test_outputs_only_is_for_co_simulation(tmp_path: Path) -> None:
    game = tmp_path / "game.toml"
    text = default_game().read_text(encoding="utf-8")
    game.write_text(text.replace('expose = "all"', 'expose = "outputs"'), encoding="utf-8")
    description = fmpy.read_model_description(build_fmu(game, tmp_path / "game.fmu"))
    assert description.modelExchange is None
    assert description.numberOfEventIndicators == 0
    assert description.coSimulation is not None


def test_the_description_offers_both(fmu: Path) -> None:
    description = fmpy.read_model_description(fmu)
    assert description.modelExchange is not None
    assert description.modelExchange.needsCompletedIntegratorStep
    assert description.numberOfEventIndicators == 10
    assert description.numberOfContinuousStates == 180
    states = [unknown.variable.derivative for unknown in description.derivatives]
    assert [state.name for state in states[:2]] == ["x[1,1]", "x[2,1]"]
    assert all(float(state.nominal) > 0.0 for state in states)
