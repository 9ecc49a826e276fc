"""Draws the figures of docs/own_plant.md and prints its table: python -m tests.vehicle.figures."""

import os
import re
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from mixed_order_game.results.plot import save_figure
from mixed_order_game.results.style import colours, legend_above, new_axes, paper_style

from .make import make_vehicle

DOCS = Path(__file__).resolve().parents[2] / "python_harness" / "docs"
STEPS = (0.00125, 0.0025, 0.005, 0.0075, 0.01, 0.0125)
LAGS = (0.0, 0.01, 0.02, 0.05, 0.1)
STOP, LAST, SHOWN = 20.0, 0.2, 0.005


def snippets() -> dict[str, Any]:
    """The namespace of the page's snippets, run in the working directory."""
    namespace: dict[str, Any] = {}
    page = (DOCS / "own_plant.md").read_text(encoding="utf-8")
    for block in re.findall(r"^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL):
        exec(compile(block, "own_plant.md", "exec"), namespace)  # noqa: S102 - our own documentation
    return namespace


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        make_vehicle(Path("vehicle.fmu"))
        coupled = snippets()["coupled"]
        errors = {
            (step, lag): np.abs(coupled(step, lag, STOP)[:, 3] + 0.5).max(axis=1)
            for step in STEPS
            for lag in LAGS
        }
    last = {key: float(error[int((1.0 - LAST) * len(error)) :].max()) for key, error in errors.items()}
    print("| step (ms) | " + " | ".join(f"lag {1e3 * lag:g} ms" for lag in LAGS) + " |")
    print("|---" * (len(LAGS) + 1) + "|")
    for step in STEPS:
        print(f"| {1e3 * step:g} | " + " | ".join(f"{last[step, lag]:.2g}" for lag in LAGS) + " |")
    with paper_style():
        axes = new_axes()
        handles = []
        for lag, colour in zip(LAGS, colours(len(LAGS)), strict=True):
            handles += axes.loglog(
                [1e3 * step for step in STEPS],
                [last[step, lag] for step in STEPS],
                "o-",
                color=colour,
                markersize=3,
            )
        handles.append(axes.axvline(10.0, color="0.45", linestyle=":"))
        axes.set_xlabel("step (ms)")
        axes.set_ylabel(r"largest $|x_4 - x_4^*|$ at the end")
        ticks = [1e3 * step for step in STEPS]
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.set_xticks([], minor=True)
        legend_above(axes, handles, [*(f"lag {1e3 * lag:g} ms" for lag in LAGS), r"$1 / \lambda$"], columns=3)
        save_figure(axes, DOCS / "images" / "own_plant_steps.png", force=True)
        axes = new_axes()
        handles = []
        for lag, colour in zip(LAGS, colours(len(LAGS)), strict=True):
            error = errors[SHOWN, lag]
            handles += axes.semilogy(SHOWN * np.arange(1, len(error) + 1), error, color=colour)
        axes.set_xlim(0.0, 4.0)
        axes.set_xlabel("time (s)")
        axes.set_ylabel(r"error $|x_4 - x_4^*|$")
        legend_above(axes, handles, [f"lag {1e3 * lag:g} ms" for lag in LAGS], columns=3)
        save_figure(axes, DOCS / "images" / "own_plant_lags.png", force=True)


if __name__ == "__main__":
    main()
