"""Writes the reference trajectories of tests/reference: `python -m tests.oracle.make_reference [case ...]`.

Each case is integrated by DOP853 at rtol 1e-13, atol 1e-14 and stored as tests/reference/<case>.npz. A second
run at ten times larger tolerances, and for small cases one by Radau at rtol 1e-9, give the error estimates
printed: largest difference of a signal over its largest value (over 1 if that is smaller), switch times
included. A case whose estimate exceeds 1e-8 is refused. All cases take about three minutes.

Arrays of a file, for N players, D coordinates, T samples: t (T,) in s; x, v, z, u, W_norm2 (T, N, D), v zero
for order 1 and z zero for order 2; nash_error (T,), to the equilibrium of the costs in force; x_star (N, D),
of the game file's costs; y_final (N, N, D); switch_count (); switch_time, switch_player, switch_coordinate
(1-based), switch_entered (K,); error_estimate (). Cases with changes add breakpoint_time (B,) and one array
(B, ...) per changed name with its value from that time on; a sample at a breakpoint is taken before the
change, and d_ext is 0 until its first one.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .equilibrium import nash_equilibrium
from .game import FloatArray, Game, read_game
from .simulate import Breakpoint, Trajectory, simulate

ROOT = Path(__file__).resolve().parents[2]
REFERENCE = ROOT / "tests" / "reference"
COMPARED = ("x", "v", "z", "u", "W_norm2", "nash_error", "y")
LARGEST_ERROR = 1e-8


@dataclass(frozen=True)
class Case:
    """One reference trajectory: a game, its sample times and what changes on the way."""

    game: str  # file below the repository's root
    stop: float  # s
    intervals: int
    with_radau: bool = False
    changes: tuple[Breakpoint, ...] = ()

    @property
    def path(self) -> Path:
        """The game file."""
        return ROOT / self.game

    @property
    def times(self) -> FloatArray:
        """(T,), s."""
        return np.linspace(0.0, self.stop, self.intervals + 1)


def _reference_game(name: str) -> str:
    return f"tests/reference/games/{name}.toml"


def _step_inputs() -> tuple[Breakpoint, ...]:
    """Piecewise-constant d_ext and tunable parameters of the interleaved game (N = 6, D = 2)."""
    player, coordinate = np.meshgrid(np.arange(1.0, 7.0), np.arange(1.0, 3.0), indexing="ij")
    reweighted = np.zeros((6, 6))
    for i, j, weight in ((1, 2, 1.5), (2, 3, 0.8), (3, 4, 1.2), (4, 5, 0.7), (5, 6, 1.1), (1, 4, 0.9)):
        reweighted[i - 1, j - 1] = reweighted[j - 1, i - 1] = weight
    return (
        (0.0, {"d_ext": 0.5 * player - coordinate}),
        (0.75, {"d_ext": 1.5 * np.cos(player + 2.0 * coordinate), "k1": 9.0}),
        (1.5, {"dynamics_gain": np.linspace(0.5, 1.5, 6), "adjacency": reweighted}),
        (2.25, {"d_ext": 0.0, "k2": 1.1, "k4": 33.0, "disturbance_bias": 0.2 * player - 0.3 * coordinate}),
        (3.0, {"cost_linear": 0.3 * player * coordinate - 1.0, "beta": 30.0}),
    )


CASES = {
    "five_vehicles": Case("modelDescription/games/five_vehicles.toml", 20.0, 200),
    "five_vehicles_plain": Case(_reference_game("five_vehicles_plain"), 5.0, 100, True),
    "five_vehicles_plain_perturbed": Case(_reference_game("five_vehicles_plain_perturbed"), 10.0, 100),
    "four_first_order": Case(_reference_game("four_first_order"), 8.0, 100, True),
    "three_second_order": Case(_reference_game("three_second_order"), 8.0, 100, True),
    "interleaved_orders": Case(_reference_game("interleaved_orders"), 6.0, 100),
    "interleaved_orders_changes": Case(
        _reference_game("interleaved_orders"), 4.5, 90, changes=_step_inputs()
    ),
    "weighted_graph": Case(_reference_game("weighted_graph"), 8.0, 100, True),
    "small_weight_bound": Case(_reference_game("small_weight_bound"), 10.0, 150),
    "two_scalar_players": Case(_reference_game("two_scalar_players"), 10.0, 100, True),
    "eight_players_in_space": Case(_reference_game("eight_players_in_space"), 5.0, 80),
    "twelve_scalar_players": Case(_reference_game("twelve_scalar_players"), 8.0, 80),
    "vector_centers": Case(_reference_game("vector_centers"), 8.0, 100, True),
    "robust_unperturbed": Case(_reference_game("robust_unperturbed"), 5.0, 100, True),
}

TIGHT_SPHERE = Case(_reference_game("tight_sphere"), 2.3, 23)


def write_tight_sphere() -> None:
    """Write tests/reference/tight_sphere.npz by Radau alone.

    Its arrays are t (T,) in s, x (T, N, D), W (T, N, q, D), switch_count ().

    A robust term that acts within 4e-9 of e = 0 is too stiff for DOP853, and u is noise at any tolerance.
    """
    case = TIGHT_SPHERE
    game = read_game(case.path)
    best = simulate(game, case.times, rtol=1e-10, atol=1e-12, method="Radau")
    looser = simulate(game, case.times, rtol=1e-8, atol=1e-10, method="Radau")
    estimate = max(float(np.max(np.abs(getattr(best, k) - getattr(looser, k)))) for k in ("x", "W"))
    if best.switch_count != looser.switch_count or not estimate <= LARGEST_ERROR:
        raise SystemExit(f"tight_sphere: two integrations differ by {estimate:.1e}")
    arrays: dict[str, Any] = {
        "t": best.t,
        "x": best.x,
        "W": best.W,
        "switch_count": np.array(best.switch_count, dtype=np.int32),
    }
    arrays["error_estimate"] = np.array(estimate)
    np.savez_compressed(REFERENCE / "tight_sphere.npz", allow_pickle=False, **arrays)
    print(f"tight_sphere: {best.switch_count} switches, hundredfold tolerance {estimate:.1e}", flush=True)


def main(names: list[str]) -> None:
    """Write the named cases, or all of them."""
    if not names or "tight_sphere" in names:
        write_tight_sphere()
    for name in [name for name in names if name != "tight_sphere"] or (CASES if not names else []):
        begun = time.perf_counter()
        case = CASES[name]
        game = read_game(case.path)
        best = simulate(game, case.times, rtol=1e-13, atol=1e-14, breakpoints=case.changes)
        looser = simulate(game, case.times, rtol=1e-12, atol=1e-13, breakpoints=case.changes)
        estimate = difference(best, looser)
        report = f"{name}: N {game.players}, D {game.dimension}, q {game.neurons}, first-order "
        report += f"{game.first_order.sum()}, {best.switch_count} switches, tenfold tolerance {estimate:.1e}"
        if case.with_radau:
            other = simulate(
                game, case.times, rtol=1e-9, atol=1e-11, method="Radau", breakpoints=case.changes
            )
            report += f", Radau {difference(best, other):.1e}"
            estimate = max(estimate, difference(best, other))
        if not estimate <= LARGEST_ERROR:
            raise SystemExit(f"{report}: two integrations differ by more than {LARGEST_ERROR}")
        save(REFERENCE / f"{name}.npz", game, best, case.changes, estimate)
        print(f"{report}, {time.perf_counter() - begun:.0f} s", flush=True)


def difference(one: Trajectory, other: Trajectory) -> float:
    """Largest difference of a compared signal or of the switch times, over its largest value or 1.

    Infinite if the two runs do not switch the same columns in the same order.
    """
    orders = [[(s.player, s.coordinate, s.entered) for s in run.switches] for run in (one, other)]
    if orders[0] != orders[1]:
        return float("inf")
    pairs = [(getattr(one, name), getattr(other, name)) for name in COMPARED]
    pairs += [(one.switch_times, other.switch_times)] if one.switches else []
    return max(float(np.max(np.abs(a - b)) / max(1.0, np.max(np.abs(a)))) for a, b in pairs)


def save(
    path: Path, game: Game, run: Trajectory, changes: tuple[Breakpoint, ...], error_estimate: float
) -> None:
    """Write one reference file; numpy dates every member 1980, so equal values give equal bytes."""
    arrays: dict[str, NDArray[np.generic]] = {
        name: getattr(run, name) for name in ("t", "x", "v", "z", "u", "W_norm2", "nash_error")
    }
    arrays["x_star"] = nash_equilibrium(game)
    arrays["y_final"] = run.y[-1]
    arrays["switch_count"] = np.array(run.switch_count, dtype=np.int32)
    arrays["switch_time"] = run.switch_times
    arrays["switch_player"] = np.array([s.player + 1 for s in run.switches], dtype=np.int32)
    arrays["switch_coordinate"] = np.array([s.coordinate + 1 for s in run.switches], dtype=np.int32)
    arrays["switch_entered"] = np.array([s.entered for s in run.switches], dtype=np.bool_)
    arrays["error_estimate"] = np.array(error_estimate)
    if changes:
        arrays |= _changed_values(game, changes)
    np.savez_compressed(path, allow_pickle=False, **arrays)


def _changed_values(game: Game, changes: tuple[Breakpoint, ...]) -> dict[str, NDArray[np.generic]]:
    """Every changed name's value from each breakpoint on, filled in where a breakpoint leaves it alone."""
    arrays: dict[str, NDArray[np.generic]] = {"breakpoint_time": np.array([when for when, _ in changes])}
    for name in sorted({name for _, change in changes for name in change}):
        value = np.zeros_like(game.x0) if name == "d_ext" else np.asarray(getattr(game, name))
        stacked = []
        for _, change in changes:
            value = np.broadcast_to(np.asarray(change.get(name, value), dtype=np.float64), value.shape)
            stacked.append(value)
        arrays[name] = np.array(stacked)
    return arrays


if __name__ == "__main__":
    main(sys.argv[1:])
