"""Every kind of figure as it looks, for few and many players in one to three dimensions.

The images in tests/python/figures are made by pytest --mpl-generate-path=tests/python/figures of this file;
look at them before they are kept.
"""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from matplotlib.figure import Figure

from mixed_order_game import Result
from mixed_order_game.results import plot
from mixed_order_game.results.style import STYLE

LOOK = {"baseline_dir": "figures", "style": dict(STYLE), "savefig_kwargs": {"dpi": 80}, "tolerance": 12}


@cache
def run(players: int, dimension: int, *, apart: bool = False, W_max: float = 8.0) -> Result:
    """Actions that fall to x*, all alike or apart, with what belongs to them; players of both orders."""
    time = np.union1d(np.linspace(0.0, 20.0, 1001), np.geomspace(2e-6, 1.0, 200))
    rng = np.random.default_rng(players)
    columns: dict[str, np.ndarray] = {"nash_error": 10.0 * np.exp(-3.0 * time) + 1e-12}
    units: dict[str, str] = {}
    parameters: dict[str, float | bool] = {"W_max": W_max, "tolerance_relative": 1e-8}
    for i in range(1, players + 1):
        parameters[f"a[{i},{i % players + 1}]" if i < players else f"a[1,{players}]"] = 1.0
        for k in range(1, dimension + 1):
            index, level = f"[{i},{k}]", 1.5 * i / k if apart else -0.5
            fall = rng.uniform(-8.0, 8.0) * np.exp(-4.0 * time) * np.cos(6.0 * time)
            columns |= {f"x{index}": fall + level, f"x_star{index}": level + 0.0 * time}
            units[f"u{index}"] = "1/s2" if i % 2 == 0 else "1/s"
            columns[f"u{index}"] = -40.0 * fall - 3.0 * np.sin(i * time)
            columns[f"W_norm2{index}"] = np.minimum(8.0, 900.0 * time) / (1.0 + i * time)
            if i % 2 == 0:
                columns[f"v{index}"] = -4.0 * fall * np.tanh(50.0 * time)
            else:
                columns[f"z{index}"] = fall + level
            for j in range(1, players + 1):
                columns[f"y[{j},{i},{k}]"] = level + fall - 3.0 * j * np.exp(-9.0 * time)
    return Result(time=time, columns=columns, parameters=parameters, units=units, tolerance=1e-8)


def figure(kind: str, result: Result, width: float = plot.COLUMN_WIDTH) -> Figure:
    found = plot.draw(result, kind, width=width).get_figure(root=True)
    assert found is not None
    return found


CASES: dict[str, Callable[[], Figure]] = {
    "positions_five_in_the_plane": lambda: figure("positions", run(5, 2)),
    "positions_apart_are_named_at_their_ends": lambda: figure("positions", run(4, 1, apart=True)),
    "positions_of_twenty_in_space": lambda: figure("positions", run(20, 3, apart=True)),
    "positions_of_ninety": lambda: figure("positions", run(90, 1, apart=True)),
    "velocities": lambda: figure("velocities", run(5, 2)),
    "control": lambda: figure("control", run(5, 2)),
    "weights": lambda: figure("weights", run(2, 1)),
    "weights_far_below_their_bound": lambda: figure("weights", run(2, 1, W_max=100.0)),
    "estimates": lambda: figure("estimates", run(5, 2)),
    "plane": lambda: figure("plane", run(5, 2, apart=True)),
    "plane_of_twelve": lambda: figure("plane", run(12, 2, apart=True)),
    "graph": lambda: figure("graph", run(5, 2)),
    "graph_of_twenty": lambda: figure("graph", run(20, 3, apart=True)),
}


@pytest.mark.parametrize("case", [pytest.param(case, id=name) for name, case in CASES.items()])
@pytest.mark.mpl_image_compare(**LOOK)
def test_picture(case: Callable[[], Figure]) -> Figure:
    return case()


@pytest.mark.mpl_image_compare(**LOOK)
def test_errors_of_many_runs_are_named_at_their_ends() -> Figure:
    runs = {}
    for k, name in enumerate(("as it is", "without network", "without phi", "without both")):
        result = run(2, 1)
        floor = np.full_like(result.time, 2.0 * 10.0 ** -(k // 2 + 1))
        columns = {**result.columns, "nash_error": np.maximum(result.nash_error, floor)}
        runs[name] = Result(time=result.time, columns=columns, tolerance=1e-8)
    found = plot.plot_error(runs).get_figure(root=True)
    assert found is not None
    return found


@pytest.mark.mpl_image_compare(**LOOK)
def test_directed_graph() -> Figure:
    edges = [(1, 2, 1.0), (2, 3, 0.2), (3, 1, 1.0), (1, 4, 2.0), (4, 1, 2.0)]
    found = plot.plot_graph(edges, (1, 2, 1, 2), directed=True).get_figure(root=True)
    assert found is not None
    return found
