"""What each public importer or checker does with the FMU, and how its results compare with the oracle's.

Importers run the paper's example for 20 s with communication steps of 0.02 s and tolerance_relative = 1e-8;
their outputs are compared, every 0.1 s, with the trajectory of the independent oracle.
"""

from __future__ import annotations

import csv
import math
import os
import re
import shutil
import subprocess
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mixed_order_game import read_model
from mixed_order_game import run as simulate_game
from mixed_order_game.fmu.coupled import Coupled
from mixed_order_game.fmu.parts import build_ssp
from mixed_order_game.fmu.run import samples
from tests.games_by_hand import BY_HAND
from tests.games_in_parts import GAMES
from tests.oracle.general_loop import GeneralLoop

from .cross_check import problems, write_cross_check

ROOT = Path(__file__).resolve().parents[2]
TOOLS = ROOT / "build" / "compliance"
HERE = Path(__file__).parent
REFERENCES = ROOT / "tests" / "reference"
STEP, STEPS, EVERY = 0.02, 1000, 5  # s; results every 0.1 s
TOLERANCE = 1e-8
BOUND = 2e-5
"""Of a difference from the oracle, relative to the largest value of the signal, at least to 1."""

EXCHANGE_BOUND = 1e-4
"""Of the same, where the importer integrates."""
EULER_BOUND = 2e-2
"""Of the same, with a method of first order."""

EXPRESSIONS = "cournot_isoelastic"
"""A game whose costs, dynamics and disturbances are expressions."""

COUPLED_STEPS = (0.01, 0.005, 0.0025)
"""Communication steps of coupled FMUs, s."""

PART_STEPS = (0.02, 0.01, 0.005, 0.0025)
"""Communication steps of games in parts, s."""

PERIODS = (0.02, 0.05, 0.2)
"""Periods in s at which coupled FMUs are to do what they do in our master."""
SAME = 1e-4
"""Of the largest difference: with a tolerance of 1e-6, times that are formed otherwise show."""

FloatArray = NDArray[np.float64]
Columns = Mapping[str, FloatArray]


class FindingError(Exception):
    """What a tool objected to, or where its results differ."""


@dataclass(frozen=True)
class Outcome:
    """One line of the table."""

    tool: str
    version: str
    did: str
    result: str
    fine: bool


@dataclass(frozen=True)
class Tool:
    """A tool and one thing that it does with the FMU: check returns its result or raises FindingError."""

    name: str
    version: str
    does: str
    check: Callable[[Path], str]

    def try_on(self, fmu: Path) -> Outcome:
        """Run it; whatever goes wrong is a finding."""
        try:
            return Outcome(self.name, self.version, self.does, self.check(fmu), fine=True)
        except Exception as error:  # noqa: BLE001 - a tool that cannot even start is a finding too
            text = " ".join(str(error).split()) or type(error).__name__
            return Outcome(self.name, self.version, self.does, text, fine=False)


