"""What people compare between runs: settling time, overshoot, control energy, final error, events.

The FMU judges a run along its integrator's own steps, so that its figures do not depend on the samples;
those of samples serve what it did not judge: another band, another window, results of other programs.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import ResultError
from ..times import in_seconds, time_slack

FloatArray = NDArray[np.float64]

SETTLED = 0.02
"""Default band of the settling time, as a part of the initial norm of x - x*."""

FINAL_PART = 0.8
"""Part of the run after which the final error is judged, when no time is given."""

JUDGED = ("settling_time", "settled", "control_energy", "control_peak", "error_peak", "overshoot")
"""Variables of the FMU that judge a run up to the time at which they are read."""


@dataclass(frozen=True)
class Metrics:
    """Figures of one run. NaN: not recorded, or for settling_time that the run does not settle."""

    settling_time: float  # s since the beginning, until the norm of x - x* stays within the band
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


def final_begin(start: float, stop: float, settle_time: float | None) -> float:
    """Time in s from which the final error is taken; default 80 % of the run."""
    return start + FINAL_PART * (stop - start) if settle_time is None else settle_time


def judged_metrics(
    judged: Mapping[str, float], *, initial_error: float, band: float, events: float
) -> Metrics:
    """Figures that the FMU found: values of JUDGED at the end, nash_error at the start, the band set or 0."""
    return Metrics(
        settling_time=judged["settling_time"] if judged["settled"] else float("nan"),
        overshoot=judged["overshoot"],
        control_energy=judged["control_energy"],
        control_peak=judged["control_peak"],
        final_error=judged["error_peak"],
        events=events,
        band=band or SETTLED * initial_error,
    )


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
    error = np.linalg.norm(deviation, axis=(1, 2))
    begin = final_begin(time[0], time[-1], settle_time)
    late = time >= begin - time_slack(begin, time[-1])
    if not late.any():
        raise ResultError(f"there is no sample from {in_seconds(begin)} on")
    width = SETTLED * float(error[0]) if band is None else band
    return Metrics(
        settling_time=settling_time(time, error, width),
        overshoot=overshoot(deviation),
        control_energy=float("nan") if u is None else control_energy(time, u),
        control_peak=float("nan") if u is None else float(np.abs(u).max()),
        final_error=float(np.abs(deviation[late]).max()),
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

    Entries that start at their equilibrium count on both sides. 0 if every entry starts there.
    """
    start = deviation[0]
    scale = float(np.abs(start).max())
    beyond = float(np.where(start == 0.0, np.abs(deviation), -np.sign(start) * deviation).max(initial=0.0))
    return max(beyond, 0.0) / scale if scale > 0.0 else 0.0


def control_energy(time: FloatArray, u: FloatArray) -> float:
    """Integral of |u|^2 over time (T,), by the trapezoidal rule; u (T, N, D)."""
    power = (u * u).sum(axis=(1, 2))
    return float(0.5 * np.sum((power[1:] + power[:-1]) * np.diff(time)))


def told_figure(metrics: Metrics | None, name: str, digits: int) -> str:
    """A figure in so many digits for a table: a dash for what is not known, words for a run that goes on."""
    value = float("nan") if metrics is None else float(getattr(metrics, name))
    if not np.isnan(value):
        return f"{value:.{digits}g}"
    return "-" if metrics is None or name != "settling_time" else "not settled"
