"""Times that importers form by different sums and products, for what is meant to be one moment."""

import numpy as np


def time_slack(*times: float) -> float:
    """How far such times may differ, in s: 1 ns, and a few roundings where the times are large."""
    return 1e-9 + 4.0 * float(np.spacing(np.abs(times).max()))


def in_seconds(time: float) -> str:
    """A time for people, with all digits that a date needs: 0.3 s, 1760000000.25 s."""
    return f"{time:.15g} s"