def tools() -> list[Tool]:
    """All of them; what is not on this machine was set up by tests/compliance/run."""
    simulation = "imported, set a parameter, simulated 20 s"
    return [
        Tool("FMPy", version("fmpy"), "validated XML and structure", fmpy_validate),
        Tool("FMPy", version("fmpy"), simulation, fmpy_simulate),
        Tool(
            "FMU Manipulation Toolbox",
            pinned("fmu-manipulation-toolbox"),
            "checked conformity and semantics",
            toolbox,
        ),
        Tool("FMPy", version("fmpy"), "the same for a player apart and a plant outside", fmpy_validate_parts),
        Tool(
            "FMU Manipulation Toolbox",
            pinned("fmu-manipulation-toolbox"),
            "the same for a player apart and a plant outside",
            toolbox_parts,
        ),
        Tool("libcosim (libcosimpy)", version("libcosimpy"), simulation, libcosim),
        Tool("Ecos (ecospy)", pinned("ecospy"), simulation, ecos),
        Tool("FMI4j, Java", "0.38.0", simulation, fmi4j),
        Tool("fmi-sim, Rust", "0.7.0", simulation, fmi_sim),
        Tool("fmuloader", pinned("fmuloader"), f"{simulation}, a serialized state too", fmuloader),
        Tool(
            "libcosim (libcosimpy)",
            version("libcosimpy"),
            f"simulated {EXPRESSIONS}, 2 s",
            libcosim_expressions,
        ),
        Tool("Ecos (ecospy)", pinned("ecospy"), f"simulated {EXPRESSIONS}, 2 s", ecos_expressions),
        Tool("fmuloader", pinned("fmuloader"), f"simulated {EXPRESSIONS}, 2 s", fmuloader_expressions),
        Tool(
            "libcosim (libcosimpy)",
            version("libcosimpy"),
            "coupled one FMU a player from SSP, 2 s",
            libcosim_ssp,
        ),
        Tool("Ecos (ecospy)", pinned("ecospy"), "coupled one FMU a player from SSP, 2 s", ecos_ssp),
        Tool("FMPy", version("fmpy"), "coupled parts of three games from SSP, 1 s", fmpy_parts),
        Tool(
            "libcosim (libcosimpy)",
            version("libcosimpy"),
            "coupled parts of three games from SSP, 1 s",
            libcosim_parts,
        ),
        Tool("Ecos (ecospy)", pinned("ecospy"), "coupled parts of three games from SSP, 1 s", ecos_parts),
        Tool("FMPy", version("fmpy"), "model exchange with CVode, 20 s", fmpy_exchange),
        Tool("fmi-sim, Rust", "0.7.0", "model exchange with explicit Euler, 5 s", fmi_sim_exchange),
        Tool(
            "CasADi, DaeBuilder",
            pinned("casadi"),
            "model exchange with CVODES and the FMU's Jacobian, 8 s",
            daebuilder,
        ),
        Tool(
            "FMPy",
            version("fmpy"),
            "judged and simulated a cross-check folder of three games",
            cross_check_folder,
        ),
    ]


def pinned(package: str) -> str:
    """Version in requirements.txt."""
    lines = (HERE / "requirements.txt").read_text(encoding="utf-8").splitlines()
    return next(line.partition("==")[2] for line in lines if line.startswith(f"{package}=="))


def fmpy_validate(fmu: Path) -> str:
    """`fmpy validate`, as a user calls it."""
    output = run([ROOT / ".venv/bin/fmpy", "validate", fmu])
    if "No problems found" not in output:
        raise FindingError(output)
    return "no problems found"


def fmpy_simulate(fmu: Path) -> str:
    """FMPy's own simulation loop."""
    import fmpy

    result = fmpy.simulate_fmu(
        str(fmu),
        fmi_type="CoSimulation",
        stop_time=STEP * STEPS,
        step_size=STEP,
        output_interval=STEP * EVERY,
        start_values={"tolerance_relative": TOLERANCE},
        output=outputs(fmu),
    )
    return compared({name: result[name] for name in result.dtype.names})


def fmpy_exchange(fmu: Path) -> str:
    """FMPy's CVode integrates, here with a relative tolerance of 1e-8 and events by its root finding."""
    import fmpy

    result = fmpy.simulate_fmu(
        str(fmu),
        fmi_type="ModelExchange",
        solver="CVode",
        relative_tolerance=TOLERANCE,
        stop_time=STEP * STEPS,
        output_interval=STEP * EVERY,
        output=outputs(fmu),
    )
    recorded = {name: result[name] for name in result.dtype.names}
    return compared(on_grid(recorded), EXCHANGE_BOUND)  # events are recorded too


def toolbox(fmu: Path) -> str:
    """The conformity and semantic checks of `fmutool`."""
    output = run([TOOLS / ".venv/bin/fmutool", "-input", fmu, "-check"])
    expected = ("seems to be compliant with FMI-2.0", "No semantic error")
    if not all(sentence in output for sentence in expected) or "ERROR" in output or "WARNING" in output:
        raise FindingError(output)
    return "compliant, no semantic error"


def fmpy_validate_parts(_: Path) -> str:
    """`fmpy validate` of FMUs that wait for signals from outside."""
    return "; ".join({fmpy_validate(fmu) for fmu in parts()})


def toolbox_parts(_: Path) -> str:
    """The toolbox's checks of the same."""
    return "; ".join({toolbox(fmu) for fmu in parts()})


def parts() -> list[Path]:
    """FMUs of vehicle 3 alone, and of three players of whom one has its plant outside."""
    alone, outside = TOOLS / "vehicle_3.fmu", TOOLS / "external_plant.fmu"
    mog = ROOT / ".venv/bin/mog"
    run([mog, "build", "five_vehicles", "--player", 3, "--output", alone])
    run([mog, "build", ROOT / "tests/fuzz/games/external_plant.toml", "--output", outside])
    return [alone, outside]


