"""What judges a run, from fine samples: splines through them, their integrals, the roots of their slopes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from .game import FloatArray, Game
from .simulate import _Run

TRANSIENT = 0.1  # s, sampled finely after the start and after each change
FINE, COARSE = 5e-4, 2e-3  # s


@dataclass(frozen=True)
class Judgement:
    """Figures of a run; times in s."""

    settling_time: float
    settled: bool
    control_energy: float
    control_peak: float
    error_peak: float
    overshoot: float


def judge(
    game: Game,
    stop: float,
    *,
    changes: Mapping[float, Mapping[str, ArrayLike]] | None = None,
    band: float = 0.0,
    judge_from: float = 0.0,
) -> Judgement:
    """Figures of a run from 0 to stop. changes: as breakpoints of simulate; the control may jump there.

    band: |x - x*| that counts as settled; 0: 2 % of the initial one. judge_from: in s, begins error_peak.
    """
    run = _Run(game, 1e-9, 1e-10, "DOP853")
    start = run.sample()["x"] - run.x_star
    scale = float(np.abs(start).max())
    limit = band or 0.02 * float(np.linalg.norm(start))
    last_outside = energy = control = error = beyond = inside = 0.0
    joints = sorted(changes or {})
    for begin, end in zip([0.0, *joints], [*joints, stop], strict=True):
        if begin:
            run.change((changes or {})[begin])
        t = np.unique(
            np.r_[
                np.arange(begin, min(end, begin + TRANSIENT), FINE),
                np.arange(begin, end, COARSE),
                judge_from,
                end,
            ]
        )
        t = t[(t >= begin) & (t <= end) & np.r_[True, np.diff(t) > 1e-9]]
        rows = []
        for time in t.tolist():
            if time > run.t:
                run.advance(time)
            rows.append(run.sample())
        u, deviation = (np.array([row[name] for row in rows]) for name in ("u", "x"))
        deviation -= run.x_star
        energy += float(CubicSpline(t, np.square(u).sum(axis=(1, 2))).integrate(t[0], t[-1]))
        control = max(control, _largest(t, np.abs(u)))
        distance = CubicSpline(t, np.square(deviation).sum(axis=(1, 2)) - limit**2)
        inside = float(distance(end))
        crossings = [float(root) for root in distance.roots(extrapolate=False) if distance(root, 1) < 0.0]
        if inside > 0.0:
            last_outside = end
        elif crossings:
            last_outside = max(crossings)
        elif distance(begin) > 0.0:
            last_outside = begin
        late = t >= judge_from
        if late.any():
            error = max(error, _largest(t[late], np.abs(deviation[late])))
        sided = np.where(start == 0.0, np.abs(deviation), -np.sign(start) * deviation)
        beyond = max(beyond, _largest(t, sided))
    return Judgement(last_outside, inside <= 0.0, energy, control, error, beyond / scale)


def _largest(t: FloatArray, values: FloatArray) -> float:
    """Of splines through (T, N, D)."""
    flat = values.reshape(len(t), -1)
    largest = float(flat.max())
    for column in flat.T[flat.max(axis=0) > 0.99 * largest] if len(t) > 1 else []:
        spline = CubicSpline(t, column)
        tops = spline.derivative().roots(extrapolate=False)
        largest = max([largest, *(float(spline(top)) for top in tops)])
    return largest
