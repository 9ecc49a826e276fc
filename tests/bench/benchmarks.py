"""The benchmark suite: each part writes a JSON file, and all parts together a table and a figure.

Peers and core solve the same hybrid problem; the reference trajectory of the paper's case comes from an
independent integration with tight tolerance. Times are CPU seconds of the integration alone, in one thread.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from tests.games_by_hand import BY_HAND, GAMES, fewer_households, two_hundred_households
from tests.oracle.game import FloatArray, read_game
from tests.oracle.general_loop import Functions, GeneralLoop

from . import report
from .change_cost import change_cost
from .expression_games import (
    aggregative,
    five_vehicles,
    scaling_by_defaults,
    scaling_in_one_coordinate,
)
from .larger_games import cars, divers, seekers, with_eleven_neurons
from .peers.core import Core
from .peers.hybrid_model import Solution
from .scaling_game import scaling_game

ROOT = Path(__file__).resolve().parents[2]
PROGRAMS = ROOT / "build" / "bench" / "tests" / "bench"
PAPER_GAME = ROOT / "modelDescription" / "games" / "five_vehicles.toml"
REFERENCE = ROOT / "tests" / "reference" / "five_vehicles.npz"
DOCUMENT = ROOT / "python_harness" / "docs" / "benchmarks.md"
FIGURE = ROOT / "python_harness" / "docs" / "benchmarks.png"

Solve = Callable[[float], Solution]
Result = dict[str, Any]


@dataclass(frozen=True)
class Context:
    """What every part needs."""

    quick: bool
    jit: bool
    fmu: Path
    scratch: Path

    @property
    def core(self) -> Core:
        """The paper's case: 200 outputs over 20 s."""
        return Core(PROGRAMS / "core_run", PAPER_GAME, 20.0, 200)


class PaperReference:
    """The stored trajectory of the paper's case, by an independent integrator at rtol 1e-13."""

    def __init__(self) -> None:
        with np.load(REFERENCE) as stored:
            self.times: FloatArray = stored["t"]
            self.x = stored["x"].transpose(0, 2, 1).reshape(len(self.times), -1)
            self.zv = (stored["z"] + stored["v"]).transpose(0, 2, 1).reshape(len(self.times), -1)
            players = stored["x"].shape[1]
            self.switches = [
                (float(t), int(coordinate - 1) * players + int(player - 1))
                for t, player, coordinate in zip(
                    stored["switch_time"], stored["switch_player"], stored["switch_coordinate"], strict=True
                )
            ]

    def error(self, states: FloatArray) -> float:
        """Largest error of an entry of x at an output time."""
        return float(np.max(np.abs(states[:, : self.x.shape[1]] - self.x)))

    def relative_error(self, states: FloatArray) -> float:
        """Largest error of x, z, v at an output time, each over the largest value of its column (or 1)."""
        exact = np.hstack([self.x, self.zv])
        scale = np.maximum(1.0, np.max(np.abs(exact), axis=0))
        return float(np.max(np.abs(states[:, : exact.shape[1]] - exact) / scale))


def peers(context: Context, reference: PaperReference) -> dict[str, Solve]:
    """Every peer that is installed, in the order of the tables."""
    from .peers.casadi_cvodes import CasadiCvodes
    from .peers.scipy_solvers import ScipySolver
    from .peers.sundae_cvode import SundaeCvode

    game, times = read_game(PAPER_GAME), reference.times
    found: dict[str, Solve] = {"CasADi CVODES": CasadiCvodes(game, times).solve}
    told = reference.switches
    found["CasADi CVODES, told the switches"] = CasadiCvodes(game, times, told).solve
    csparse = CasadiCvodes(game, times, told, linear_solver="csparse")
    found["CasADi CVODES, told, csparse"] = csparse.solve
    if context.jit:
        found["CasADi CVODES, told, compiled"] = CasadiCvodes(game, times, told, jit=True).solve
    found["scikit-sundae CVODE"] = SundaeCvode(game, times).solve
    found["SciPy LSODA"] = ScipySolver(game, times, "LSODA").solve
    found["SciPy BDF"] = ScipySolver(game, times, "BDF", sparse=True).solve
    found["SciPy Radau"] = ScipySolver(game, times, "Radau", sparse=True).solve
    if context.fmu.exists():
        from .peers.fmu import FmuThroughFmpy

        found["this FMU through fmpy"] = FmuThroughFmpy(
            game, times, context.fmu, context.scratch / "fmu"
        ).solve
    else:
        print(f"no FMU at {context.fmu}: left out", file=sys.stderr)
    return found