def libcosim(fmu: Path) -> str:
    """The co-simulation library of the Open Simulation Platform."""
    return simulated([ROOT / ".venv/bin/python", HERE / "libcosim_simulate.py"], fmu)


def ecos(fmu: Path) -> str:
    """The co-simulation library Ecos, in an environment of its own."""
    return simulated([TOOLS / ".venv/bin/python", HERE / "ecos_simulate.py"], fmu)


def fmuloader(fmu: Path) -> str:
    """The loader fmuloader, driven step by step."""
    return simulated([TOOLS / ".venv/bin/python", HERE / "fmuloader_simulate.py"], fmu)


def libcosim_expressions(_: Path) -> str:
    """A game with expressions in libcosim."""
    return simulated_expressions([ROOT / ".venv/bin/python", HERE / "libcosim_simulate.py"])


def ecos_expressions(_: Path) -> str:
    """The same in Ecos."""
    return simulated_expressions([TOOLS / ".venv/bin/python", HERE / "ecos_simulate.py"])


def fmuloader_expressions(_: Path) -> str:
    """The same in fmuloader."""
    return simulated_expressions([TOOLS / ".venv/bin/python", HERE / "fmuloader_simulate.py"])


def libcosim_ssp(_: Path) -> str:
    """A system structure in libcosim."""
    return coupled([ROOT / ".venv/bin/python", HERE / "libcosim_ssp.py"])


def ecos_ssp(_: Path) -> str:
    """The same in Ecos."""
    return coupled([TOOLS / ".venv/bin/python", HERE / "ecos_ssp.py"])


def fmpy_parts(_: Path) -> str:
    """Three games in parts in FMPy."""
    return games_in_parts([ROOT / ".venv/bin/python", HERE / "fmpy_ssp.py"])


def libcosim_parts(_: Path) -> str:
    """The same in libcosim."""
    return games_in_parts([ROOT / ".venv/bin/python", HERE / "libcosim_ssp.py"])


def ecos_parts(_: Path) -> str:
    """The same in Ecos."""
    return games_in_parts([TOOLS / ".venv/bin/python", HERE / "ecos_ssp.py"])


def cross_check_folder(_: Path) -> str:
    """The folder as the cross-check's rules have it, judged by FMPy."""
    folder = TOOLS / "cross_check"
    made = write_cross_check(folder)
    if found := problems(folder):
        raise FindingError("; ".join(found))
    return f"no problems found in {len(made)} folders"


def fmi4j(fmu: Path) -> str:
    """The Java library FMI4j."""
    return simulated(["java", "-cp", f"{TOOLS}/fmi4j/*", HERE / "fmi4j" / "Simulate.java"], fmu)


def fmi_sim(fmu: Path) -> str:
    """The simulator of the Rust crates fmi and fmi-sim."""
    results = TOOLS / "fmi-sim.csv"
    options = ["--init-values", f"tolerance_relative={TOLERANCE}", "--step", STEP, "-f", STEP * STEPS]
    interval = ["--output-interval", STEP * EVERY]
    run([TOOLS / "bin/fmi-sim", "--model", fmu, "-o", results, "-c", ";", "cs", *options, *interval])
    return compared(columns(results))


def fmi_sim_exchange(fmu: Path) -> str:
    """Its explicit Euler method, which takes one step for each output: here every 0.1 ms."""
    results = TOOLS / "fmi-sim-exchange.csv"
    run(
        [
            TOOLS / "bin/fmi-sim",
            "--model",
            fmu,
            "-o",
            results,
            "-c",
            ";",
            "me",
            "-f",
            5,
            "--output-interval",
            1e-4,
        ]
    )
    return compared(on_grid(columns(results)), EULER_BOUND, 5.0)


def daebuilder(_: Path) -> str:
    """CasADi's DaeBuilder, which knows no events: a game in which no weights reach their bound."""
    game, stop, intervals = "weighted_graph", 8, 100
    fmu, results = TOOLS / f"{game}.fmu", TOOLS / "daebuilder.csv"
    run([ROOT / ".venv/bin/mog", "build", REFERENCES / "games" / f"{game}.toml", "--output", fmu])
    variables = read_model(fmu).variables
    names = [name for name in variables if name.partition("[")[0] in ("x", "v", "z")]
    run([TOOLS / ".venv/bin/python", HERE / "daebuilder_integrate.py", fmu, stop, intervals, results, *names])
    run_snippet_of_importers_page("CasADi", fmu.parent)
    return compared(columns(results), EXCHANGE_BOUND, stop, game)


