"""Integration of the closed loop as a hybrid system: projection modes per weight column, located switches.

A column is inside (w' = beta S e) or on the sphere (radial part removed). It enters when w'w - W_max and
e w'S are both >= 0 and leaves when e w'S < 0. Each switch is located by root finding on re-integrated states,
and the integration restarts there with on-sphere columns scaled to w'w = W_max. Steps also end at every
sample, so no sampled value is interpolated.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import DOP853, Radau
from scipy.optimize import brentq

from .closed_loop import initial_state, signals, state_jacobian, state_rate, unpack
from .equilibrium import nash_equilibrium
from .game import GAIN_NAMES, FloatArray, Game

Modes: TypeAlias = NDArray[np.bool_]  # (N, D), true on the sphere
Breakpoint: TypeAlias = tuple[float, Mapping[str, ArrayLike]]

TUNABLE = (
    {*GAIN_NAMES, "u_max", "adjacency", "dynamics_gain", "cost_quadratic", "cost_linear", "cost_coupling"}
    | {"disturbance_amplitude", "disturbance_frequency", "disturbance_phase", "disturbance_bias"}
)  # fmt: skip
LARGEST_SWITCHES = 10_000
NEAR_SPHERE = 0.8  # part of W_max from which the inside of a step is searched for switches too


@dataclass(frozen=True)
class Switch:
    """One weight column changing its law. player and coordinate are 0-based, time in s."""

    time: float
    player: int
    coordinate: int
    entered: bool  # true: inside -> on the sphere


@dataclass(frozen=True)
class Trajectory:
    """Samples of a run; T samples, shapes as in Game."""

    t: FloatArray  # (T,)
    x: FloatArray  # (T, N, D)
    v: FloatArray  # (T, N, D), zero for order 1
    z: FloatArray  # (T, N, D), zero for order 2
    y: FloatArray  # (T, N, N, D)
    W: FloatArray  # (T, N, q, D)
    u: FloatArray  # (T, N, D)
    phi: FloatArray  # (T, N, D)
    nn: FloatArray  # (T, N, D), W^T S
    W_norm2: FloatArray  # (T, N, D), w'w per column
    nash_error: FloatArray  # (T,), 2-norm of x - x*
    switches: tuple[Switch, ...]
    rate_evaluations: int
    bound_passages: int  # how often a control came to its bound u_max or left it

    @property
    def switch_count(self) -> int:
        """Number of mode changes, both directions."""
        return len(self.switches)

    @property
    def switch_times(self) -> FloatArray:
        """(switch_count,), s."""
        return np.array([switch.time for switch in self.switches])


def simulate(
    game: Game,
    times: ArrayLike,
    *,
    rtol: float = 1e-11,
    atol: float = 1e-12,
    method: str = "DOP853",
    breakpoints: Sequence[Breakpoint] = (),
) -> Trajectory:
    """Integrate from the game's initial state at t = 0 and sample at times (T,) in s, increasing, from 0 on.

    method is "DOP853" or "Radau" (with the complex-step Jacobian). breakpoints are (time, changes): changes
    map "d_ext" (N, D) or a name in TUNABLE to its value from that time on (numbers are broadcast). A sample
    at a breakpoint is taken before the change, as at the end of a communication step.
    Raises ValueError for arguments it cannot take, ArithmeticError if the integrator gives up.
    """
    samples = np.asarray(times, dtype=np.float64)
    if samples.ndim != 1 or samples.size == 0 or samples[0] < 0.0 or np.any(np.diff(samples) <= 0.0):
        raise ValueError("times must be increasing and not negative")
    changes_at: dict[float, list[Mapping[str, ArrayLike]]] = {}
    for when, changes in breakpoints:
        unknown = set(changes) - TUNABLE - {"d_ext"}
        if unknown:
            raise ValueError(f"breakpoint at {when} s changes unknown {', '.join(sorted(unknown))}")
        changes_at.setdefault(float(when), []).append(changes)
    if changes_at and min(changes_at) < 0.0:
        raise ValueError("breakpoints must not be negative")

    run = _Run(game, rtol, atol, method)
    sample_times = set(samples.tolist())
    rows: list[dict[str, Any]] = []
    for stop in sorted(sample_times | {when for when in changes_at if when < samples[-1]}):
        run.advance(stop)
        if stop in sample_times:
            rows.append(run.sample())
        for changes in changes_at.get(stop, ()):
            run.change(changes)
    columns: dict[str, Any] = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    return Trajectory(
        t=samples,
        **columns,
        switches=tuple(run.switches),
        rate_evaluations=run.rate_evaluations,
        bound_passages=run.bound_passages,
    )


class _Run:
    """State of one integration: time, state vector, modes and the values that breakpoints change."""

    def __init__(self, game: Game, rtol: float, atol: float, method: str) -> None:
        if method not in ("DOP853", "Radau"):
            raise ValueError(f"method must be DOP853 or Radau, not {method!r}")
        self.game = game
        self.rtol, self.atol, self.method = rtol, atol, method
        self.t = 0.0
        self.state = initial_state(game)
        self.on_sphere: Modes = np.zeros((game.players, game.dimension), dtype=np.bool_)
        self.d_ext = np.zeros((game.players, game.dimension))
        self.x_star = nash_equilibrium(game)
        self.step: float | None = None
        self.switches: list[Switch] = []
        self.rate_evaluations = 0
        self.bound_passages = 0
        self.at_bound = self._at_bound(self.state)

    def _at_bound(self, state: FloatArray) -> FloatArray:
        """(N, D): -1 or 1 where the control is at its bound, else 0."""
        wanted = signals(self.game, state).wanted
        return np.where(np.abs(wanted) > self.game.u_max, np.sign(wanted), 0.0)

    def _watch_bounds(self, start: float, interpolant: Callable[[float], FloatArray]) -> None:
        """Count what happens from start to now, at sixteen times; the step error control meets the bends."""
        if not np.isfinite(self.game.u_max).any():
            return
        for time in np.linspace(start, self.t, 17)[1:]:
            self._pass_bounds(interpolant(time))

    def _pass_bounds(self, state: FloatArray) -> None:
        at_bound = self._at_bound(state)
        self.bound_passages += int(np.abs(at_bound - self.at_bound).sum())
        self.at_bound = at_bound

    def change(self, changes: Mapping[str, ArrayLike]) -> None:
        """Apply one breakpoint and give columns that the change pushes off the sphere their inside law."""
        for name, value in changes.items():
            if name == "d_ext":
                self.d_ext = np.broadcast_to(np.asarray(value, dtype=np.float64), self.d_ext.shape).copy()
            else:
                old = getattr(self.game, name)
                new = np.broadcast_to(np.asarray(value, dtype=np.float64), np.shape(old))
                tuned: dict[str, Any] = {name: float(new) if isinstance(old, float) else new.copy()}
                self.game = replace(self.game, **tuned)
        self.x_star = nash_equilibrium(self.game)
        self._pass_bounds(self.state)
        self._switch_where(self._violation(self.state) > 0.0)

    def sample(self) -> dict[str, Any]:
        """Values of every sampled signal now."""
        game, s = self.game, unpack(self.game, self.state.copy())
        now = signals(game, self.state)
        first = game.first_order[:, np.newaxis]
        return {
            "x": s.x,
            "v": np.where(first, 0.0, s.p),
            "z": np.where(first, s.p, 0.0),
            "y": s.y,
            "W": s.W,
            "u": now.u,
            "phi": now.phi,
            "nn": now.nn,
            "W_norm2": np.sum(s.W * s.W, axis=1),
            "nash_error": float(np.linalg.norm(s.x - self.x_star)),
        }

    def advance(self, stop: float) -> None:
        """Integrate to stop exactly, through every switch on the way."""
        while self.t < stop:
            self._scale_to_sphere()
            solver = self._solver(self.t, self.state, stop, self.step)
            while solver.status == "running":
                before = self.step if self.step is not None else 0.0
                message = solver.step()
                if solver.status == "failed":
                    raise ArithmeticError(f"integration failed at t = {solver.t} s: {message}")
                self.step = max(before, solver.h_abs) if solver.status == "finished" else solver.h_abs
                found = self._first_switch(solver)
                if found is not None:
                    self.t, self.state, changing = found
                    self._watch_bounds(solver.t_old, solver.dense_output())
                    self._switch_where(changing)
                    break
                self.t, self.state = solver.t, solver.y
                self._watch_bounds(solver.t_old, solver.dense_output())
        self._scale_to_sphere()

    def _solver(self, t: float, state: FloatArray, stop: float, step: float | None) -> Any:
        on_sphere, d_ext, game = self.on_sphere.copy(), self.d_ext, self.game

        def rate(time: float, y: FloatArray) -> FloatArray:
            self.rate_evaluations += 1
            return np.asarray(state_rate(game, time, y, on_sphere, d_ext))

        options: dict[str, Any] = {"rtol": self.rtol, "atol": self.atol}
        if step is not None:
            options["first_step"] = min(step, stop - t)
        if self.method == "Radau":
            return Radau(
                rate,
                t,
                state,
                stop,
                jac=lambda time, y: state_jacobian(game, time, y, on_sphere, d_ext),
                **options,
            )
        return DOP853(rate, t, state, stop, **options)

    def _violation(self, state: FloatArray) -> FloatArray:
        """(N, D), continuous in the state and positive where a column must change its law.

        Inside: both w'w - W_max and e w'S positive. On the sphere: e w'S negative.
        """
        W = unpack(self.game, state).W
        now = signals(self.game, state)
        radial = now.e * now.nn
        excess = np.sum(W * W, axis=1) - self.game.W_max
        return np.where(self.on_sphere, -radial, np.minimum(excess, radial))

    def _first_switch(self, solver: Any) -> tuple[float, FloatArray, Modes] | None:
        """Time, state and changing columns of the first switch within the solver's last step, or None."""
        norm2 = np.sum(unpack(self.game, solver.y).W ** 2, axis=1)
        if not self.on_sphere.any() and np.all(norm2 < NEAR_SPHERE * self.game.W_max):
            return None
        start: float = solver.t_old
        start_state = self.state
        length = solver.t - start
        interpolant = solver.dense_output()
        before = start
        for part in (0.25, 0.5, 0.75, 1.0):
            after = start + part * length
            violation = self._violation(solver.y if part == 1.0 else interpolant(after))
            columns = np.argwhere(violation > 0.0)
            if len(columns):
                break
            before = after
        else:
            return None

        def state_at(time: float) -> FloatArray:
            if time == start:
                return start_state
            inner = self._solver(start, start_state, time, time - start)
            while inner.status == "running":
                inner.step()
            if inner.status == "failed":
                raise ArithmeticError(f"integration failed at t = {inner.t} s while locating a switch")
            return np.asarray(inner.y)

        def crossing(i: int, coordinate: int) -> float:
            return _crossing(lambda time: self._violation(state_at(time))[i, coordinate], before, after)

        first = min(crossing(i, coordinate) for i, coordinate in columns)
        state = state_at(first)
        changing = self._violation(state) > 0.0
        if not changing.any():  # the root finder stopped just before the crossing
            nearest = np.unravel_index(
                np.argmax(np.where(violation > 0.0, self._violation(state), -np.inf)), changing.shape
            )
            changing[nearest] = True
        return first, state, changing

    def _switch_where(self, changing: Modes) -> None:
        for i, coordinate in np.argwhere(changing).tolist():
            enters = not self.on_sphere[i, coordinate]
            self.on_sphere[i, coordinate] = enters
            self.switches.append(Switch(self.t, i, coordinate, enters))
        if len(self.switches) > LARGEST_SWITCHES:
            raise ArithmeticError(f"more than {LARGEST_SWITCHES} projection switches by t = {self.t} s")

    def _scale_to_sphere(self) -> None:
        """Scale on-sphere columns to w'w = W_max, the invariant of their law."""
        if not self.on_sphere.any():
            return
        self.state = self.state.copy()
        W = unpack(self.game, self.state).W
        scale = np.ones(self.on_sphere.shape)
        W_max = np.broadcast_to(self.game.W_max, self.on_sphere.shape)
        scale[self.on_sphere] = np.sqrt(W_max[self.on_sphere] / np.sum(W * W, axis=1)[self.on_sphere])
        W *= scale[:, np.newaxis, :]


def _crossing(violation: Callable[[float], float], before: float, after: float) -> float:
    """Time between two at which a column's violation turns positive; an end if there is no sign change."""
    if violation(before) >= 0.0:
        return before
    if violation(after) <= 0.0:
        return after
    return float(brentq(violation, before, after, xtol=1e-14, rtol=1e-14))