GRID = [10.0 ** (-3.0 - k / 10.0) for k in range(61)]


def at_equal_error(
    context: Context, solve: Callable[[], Solution], peer_error: float, core: Core, errors: list[float]
) -> Result:
    """Pairs of runs, the core at the loosest tolerance of GRID whose error, one of these, serves."""
    # the neighbour of the one that is taken serves too: not a lucky one
    enough = [k for k in range(len(GRID) - 1) if max(errors[k : k + 2]) <= peer_error]
    rtol = GRID[enough[0]] if enough else GRID[-1]
    pairs = []
    for _ in range(3 if context.quick else 11):
        theirs = solve().cpu
        pairs.append((theirs, core.run(rtol, repetitions=5).median))
    ratios = [theirs / ours for theirs, ours in pairs]
    return {
        "peer_error": peer_error,
        "peer_cpu": float(np.median([theirs for theirs, _ in pairs])),
        "core_rtol": rtol,
        "core_error": errors[GRID.index(rtol)],
        "core_cpu": float(np.median([ours for _, ours in pairs])),
        "ratio": float(np.median(ratios)),
        "ratio_range": [min(ratios), max(ratios)],
    }


def paired(context: Context) -> Result:
    """The paper's case at equal true error: each peer at 1e-6, the core as loose as gives no worse error."""
    reference, core = PaperReference(), context.core
    tight = core.run(1e-13)
    errors = [reference.error(core.run(rtol).trajectory) for rtol in GRID]
    rows = []
    for name, solve in peers(context, reference).items():
        peer_error = reference.error(solve(1e-6).states)
        rows.append({"peer": name} | at_equal_error(context, partial(solve, 1e-6), peer_error, core, errors))
        print(f"  {name}: {rows[-1]['ratio']:.1f}", flush=True)
    return {"core_at_1e-13_against_reference": reference.error(tight.trajectory), "rows": rows}


def precision(context: Context) -> Result:
    """True error and time over the tolerance, for the core and every peer."""
    reference, core = PaperReference(), context.core
    tolerances = [10.0**-k for k in range(3, 8 if context.quick else 11)]
    curves: dict[str, list[Result]] = {"this core": []}
    for rtol in tolerances:
        run = core.run(rtol, repetitions=5)
        curves["this core"].append(
            {
                "rtol": rtol,
                "cpu": run.median,
                "error": reference.error(run.trajectory),
                "relative_error": reference.relative_error(run.trajectory),
                "steps": run.steps,
                "rate_evaluations": run.rate_evaluations,
                "setups": run.setups,
            }
        )
    for name, solve in peers(context, reference).items():
        curves[name] = []
        for rtol in tolerances:
            try:
                solve(rtol)  # caches and integrators made for this tolerance
                found = [solve(rtol) for _ in range(1 if context.quick else 3)]
            except (ArithmeticError, RuntimeError) as failure:
                print(f"  {name} at {rtol:g}: {failure}", file=sys.stderr)
                continue
            cpu = float(np.median([solution.cpu for solution in found]))
            curves[name].append({"rtol": rtol, "cpu": cpu, "error": reference.error(found[0].states)})
        print(f"  {name}", flush=True)
    return {"curves": curves}