def run_snippet_of_importers_page(section: str, folder: Path) -> None:
    """Run the Python snippets of a section of the page on importers, on the paper's example."""
    page = (ROOT / "python_harness" / "docs" / "importers.md").read_text(encoding="utf-8")
    text = page.partition(f"\n## {section}\n")[2].partition("\n## ")[0]
    snippet = "\n".join(re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL))
    shutil.copyfile(ROOT / "build/fmu/MixedOrderGame.fmu", folder / "MixedOrderGame.fmu")
    run([TOOLS / ".venv/bin/python", "-c", snippet], folder)


def on_grid(results: Columns) -> Columns:
    """The samples at the oracle's times."""
    intervals = results["time"] / (STEP * EVERY)
    wanted = np.abs(np.rint(intervals) - intervals) < 1e-6
    return {name: values[wanted] for name, values in results.items()}


def simulated(command: Sequence[object], fmu: Path) -> str:
    """Run one of our drivers, which all take the same arguments, and compare the file that it writes."""
    results = TOOLS / f"{Path(str(command[-1])).stem}.csv"
    run([*command, fmu, STEPS, STEP, EVERY, results, *outputs(fmu)])
    return compared(columns(results))


def simulated_expressions(command: Sequence[object]) -> str:
    """Run a driver on the game with expressions, for 2 s."""
    fmu, results = TOOLS / f"{EXPRESSIONS}.fmu", TOOLS / f"{Path(str(command[-1])).stem}_expressions.csv"
    run([ROOT / ".venv/bin/mog", "build", EXPRESSIONS, "--output", fmu])
    names = [name for name in outputs(fmu) if name.partition("[")[0] in ("x", "v")]
    run([*command, fmu, 100, STEP, EVERY, results, *names])
    return compared(columns(results), BOUND, 2.0, EXPRESSIONS)


def coupled(command: Sequence[object]) -> str:
    """Run a driver on single vehicles; the difference from the whole game has to fall with the step."""
    ssp, results, stop = TOOLS / "five_vehicles.ssp", TOOLS / f"{Path(str(command[-1])).stem}.csv", 2.0
    run([ROOT / ".venv/bin/mog", "ssp", "five_vehicles", "--output", ssp])
    reference = trajectory("five_vehicles")
    expected = reference["x"][np.searchsorted(reference["t"], stop - 1e-9)]
    names = [f"x[{i},{c}]" for i, c in np.argwhere(np.isfinite(expected)) + 1]
    differences = []
    for step in COUPLED_STEPS:
        run([*command, ssp, stop, step, results, *names])
        found = columns(results)
        differences.append(float(np.abs([found[name][-1] for name in names] - expected.ravel()).max()))
    if not all(fine < 0.6 * coarse for coarse, fine in pairwise(differences)):
        raise FindingError(f"the difference from the oracle does not fall with the step: {differences}")
    apart = []
    with Coupled("five_vehicles") as ours:
        for period in PERIODS:
            run([*command, ssp, stop, period, results, *names])
            found = columns(results)
            here = ours.run(samples(0.0, stop, period))[-1].ravel()
            apart.append(float(np.abs([found[name][-1] for name in names] - here).max()))
    if max(apart) > SAME:
        raise FindingError(f"differs from our master with periods of {PERIODS} s: {apart}")
    steps, periods = (", ".join(f"{1000.0 * step:g}" for step in each) for each in (COUPLED_STEPS, PERIODS))
    return (
        f"within {', '.join(map(one_digit, differences))} of the oracle, steps of {steps} ms; "
        f"within {one_digit(max(apart))} of `mog periods`, periods of {periods} ms"
    )


def games_in_parts(command: Sequence[object]) -> str:
    """Run a driver on three games in parts; each difference from the whole has to fall with the step."""
    rows = parts_against_whole(command)
    for what, differences in rows.items():
        if not all(fine < 0.65 * coarse for coarse, fine in pairwise(differences)):
            raise FindingError(f"{what}: the difference does not fall with the step: {differences}")
    steps = ", ".join(f"{1000.0 * step:g}" for step in PART_STEPS)
    largest = [one_digit(max(differences)) for differences in zip(*rows.values(), strict=True)]
    return f"within {', '.join(largest)} of the whole, steps of {steps} ms"


