"""Real variables of an FMU, read or told in one call."""

from collections.abc import Sequence
from ctypes import c_double, c_int, c_uint
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class Reals:
    """Real variables that are read, or told with their derivatives, in one call each."""

    def __init__(self, references: Sequence[int]) -> None:
        self._count = len(references)
        self._references = (c_uint * self._count)(*references)
        self._values = (c_double * self._count)()
        self._orders = [(c_int * self._count)(*[order] * self._count) for order in (1, 2, 3)]

    def read(self, slave: Any) -> FloatArray:
        """Their values (count,)."""
        if self._count:
            slave.fmi2GetReal(slave.component, self._references, self._count, self._values)
        return np.array(self._values)

    def tell(self, slave: Any, values: FloatArray, *derivatives: FloatArray) -> None:
        """Set inputs and their derivatives, the first at most three, each of any shape with count entries."""
        if not self._count:
            return
        self._values[:] = cast("Any", values.ravel().tolist())
        slave.fmi2SetReal(slave.component, self._references, self._count, self._values)
        for orders, derivative in zip(self._orders, derivatives, strict=False):
            self._values[:] = cast("Any", derivative.ravel().tolist())
            slave.fmi2SetRealInputDerivatives(
                slave.component, self._references, self._count, orders, self._values
            )