def scaling(context: Context) -> Result:
    """Time and memory of the scaling family, 100 outputs over 10 s at rtol 1e-6, in pairs; KLU at N = 20."""
    sizes = [5, 20, 50, 100] if context.quick else [5, 20, 50, 100, 200]
    cores = {}
    for players in sizes:
        file = context.scratch / f"scaling_{players}.toml"
        file.write_text(scaling_game(players))
        cores[players] = Core(PROGRAMS / "core_run", file, 10.0, 100)
    times: dict[int, list[float]] = {players: [] for players in sizes}
    ratios: dict[int, list[float]] = {players: [] for players in sizes}
    runs = {}
    for _ in range(2 if context.quick else 5):
        for players in sizes:
            # each size against a run of N = 20 just before it
            near = cores[20].run(1e-6, repetitions=5).median
            runs[players] = cores[players].run(1e-6, repetitions=5 if players <= 50 else 1)
            times[players].append(runs[players].median)
            ratios[players].append(runs[players].median / near)
    median = {players: float(np.median(times[players])) for players in sizes}
    rows = [
        {
            "players": players,
            "states": runs[players].states,
            "cpu": median[players],
            "ratio_to_20": float(np.median(ratios[players])),
            "peak_mb": runs[players].peak_mb,
            "steps": runs[players].steps,
            "rate_evaluations": runs[players].rate_evaluations,
            "setups": runs[players].setups,
            "solves": runs[players].solves,
            "events": runs[players].events,
        }
        for players in sizes
    ]
    fitted = [players for players in sizes if 20 <= players <= 100]
    exponent = np.polyfit(np.log(fitted), np.log([median[players] for players in fitted]), 1)[0]
    result: Result = {"rows": rows, "exponent_20_to_100": float(exponent)}
    if 200 in sizes:
        result["exponent_100_to_200"] = float(np.log2(median[200] / median[100]))
    result["complete"] = _complete_graph(context, cores[100])
    result["klu"] = _klu(context, cores[20])
    return result


