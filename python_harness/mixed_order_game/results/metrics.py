"""What people compare between runs: settling time, overshoot, control energy, final error, events.

Pure functions of sampled signals; Result.metrics gathers them for a run.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import ResultError
from ..times import in_seconds, time_slack

FloatArray = NDArray[np.float64]

SETTLED = 0.02
"""Default band of the settling time, as a part of the largest initial |x - x*|."""

FINAL_PART = 0.8
"""Part of the run after which the final error is judged, when no time is given."""

START_STEPS = 10
FINER = 20
"""The first START_STEPS steps are sampled FINER times as often: the control begins with a fast transient."""


@dataclass(frozen=True)
class Metrics:
    """Figures of one run. NaN: not recorded, or for settling_time that the run does not settle."""

    settling_time: float  # s since the beginning, until the largest |x - x*| stays within the band
    overshoot: float  # farthest beyond x*, as a part of the largest initial |x - x*|
    control_energy: float  # integral of |u|^2 over the run
    control_peak: float  # largest |u_il|
    final_error: float  # largest |x - x*| from the settle time on
    events: float  # weight columns that entered or left the sphere, and conditions that changed
    band: float  # band of the settling time, in the unit of x

    def as_json(self) -> dict[str, float | None]:
        """Plain values for json.dumps; None for what is not finite."""
        return {name: value if np.isfinite(value) else None for name, value in asdict(self).items()}


METRIC_UNITS: Mapping[str, str] = {
    "settling_time": "s",
    "overshoot": "",
    "control_energy": "",
    "control_peak": "",
    "final_error": "",
    "events": "",
}
"""The figures that tables show, in their order, with their units; those of x and u are the game's own."""


def sampled_metrics(
    time: FloatArray,
    deviation: FloatArray,
    u: FloatArray | None,
    *,
    events: float = float("nan"),
    band: float | None = None,
    settle_time: float | None = None,
) -> Metrics:
    """Figures of samples: time (T,) in s, deviation x - x* (T, N, D), controls u (T, N, D) or None."""
    error = np.abs(deviation).max(axis=(1, 2))
    begin = time[0] + FINAL_PART * (time[-1] - time[0]) if settle_time is None else settle_time
    late = time >= begin - time_slack(begin, time[-1])
    if not late.any():
        raise ResultError(f"there is no sample from {in_seconds(begin)} on")
    width = SETTLED * float(error[0]) if band is None else band
    return Metrics(
        settling_time=settling_time(time, error, width),
        overshoot=overshoot(deviation),
        control_energy=float("nan") if u is None else control_energy(time, u),
        control_peak=float("nan") if u is None else float(np.abs(u).max()),
        final_error=float(error[late].max()),
        events=events,
        band=width,
    )


def settling_time(time: FloatArray, error: FloatArray, band: float) -> float:
    """Time in s, from the first sample, after which error (T,) >= 0 stays at or below band.

    Between the last sample outside and the next the error is taken as exponential. NaN if the last sample
    is outside.
    """
    outside = np.flatnonzero(error > band)
    if not outside.size:
        return 0.0
    last = int(outside[-1])
    if last == len(error) - 1:
        return float("nan")
    high, low = float(error[last]), float(error[last + 1])
    part = np.log(high / band) / np.log(high / low) if low > 0.0 else 1.0
    return float((time[last] - time[0]) + part * (time[last + 1] - time[last]))


def overshoot(deviation: FloatArray) -> float:
    """How far an entry of x - x* (T, N, D) goes beyond 0, seen from its start, over the largest initial one.

    Entries that start at their equilibrium count on both sides. 0 if every entry starts there and stays.
    """
    start = deviation[0]
    scale = float(np.abs(start).max())
    beyond = float(np.where(start == 0.0, np.abs(deviation), -np.sign(start) * deviation).max(initial=0.0))
    if scale == 0.0:
        return 0.0 if beyond == 0.0 else float("inf")
    return max(beyond, 0.0) / scale


def control_energy(time: FloatArray, u: FloatArray) -> float:
    """Integral of |u|^2 over time (T,), by the trapezoidal rule; u (T, N, D)."""
    power = (u * u).sum(axis=(1, 2))
    return float(0.5 * np.sum((power[1:] + power[:-1]) * np.diff(time)))


def sample_times(stop_time: float, step: float) -> FloatArray:
    """Times from 0 to stop_time, every step, the first ten steps twenty times finer; in s."""
    count = max(1, round(stop_time / step))
    regular = stop_time * (np.arange(count + 1) / count)
    first = min(START_STEPS, count)
    fine = regular[first] * (np.arange(first * FINER) / (first * FINER))
    return np.concatenate([fine, regular[first:]])