def parts_against_whole(command: Sequence[object], stop: float = 1.0) -> dict[str, list[float]]:
    """Largest difference of an action from the whole game's at the end, for each step, by game and split."""
    folder = TOOLS / "parts"
    folder.mkdir(exist_ok=True)
    names = [f"x[{i},{k}]" for i in (1, 2, 3) for k in (1, 2)]
    rows: dict[str, list[float]] = {}
    for title in ("directed", "own gains", "expressions"):
        game = folder / f"{title.replace(' ', '_')}.toml"
        game.write_text(GAMES[title], encoding="utf-8")
        whole = simulate_game(game, stop_time=stop, step=stop, tolerance=1e-9).x[-1].ravel()
        for split, groups in (("apart", None), ("in groups", [[1, 2], [3]])):
            ssp = build_ssp(game, folder / "game.ssp", groups=groups, force=True)
            differences = rows[f"{title}, {split}"] = []
            for step in PART_STEPS:
                run([*command, ssp, stop, step, folder / "end.csv", *names])
                found = columns(folder / "end.csv")
                differences.append(float(np.abs([found[name][-1] for name in names] - whole).max()))
    return rows


def run(command: Sequence[object], folder: Path | None = None) -> str:
    """What a command prints, run in a folder. Raises FindingError if it fails."""
    words = [str(word) for word in command]
    environment = {**os.environ, "NO_COLOR": "1", "COLUMNS": "200"}
    done = subprocess.run(words, capture_output=True, text=True, check=False, env=environment, cwd=folder)
    if done.returncode != 0:
        raise FindingError(
            f"{Path(words[0]).name} ended with {done.returncode}: {done.stderr or done.stdout}"
        )
    return done.stdout + done.stderr


def columns(file: Path) -> Columns:
    """A CSV file with semicolons, as names contain commas."""
    with file.open(newline="", encoding="utf-8") as lines:
        header, *rows = csv.reader(lines, delimiter=";")
    return dict(zip(header, np.array(rows, dtype=np.float64).T, strict=True))


def outputs(fmu: Path) -> list[str]:
    """Names of the FMU's outputs."""
    return [name for name, variable in read_model(fmu).variables.items() if variable.causality == "output"]


def compared(
    results: Columns, bound: float = BOUND, stop: float = STEP * STEPS, case: str = "five_vehicles"
) -> str:
    """The largest difference from the oracle. Raises FindingError if something is missing or differs."""
    reference = trajectory(case)
    time, interval = results["time"], float(reference["t"][1])
    sample = np.rint(time / interval).astype(int)
    regular = np.allclose(time, reference["t"][sample], rtol=0.0, atol=1e-9)
    if not regular or len(set(sample)) < round(stop / interval):
        raise FindingError(
            f"{len(time)} results from {time[0]:g} to {time[-1]:g} s, not one every {interval:g} s"
        )
    largest = 0.0
    for name, values in results.items():
        if name == "time":
            continue
        stem, _, index = name.partition("[")
        expected = reference[stem]
        scale = max(1.0, float(np.abs(expected).max()))
        if index:
            player, coordinate = (int(part) - 1 for part in index.rstrip("]").split(","))
            expected = expected[:, player, coordinate]
        largest = max(largest, float(np.abs(values - expected[sample]).max()) / scale)
    if not largest < bound:
        raise FindingError(f"differs from the oracle by {largest:.1e}")
    return f"within {one_digit(largest)} of the oracle"


def trajectory(case: str) -> dict[str, FloatArray]:
    """The oracle's trajectory: a stored one; with expressions, from functions typed by hand."""
    if case != EXPRESSIONS:
        with np.load(REFERENCES / f"{case}.npz") as file:
            return {name: file[name] for name in ("t", "x", "v", "z", "u", "nash_error")}
    text = (ROOT / "modelDescription" / "games" / f"{case}.toml").read_text(encoding="utf-8")
    loop = GeneralLoop(tomllib.loads(text), BY_HAND[case]())
    time = np.arange(0.0, 2.0 + 0.5 * STEP * EVERY, STEP * EVERY)
    x, p, _, _ = loop.unpack(loop.solve(time))
    return {"t": time, "x": x, "v": p}  # p is v for players of order 2, who alone have a v[i,l]


def one_digit(value: float) -> str:
    """Rounded up to one digit, so that the last bits of a machine do not show."""
    exponent = math.floor(math.log10(value)) if value > 0.0 else 0
    return f"{math.ceil(value / 10.0**exponent)}e{exponent}" if value > 0.0 else "0"