def _complete_graph(context: Context, sparse: Core) -> Result:
    """The game of N = 100 with all players joined, in pairs with the family's own graph of degree four."""
    players = 100
    file = context.scratch / f"complete_{players}.toml"
    file.write_text(scaling_game(players, complete=True))
    core = Core(PROGRAMS / "core_run", file, sparse.stop, sparse.outputs)
    exact = core.run(1e-10).trajectory
    sparse_exact = sparse.run(1e-10).trajectory
    pairs = []
    for _ in range(2 if context.quick else 5):
        near = sparse.run(1e-6)
        run = core.run(1e-6)
        pairs.append((run.median, near.median))
    x = slice(exact.shape[1] // 2)
    return {
        "players": players,
        "cpu": float(np.median([dense for dense, _ in pairs])),
        "ratio": float(np.median([dense / near for dense, near in pairs])),
        "peak_mb": run.peak_mb,
        "error": float(np.max(np.abs(run.trajectory - exact)[:, x])),
        "sparse_error": float(np.max(np.abs(near.trajectory - sparse_exact)[:, x])),
    }


def _klu(context: Context, core: Core) -> Result:
    """KLU in place of the structured solver: same integrator, same Jacobian, same events, N = 20."""
    if context.quick:
        core = Core(core.program, core.game, 0.5, 5)
    exact = core.run(1e-11).trajectory
    result: Result = {"stop": core.stop}
    rounds = 1 if context.quick else 3
    columns = exact.shape[1] // 2
    for solver in ("klu", "klu-ordered"):
        pairs = []
        for _ in range(rounds):
            theirs = core.run(1e-6, solver=solver)
            ours = core.run(1e-6, repetitions=5)
            pairs.append((theirs.median, ours.median))
        result[solver] = {
            "cpu": float(np.median([theirs for theirs, _ in pairs])),
            "core_cpu": float(np.median([ours for _, ours in pairs])),
            "ratio": float(np.median([theirs / ours for theirs, ours in pairs])),
            "setups": theirs.setups,
            "peak_mb": theirs.peak_mb,
            "error": float(np.max(np.abs(theirs.trajectory - exact)[:, :columns])),
            "core_error": float(np.max(np.abs(ours.trajectory - exact)[:, :columns])),
        }
    return result


def overhead(context: Context) -> Result:
    """fmi2DoStep against the bare core at 2,000 communication points, with and without reading outputs."""
    if not context.fmu.exists():
        raise FileNotFoundError(f"{context.fmu} is missing: ./dev build makes it")
    import fmpy

    folder = Path(fmpy.extract(str(context.fmu), unzipdir=str(context.scratch / "overhead")))
    description: Any = fmpy.read_model_description(str(folder))
    game = read_game(PAPER_GAME)
    reference = {v.name: v.valueReference for v in description.modelVariables}
    entries = [(i, c) for c in range(1, game.dimension + 1) for i in range(1, game.players + 1)]
    names = [f"{letter}[{i},{c}]" for letter in ("x", "v", "u") for i, c in entries]
    names = [name for name in names if name in reference] + ["nash_error"]
    library = next((folder / "binaries").rglob(f"{description.coSimulation.modelIdentifier}.so"))
    words = [
        PROGRAMS / "fmu_step_run",
        PAPER_GAME,
        library,
        (folder / "resources").as_uri(),
        description.guid,
        ",".join(str(reference[name]) for name in names),
        20.0,
        2000,
        1e-6,
        11 if context.quick else 41,
    ]
    done = subprocess.run([str(word) for word in words], check=True, capture_output=True, text=True)
    measured = json.loads(done.stdout)
    pair = {
        "step": (measured["fmu"], measured["core"]),
        "step_and_outputs": (measured["fmu_with_outputs"], measured["core_with_outputs"]),
    }
    return {"steps": 2000, "difference": measured["difference"]} | {
        name: {
            "fmu": float(np.median(theirs)),
            "core": float(np.median(ours)),
            "overhead": float(np.median(np.array(theirs) / np.array(ours)) - 1.0),
        }
        for name, (theirs, ours) in pair.items()
    }


def sweep(context: Context) -> Result:
    """A run of a sweep against one fmi2DoStep over the horizon, and two processes against one."""
    return _of_package("sweep_cost", "--graphs", 100 if context.quick else 728, "--rounds", 3)


def coupled(context: Context) -> Result:
    """One FMU a player, coupled every 20 ms, against the whole game."""
    return _of_package("coupled_cost", "--rounds", 3 if context.quick else 11)


def _of_package(module: str, *options: object) -> Result:
    """What a module that needs the package prints, run in the project's own environment."""
    own = ROOT / ".venv" / "bin" / "python"
    if not own.exists():
        raise FileNotFoundError(f"{own} is missing: ./dev build makes it")
    words = [own, "-m", f"tests.bench.{module}", *options]
    done = subprocess.run([str(word) for word in words], check=True, capture_output=True, text=True, cwd=ROOT)
    return dict(json.loads(done.stdout))


def changes(context: Context) -> Result:
    """What a step costs before which an input, a gain or an edge changes."""
    if not context.fmu.exists():
        raise FileNotFoundError(f"{context.fmu} is missing: ./dev build makes it")
    return change_cost(context.fmu, context.scratch, 3 if context.quick else 11)


def microbench(context: Context) -> Result:
    """Right-hand side, set-up and solve, against the machine's measured peak."""
    games = {"paper": PAPER_GAME}
    for players in (20, 50, 100, 200):
        games[f"{players} players"] = context.scratch / f"scaling_{players}.toml"
        games[f"{players} players"].write_text(scaling_game(players))
    words = [str(PROGRAMS / "microbench"), "--benchmark_format=json"]
    words += [f"--benchmark_min_time={0.05 if context.quick else 0.5}", "--benchmark_repetitions=3"]
    words += [f"{name}={file}" for name, file in games.items()]
    done = subprocess.run(words, check=True, capture_output=True, text=True)
    rows = [
        {
            "name": row["run_name"],
            "seconds": row["cpu_time"] * 1e-9,
            **{
                key: row[key]
                for key in ("states", "seconds_per_state", "bytes_per_second", "flops_per_second")
                if key in row
            },
        }
        for row in json.loads(done.stdout)["benchmarks"]
        if row.get("aggregate_name") == "median"
    ]
    run = context.core.run(1e-6, repetitions=11)
    rate = next(row["seconds"] for row in rows if row["name"] == "rate/paper")
    return {
        "rows": rows,
        "paper_run": {
            "cpu": run.median,
            "rate_evaluations": run.rate_evaluations,
            "over_its_rate_evaluations": run.median / (rate * run.rate_evaluations),
        },
    }


def expressions(context: Context) -> Result:
    """Games written as expressions against the same games, or ones as large, of coefficients, in pairs."""
    rounds = 3 if context.quick else 11

    def core(name: str, text: str, stop: float, outputs: int) -> Core:
        file = context.scratch / f"{name}.toml"
        file.write_text(text, encoding="utf-8")
        return Core(PROGRAMS / "core_run", file, stop, outputs)

    def paired_runs(ours: Core, theirs: Core, repetitions: int) -> Result:
        pairs = []
        for _ in range(rounds):
            other = theirs.run(1e-6, repetitions=repetitions)
            own = ours.run(1e-6, repetitions=repetitions)
            pairs.append((own.median, other.median))
        return {
            "expressions": float(np.median([own for own, _ in pairs])),
            "coefficients": float(np.median([other for _, other in pairs])),
            "ratio": float(np.median([own / other for own, other in pairs])),
            "peak_mb": [own.peak_mb, other.peak_mb],
        }

    scaling = core("scaling_expressions", scaling_by_defaults(100), 2.0, 20)
    five = core("five_expressions", five_vehicles(), 20.0, 200)
    exact = [each.run(1e-10).trajectory for each in (five, context.core)]
    result: Result = {
        "five vehicles": paired_runs(five, context.core, 5)
        | {"difference": float(np.max(np.abs(exact[0] - exact[1])))},
        "scaling family, N = 100": paired_runs(
            scaling,
            core("scaling_coefficients", scaling_game(100), 2.0, 20),
            1,
        ),
    }
    result["aggregative, N = 200"] = _rates(context)
    readings = [scaling.run(1e-3) for _ in range(rounds)]
    result["reading"] = {
        "cpu": float(np.median([run.reading for run in readings])),
        "peak_mb": float(np.median([run.peak_mb for run in readings])),
    }
    return result


def _rates(context: Context) -> Result:
    """Right-hand sides of the aggregative game and the quadratic one with as many states, in turn."""
    words = [str(PROGRAMS / "microbench"), "--benchmark_format=json", "--benchmark_filter=^rate/"]
    words += ["--benchmark_repetitions=9", "--benchmark_enable_random_interleaving=true"]
    words += [f"--benchmark_min_time={0.02 if context.quick else 0.1}"]
    for name, text in (
        ("expressions", aggregative(200)),
        ("coefficients", scaling_in_one_coordinate(200)),
    ):
        file = context.scratch / f"rate_{name}.toml"
        file.write_text(text, encoding="utf-8")
        words.append(f"{name}={file}")
    done = subprocess.run(words, check=True, capture_output=True, text=True)
    seconds = {
        row["run_name"].removeprefix("rate/"): row["cpu_time"] * 1e-9
        for row in json.loads(done.stdout)["benchmarks"]
        if row.get("aggregate_name") == "median"
    }
    return seconds | {"ratio": seconds["expressions"] / seconds["coefficients"]}


GENERAL: dict[str, Callable[[], tuple[str, Functions]]] = {
    "source seeking, 11 neurons": lambda: (
        with_eleven_neurons("source_seeking"),
        BY_HAND["source_seeking"](),
    ),
    "underwater vehicles, 11 neurons": lambda: (
        with_eleven_neurons("underwater_vehicles"),
        BY_HAND["underwater_vehicles"](),
    ),
    "electric vehicles": lambda: (
        (GAMES / "electric_vehicles.toml").read_text(encoding="utf-8"),
        BY_HAND["electric_vehicles"](),
    ),
    "20 of the households": lambda: (fewer_households(20), two_hundred_households(20)),
    "source seeking by 12, 11 neurons": lambda: seekers(12),
    "10 underwater vehicles, 11 neurons": lambda: divers(10),
    "15 electric vehicles": lambda: cars(15),
}


def general(context: Context) -> Result:
    """General games over 5 s: CasADi's CVODES at rtol 1e-6 and the core at equal true error, in pairs."""
    from .peers.casadi_general import CasadiGeneral

    times = np.linspace(0.0, 5.0, 51)
    rows = []
    for name, make in GENERAL.items():
        text, functions = make()
        file = context.scratch / "general.toml"
        file.write_text(text, encoding="utf-8")
        core = Core(PROGRAMS / "core_run", file, 5.0, 50)
        loop = GeneralLoop(tomllib.loads(text), functions)
        exact = loop.unpack(loop.solve(times, 1e-11, 1e-12))[0]
        by_coordinate = exact.transpose(0, 2, 1).reshape(len(times), -1)
        columns = by_coordinate.shape[1]
        errors = [
            float(np.max(np.abs(core.run(rtol).trajectory[:, :columns] - by_coordinate))) for rtol in GRID
        ]
        for linear_solver in ("qr", "csparse"):
            peer = CasadiGeneral(loop, times, 1e-6, linear_solver)
            peer_error = float(np.max(np.abs(loop.unpack(peer.solve().states)[0] - exact)))
            rows.append(
                {"game": name, "states": len(peer.start), "solver": linear_solver}
                | at_equal_error(context, peer.solve, peer_error, core, errors)
            )
            print(f"  {name}, {linear_solver}: {rows[-1]['ratio']:.1f}", flush=True)
    return {"rows": rows}


PARTS: dict[str, Callable[[Context], Result]] = {
    "paired": paired,
    "precision": precision,
    "scaling": scaling,
    "expressions": expressions,
    "general": general,
    "overhead": overhead,
    "sweep": sweep,
    "changes": changes,
    "coupled": coupled,
    "microbench": microbench,
}


def machine() -> Result:
    """Processor, compiler and versions."""
    model = platform.processor()
    if Path("/proc/cpuinfo").exists():
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        model = next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), model)
        family = [
            next((line.split(":")[1].strip() for line in lines if line.startswith(f"{key}\t")), "?")
            for key in ("cpu family", "model")
        ]
        model += f" (family {family[0]}, model {family[1]})"
    compiler = subprocess.run(
        [shutil.which("c++") or "c++", "--version"], capture_output=True, text=True, check=False
    )
    packages = ("numpy", "scipy", "numba", "casadi", "scikit-sundae", "fmpy")
    return {
        "processor": model,
        "cores": psutil.cpu_count(logical=False) or psutil.cpu_count(),
        "memory_gb": round(psutil.virtual_memory().total / 2**30, 1),
        "system": f"{platform.system()} {platform.release()}",
        "compiler": compiler.stdout.splitlines()[0] if compiler.stdout else "?",
        "python": platform.python_version(),
        "versions": {package: version(package) for package in packages},
    }


