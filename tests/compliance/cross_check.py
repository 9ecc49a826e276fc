"""A folder of exported FMUs as the rules of the FMI Cross-Check have it (version 4.1), and what judges it.

Each of fmus/2.0/{cs,me}/PLATFORM/MixedOrderGame/VERSION/GAME holds GAME.fmu, GAME_in.csv, GAME_ref.csv and
GAME_ref.opt.
"""

from __future__ import annotations

import csv
import shutil
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import fmpy
import numpy as np
from fmpy.cross_check import validate_vendor_repo
from numpy.typing import NDArray

from mixed_order_game import Model, build_fmu, read_model, run
from mixed_order_game.fmu.build import shipped_game
from mixed_order_game.fmu.schedule import Disturbance

GAMES = ("five_vehicles", "cournot_two_markets", "cournot_isoelastic")
"""The rules ask for three; the last one has costs by expressions."""

PLATFORMS = ("linux64", "win64", "darwin64")
"""Those that the rules know of."""

STEPS = {"cs": 0.02, "me": 0.0}
"""Communication step in s; 0 means a solver of variable steps."""

INTERVAL, TOLERANCE, MOST_SIGNALS = 0.05, 1e-8, 10
PUSH = np.array([(0.0, 0.0), (2.0, 0.0), (2.5, 1.0), (3.0, 1.0), (3.5, 0.0)])
"""Time in s and d_ext[1,1], straight between the rows."""


def write_cross_check(folder: Path) -> list[Path]:
    """Make the folder anew; returns the folders of the FMUs."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return [made for name in GAMES for made in _of_game(name, folder)]


def _of_game(name: str, folder: Path) -> Iterator[Path]:
    fmu = build_fmu(shipped_game(name), folder / f"{name}.fmu")
    model = read_model(fmu)
    signals = [*_names(model, "x")[: MOST_SIGNALS - 1], "nash_error"]
    result = run(
        fmu,
        step=INTERVAL,
        tolerance=TOLERANCE,
        inputs=Disturbance(PUSH[:, 0], _push(model), linear=True),
        outputs=signals,
    )
    inputs = dict(zip(_names(model, "d_ext"), _push(model).reshape(len(PUSH), -1).T, strict=True))
    with zipfile.ZipFile(fmu) as archive:
        held = {Path(member).parts[1] for member in archive.namelist() if member.startswith("binaries/")}
    for kind, step in STEPS.items():
        for platform in sorted(held.intersection(PLATFORMS)):
            version = fmpy.read_model_description(str(fmu)).version
            place = folder / "fmus" / "2.0" / kind / platform / "MixedOrderGame" / str(version) / name
            place.mkdir(parents=True)
            shutil.copy(fmu, place)
            _write_csv(place / f"{name}_in.csv", PUSH[:, 0], inputs)
            _write_csv(place / f"{name}_ref.csv", result.time, {each: result[each] for each in signals})
            options = {"StartTime": 0.0, "StopTime": model.stop_time, "StepSize": step, "RelTol": TOLERANCE}
            lines = (f"{option}, {value!r}\n" for option, value in options.items())
            (place / f"{name}_ref.opt").write_text("".join(lines), encoding="utf-8")
            yield place
    fmu.unlink()


def _push(model: Model) -> NDArray[np.float64]:
    """d_ext (T, N, D) at the times of PUSH."""
    values = np.zeros((len(PUSH), model.players, model.dimension))
    values[:, 0, 0] = PUSH[:, 1]
    return values


def _names(model: Model, stem: str) -> list[str]:
    """Of all variables x[i,l], say, in the order of their indices."""
    return [variable.name for _, variable in sorted(model.indexed(stem).items())]


def _write_csv(path: Path, time: NDArray[np.float64], columns: dict[str, NDArray[np.float64]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, quoting=csv.QUOTE_ALL, lineterminator="\n").writerow(["time", *columns])
        rows = zip(time, *columns.values(), strict=True)
        csv.writer(file, lineterminator="\n").writerows(map(repr, map(float, row)) for row in rows)


def read_csv(path: str | Path, variable_names: Sequence[str] | None = None) -> NDArray[np.void]:
    """Read a file after the rules; FMPy's function of this name splits quoted names at commas.

    Raises ValueError for what the rules forbid.
    """
    with Path(path).open(newline="", encoding="utf-8") as file:
        names, *rows = csv.reader(file)
    values = np.array(rows, dtype=np.float64)
    if names[0] != "time" or np.any(np.diff(values[:, 0]) < 0.0):
        raise ValueError(f"{path}: expected a first column time that goes up")
    if variable_names is not None and (unknown := set(names[1:]) - set(variable_names)):
        raise ValueError(f"{path}: no variables of the FMU: {', '.join(sorted(unknown))}")
    return np.array([tuple(row) for row in values], dtype=[(name, np.float64) for name in names])


def problems(folder: Path) -> list[str]:
    """What FMPy's judge of such folders finds, and where its simulation leaves the reference."""
    original, validate_vendor_repo.read_csv = validate_vendor_repo.read_csv, read_csv
    try:
        found: list[str] = list(validate_vendor_repo.validate_repo(str(folder))[2])
    finally:
        validate_vendor_repo.read_csv = original
    for fmu in sorted(folder.glob("fmus/*/*/linux64/*/*/*/*.fmu")):
        difference = _difference(fmu)
        if not difference < 1e-4:
            found.append(f"{fmu.relative_to(folder)}: {difference:.1e} from the reference")
    return found


def _difference(fmu: Path) -> float:
    """Largest difference of FMPy's simulation with the inputs from the reference, over each signal's size."""
    kind = {"cs": "CoSimulation", "me": "ModelExchange"}[fmu.parts[-6]]
    reference = read_csv(fmu.with_name(f"{fmu.stem}_ref.csv"))
    signals = list(reference.dtype.names or ())[1:]
    found = fmpy.simulate_fmu(
        str(fmu),
        fmi_type=kind,
        stop_time=float(reference["time"][-1]),
        step_size=STEPS["cs"],
        output_interval=INTERVAL,
        relative_tolerance=TOLERANCE,
        input=read_csv(fmu.with_name(f"{fmu.stem}_in.csv")),
        output=signals,
        record_events=False,
        start_values={"tolerance_relative": TOLERANCE},
    )
    at = np.searchsorted(found["time"], reference["time"] - 1e-9)
    if not np.allclose(found["time"][at], reference["time"], atol=1e-9):
        return float("inf")
    return max(
        float(np.abs(found[name][at] - reference[name]).max())
        / max(1.0, float(np.abs(reference[name]).max()))
        for name in signals
    )
