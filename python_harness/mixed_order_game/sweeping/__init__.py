"""Sweeps: many runs of one FMU over grids, sampled designs, graphs and random initial states.

>>> from mixed_order_game.sweeping import Sweep, sweep
>>> result = sweep(Sweep(fmu, grid={"k1": (5.0, 10.0, 20.0)}), "gains")
>>> result["settling_time"]
"""

from typing import TYPE_CHECKING, Any

from .pool import PoolError, usable_cores
from .sampler import Sampler, Settings

if TYPE_CHECKING:
    from .conduct import connected_graphs_example, sweep
    from .definition import Sweep
    from .figures import check_heat_map, plot_edges, plot_heat_map
    from .store import SweepError
    from .table import Spread, SweepResult, load_sweep

__all__ = [
    "PoolError",
    "Sampler",
    "Settings",
    "Spread",
    "Sweep",
    "SweepError",
    "SweepResult",
    "check_heat_map",
    "connected_graphs_example",
    "load_sweep",
    "plot_edges",
    "plot_heat_map",
    "sweep",
    "usable_cores",
]

HOMES = {
    "conduct": ("connected_graphs_example", "sweep"),
    "definition": ("Sweep",),
    "figures": ("check_heat_map", "plot_edges", "plot_heat_map"),
    "store": ("SweepError",),
    "table": ("Spread", "SweepResult", "load_sweep"),
}
"""Modules imported on first use: worker processes need neither Parquet nor matplotlib and start sooner."""


def __getattr__(name: str) -> Any:
    from importlib import import_module

    for module, names in HOMES.items():
        if name in names:
            return getattr(import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