def main() -> None:
    """Run the parts asked for, and write their results."""
    parser = argparse.ArgumentParser(prog="./dev bench", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="minutes; the documentation is left as it is")
    parser.add_argument("--only", choices=PARTS, action="append", help="one part; may be repeated")
    parser.add_argument("--output", type=Path, default=ROOT / "build" / "bench" / "results")
    parser.add_argument("--fmu", type=Path, default=ROOT / "build" / "fmu" / "MixedOrderGame.fmu")
    parser.add_argument(
        "--jit", action="store_true", help="also CasADi with its compiled functions: minutes of compiling"
    )
    arguments = parser.parse_args()
    output: Path = arguments.output.resolve()
    output.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        context = Context(arguments.quick, arguments.jit, arguments.fmu.resolve(), Path(scratch))
        for name in arguments.only or PARTS:
            print(f"{name} ...", flush=True)
            before = os.getloadavg()[0]
            try:
                result = PARTS[name](context)
            except FileNotFoundError as missing:
                print(f"  left out: {missing}", file=sys.stderr)
                continue
            result |= {"quick": arguments.quick, "machine": machine(), "load": [before, os.getloadavg()[0]]}
            (output / f"{name}.json").write_text(json.dumps(result, indent=1) + "\n")
    files = {name: output / f"{name}.json" for name in PARTS}
    results = {name: json.loads(file.read_text()) for name, file in files.items() if file.exists()}
    text = report.markdown(results)
    (output / "benchmarks.md").write_text(text)
    print(text)
    report.figure(results, output / "benchmarks.png")
    if absent := [name for name in PARTS if name not in results or results[name]["quick"]]:
        print(f"The documentation is left as it is: not measured whole are {', '.join(absent)}.")
    else:
        report.insert(text, DOCUMENT)
        if (output / "benchmarks.png").exists():
            FIGURE.write_bytes((output / "benchmarks.png").read_bytes())


if __name__ == "__main__":
    main()
