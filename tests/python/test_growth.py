"""Simulating again and again, which loads and unloads the FMU each time, does not take ever more memory."""

import ctypes
import gc
from collections.abc import Callable
from pathlib import Path

import fmpy
import pytest

import mixed_order_game as mog

C_LIBRARY = ctypes.CDLL(None)
if not hasattr(C_LIBRARY, "mallinfo2"):
    pytest.skip("only glibc tells what is allocated", allow_module_level=True)


class Heap(ctypes.Structure):
    """struct mallinfo2 of glibc."""

    _fields_ = tuple(
        (name, ctypes.c_size_t)
        for name in (
            *("arena", "ordblks", "smblks", "hblks", "hblkhd"),
            *("usmblks", "fsmblks", "uordblks", "fordblks", "keepcost"),
        )
    )


C_LIBRARY.mallinfo2.restype = Heap


def growth(action: Callable[[], object], times: int = 6) -> float:
    """Bytes that remain of each call, once the first calls have filled all caches."""

    def allocated() -> int:
        gc.collect()
        heap = C_LIBRARY.mallinfo2()
        return int(heap.uordblks + heap.hblkhd)

    for _ in range(3):
        action()
    before = allocated()
    for _ in range(times):
        action()
    return (allocated() - before) / times


def test_fmpy(fmu: Path, tmp_path: Path) -> None:
    folder = fmpy.extract(str(fmu), unzipdir=tmp_path)
    description = fmpy.read_model_description(folder)
    assert growth(lambda: fmpy.simulate_fmu(folder, model_description=description, stop_time=0.1)) < 16e3


def test_run(fmu: Path) -> None:
    assert growth(lambda: mog.run(fmu, stop_time=0.1)) < 16e3
