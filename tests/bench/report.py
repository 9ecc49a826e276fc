"""Tables and figure of the benchmark results."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

Results = dict[str, Any]
CHANGES = {"an input": 15.0, "a gain": 30.0, "the weight of an edge": 30.0}
"""Microseconds beyond an idle step that are aimed at."""
BEGIN, END = "<!-- benchmarks: begin -->", "<!-- benchmarks: end -->"


def _milliseconds(seconds: float) -> str:
    return f"{1e3 * seconds:.3g}" if seconds < 1.0 else f"{1e3 * seconds:.0f}"


def _table(head: list[str], rows: list[list[str]]) -> list[str]:
    return [
        "| " + " | ".join(head) + " |",
        "|" + "---|" * len(head),
        *["| " + " | ".join(row) + " |" for row in rows],
        "",
    ]


def _verdict(value: float, bound: float, *, at_least: bool) -> str:
    met = value >= bound if at_least else value <= bound
    return f"{'at least' if at_least else 'at most'} {bound:g}: {'met' if met else '**missed**'}"


def markdown(results: Results) -> str:
    """All parts that have results, as Markdown."""
    lines: list[str] = []
    parts = (
        "paired",
        "precision",
        "scaling",
        "expressions",
        "general",
        "overhead",
        "sweep",
        "changes",
        "coupled",
        "microbench",
    )
    for part in parts:
        if part in results:
            lines += globals()[f"_{part}"](results[part])
    if results:
        lines += _machine(results)
    return "\n".join(lines).rstrip() + "\n"


def _paired(result: Results) -> list[str]:
    targets = {
        "CasADi CVODES": 30.0,
        "CasADi CVODES, told the switches": 30.0,
        "CasADi CVODES, told, csparse": 30.0,
        "SciPy BDF": 50.0,
        "SciPy Radau": 50.0,
    }
    rows = []
    for row in result["rows"]:
        bound = targets.get(row["peer"])
        low, high = row["ratio_range"]
        rows.append(
            [
                row["peer"],
                _milliseconds(row["peer_cpu"]),
                f"{row['peer_error']:.1e}",
                f"{row['core_rtol']:.1e}",
                _milliseconds(row["core_cpu"]),
                f"{row['core_error']:.1e}",
                f"**{row['ratio']:.1f}** ({low:.1f} to {high:.1f})",
                _verdict(row["ratio"], bound, at_least=True) if bound else "",
            ]
        )
    difference = result["core_at_1e-13_against_reference"]
    return [
        "## The paper's case at equal true error",
        "",
        "200 outputs over 20 s. Each peer at rtol 1e-6; the core at the loosest rtol that gives no worse "
        "largest error of x (and whose neighbour in the grid of ten per decade gives none either). CPU"
        " milliseconds, medians of alternated pairs; the ratio is peer over core. The core at rtol 1e-13"
        f" differs from the reference by {difference:.0e}.",
        "",
        *_table(
            ["peer", "its ms", "its error", "core's rtol", "core's ms", "core's error", "ratio", "target"],
            rows,
        ),
    ]


def _precision(result: Results) -> list[str]:
    curves = result["curves"]
    tolerances = [row["rtol"] for row in curves["this core"]]
    rows = []
    for name, curve in curves.items():
        found = {row["rtol"]: row for row in curve}
        cells = [
            f"{_milliseconds(found[rtol]['cpu'])} / {found[rtol]['error']:.0e}" if rtol in found else "failed"
            for rtol in tolerances
        ]
        rows.append([name, *cells])
    own = [
        [
            f"{row['rtol']:.0e}",
            f"{row['error']:.1e}",
            f"{row['relative_error']:.1e}",
            _milliseconds(row["cpu"]),
            str(row["steps"]),
            str(row["rate_evaluations"]),
            str(row["setups"]),
        ]
        for row in curves["this core"]
    ]
    return [
        "## Work and precision",
        "",
        "CPU milliseconds / largest error of x, over rtol (the absolute tolerance is 0.01 rtol).",
        "",
        *_table(["", *[f"{rtol:.0e}" for rtol in tolerances]], rows),
        "![True error against time, and time against the number of players](benchmarks.png)",
        "",
        "The core's error falls with the tolerance:",
        "",
        *_table(
            ["rtol", "error of x", "relative error of x, z, v", "ms", "steps", "right-hand sides", "set-ups"],
            own,
        ),
    ]


def _scaling(result: Results) -> list[str]:
    rows = []
    memory = {100: 60.0, 200: 250.0}
    ratio = {100: 40.0, 200: 200.0}
    for row in result["rows"]:
        players = row["players"]
        against, peak = f"{row['ratio_to_20']:.2f}", f"{row['peak_mb']:.1f}"
        if players in ratio:
            against += f" ({_verdict(row['ratio_to_20'], ratio[players], at_least=False)})"
            peak += f" ({_verdict(row['peak_mb'], memory[players], at_least=False)})"
        counts = [str(row[key]) for key in ("steps", "rate_evaluations", "setups", "events")]
        rows.append([str(players), str(row["states"]), _milliseconds(row["cpu"]), against, peak, *counts])
    exponent = result["exponent_20_to_100"]
    text = f"Time grows with exponent **{exponent:.2f}** in N from 20 to 100"
    text += f" ({_verdict(exponent, 2.2, at_least=False)})"
    if "exponent_100_to_200" in result:
        text += f"; from 100 to 200: {result['exponent_100_to_200']:.2f}"
    complete, klu = result["complete"], result["klu"]
    own, told = klu["klu"], klu["klu-ordered"]
    return [
        "## Scaling",
        "",
        "The scaling family, 100 outputs over 10 s, rtol 1e-6. CPU milliseconds, medians; the ratio to N = 20"
        " is that of runs next to each other; memory is that of the whole process at its peak.",
        "",
        *_table(
            ["N", "states", "ms", "ratio to N = 20", "MB", "steps", "right-hand sides", "set-ups", "events"],
            rows,
        ),
        text + ".",
        "",
        f"All players joined at N = {complete['players']}: {_milliseconds(complete['cpu'])} ms,"
        f" **{complete['ratio']:.1f} times** the graph of degree four"
        f" ({_verdict(complete['ratio'], 5.0, at_least=False)}), and {complete['peak_mb']:.1f} MB;"
        f" errors of x {complete['error']:.1e} and {complete['sparse_error']:.1e}.",
        "",
        f"KLU on the same Newton matrix in the same integrator at N = 20 over {klu['stop']:g} s:"
        f" {_milliseconds(own['cpu'])} ms with the better of its own orderings, **{own['ratio']:.1f} times**"
        f" the core's {_milliseconds(own['core_cpu'])} ms; errors of x {own['error']:.1e} and"
        f" {own['core_error']:.1e}. Told to eliminate weights, then estimates, then the rest, it takes"
        f" {_milliseconds(told['cpu'])} ms, {told['ratio']:.1f} times the core's.",
        "",
    ]


def _expressions(result: Results) -> list[str]:
    bounds = {"five vehicles": 1.25, "scaling family, N = 100": 1.25, "aggregative, N = 200": 2.0}
    rows = []
    for name, bound in bounds.items():
        row = result[name]
        rows.append(
            [
                f"{name}, one right-hand side" if name.startswith("aggregative") else name,
                _milliseconds(row["expressions"]),
                _milliseconds(row["coefficients"]),
                f"{row['ratio']:.2f}",
                _verdict(row["ratio"], bound, at_least=False),
            ]
        )
    reading = result["reading"]
    return [
        "## What expressions cost",
        "",
        "The paper's case over 20 s and the scaling family over 2 s, written wholly as expressions (the"
        " family by one cost, one dynamics and one disturbance in `[defaults]`), against the same games of"
        " coefficients; a game in which every cost depends on the mean of all actions against the family with"
        " D = 1, which has as many states. rtol 1e-6, CPU milliseconds, medians of pairs. The five"
        f" vehicles, whose cost sums in the order of the coefficients, differ by"
        f" {result['five vehicles']['difference']:.1e} at rtol 1e-10.",
        "",
        *_table(["game", "expressions, ms", "coefficients, ms", "ratio", "target"], rows),
        f"Reading and compiling 100 players with an expression each takes {_milliseconds(reading['cpu'])} ms"
        f" ({_verdict(1e3 * reading['cpu'], 200.0, at_least=False)}) and, with the run,"
        f" {reading['peak_mb']:.0f} MB.",
        "",
    ]


def _general(result: Results) -> list[str]:
    rows = []
    for row in result["rows"]:
        low, high = row["ratio_range"]
        best = row["solver"] == "qr"
        rows.append(
            [
                row["game"],
                str(row["states"]),
                row["solver"],
                _milliseconds(row["peer_cpu"]),
                f"{row['peer_error']:.1e}",
                f"{row['core_rtol']:.1e}",
                _milliseconds(row["core_cpu"]),
                f"{row['core_error']:.1e}",
                f"**{row['ratio']:.1f}** ({low:.1f} to {high:.1f})",
                _verdict(row["ratio"], 25.0, at_least=True) if best else "",
            ]
        )
    return [
        "## General games against CasADi",
        "",
        "Example games with expressions, some of them with more players, over 5 s, 50 outputs, in which"
        " nothing switches, against CasADi's CVODES with its exact sparse Jacobian and either of its sparse"
        " solvers, of which qr is the default; tolerances and pairs as in the paper's case, errors of x"
        " against SciPy's DOP853 at rtol 1e-11.",
        "",
        *_table(
            [
                "game",
                "states",
                "solver",
                "its ms",
                "its error",
                "core's rtol",
                "core's ms",
                "core's error",
                "ratio",
                "target",
            ],
            rows,
        ),
    ]


def _overhead(result: Results) -> list[str]:
    rows = []
    for key, name in (("step", "steps alone"), ("step_and_outputs", "steps, then x, v, u and nash_error")):
        row = result[key]
        rows.append(
            [
                name,
                _milliseconds(row["fmu"]),
                _milliseconds(row["core"]),
                f"{100.0 * row['overhead']:.1f} %",
                _verdict(100.0 * row["overhead"], 5.0, at_least=False),
            ]
        )
    return [
        "## What the FMI layer costs",
        "",
        f"The paper's case in {result['steps']} calls of fmi2DoStep from C++ against the bare core doing the"
        " same steps, interpolations and outputs, rtol 1e-6; CPU milliseconds per run, medians of pairs.",
        "",
        *_table(["", "FMU's ms", "core's ms", "overhead", "target, %"], rows),
    ]


def _sweep(result: Results) -> list[str]:
    row = [
        str(result["graphs"]),
        _milliseconds(result["step"]),
        _milliseconds(result["run"]),
        f"**{result['ratio']:.2f}** ({_verdict(result['ratio'], 1.5, at_least=False)})",
        f"**{result['speedup']:.2f}** ({_verdict(result['speedup'], 1.85, at_least=True)})",
        f"{result['limit']:.2f}" if "limit" in result else "not measured",
    ]
    return [
        "## What a sweep costs",
        "",
        "Connected graphs of the paper's example: CPU time of a run of the sweep in one process, with the"
        " processes' starts and the files, beside that of one fmi2DoStep over the horizon for the same"
        " graphs; then wall time of one process over that of two, and the same of FMI calls alone, which is"
        " what the machine allows. The FMU judges the run itself, so that a run is a handful of calls."
        " Medians of pairs.",
        "",
        *_table(
            ["graphs", "fmi2DoStep, ms", "a run, ms", "ratio", "two processes, times one", "calls alone"],
            [row],
        ),
    ]


def _changes(result: Results) -> list[str]:
    rows = []
    for name, bound in CHANGES.items():
        row = {key: 1e6 * value for key, value in result["rows"][name].items()}
        rows.append(
            [
                name,
                f"{row['idle']:.1f}",
                f"{row['changed']:.1f}",
                f"**{row['beyond']:.1f}**",
                f"{row['changed'] / row['idle']:.1f}",
                _verdict(row["beyond"], bound, at_least=False),
            ]
        )
    return [
        "## What changes cost",
        "",
        f"The paper's case over 20 s in steps of {1e3 * result['step']:g} ms, called from Python: a value set"
        " before each step, by turns two different ones or always the same. CPU microseconds a step, medians"
        " of pairs; what follows a change are steps of a Rosenbrock method instead of a start of CVODE.",
        "",
        *_table(["changed", "idle, us", "changed, us", "difference", "ratio", "target, us"], rows),
    ]


def _coupled(result: Results) -> list[str]:
    rows = []
    for row in result["rows"]:
        for library, name in (("own", "each its own"), ("one", "one for all")):
            spent = [
                f"{1e6 * row[key]:.3g}"
                for key in ("whole", f"{library}_idle", f"{library}_coupled", f"{library}_exchange")
            ]
            idle, coupled = (row[f"{library}_{key}_ratio"] for key in ("idle", "coupled"))
            ratios = [f"{idle:.1f}", f"**{coupled:.1f}** ({_verdict(coupled, 3.0, at_least=False)})"]
            rows.append([str(row["players"]), name, *spent[:2], ratios[0], spent[2], ratios[1], spent[3]])
    counts = "; ".join(
        f"with N = {row['players']}, {row['evaluations']['whole'][0]:.1f} of the whole game, "
        + " and ".join(
            f"{row['evaluations'][f'order {order}'][0]:.0f} to {row['evaluations'][f'order {order}'][1]:.0f}"
            f" of a player of order {order}"
            for order in (1, 2)
        )
        for row in result["rows"]
    )
    return [
        "## What players apart cost",
        "",
        f"One FMU a player, coupled every {1e3 * result['step']:g} ms, beside the whole game, the paper's"
        " over 20 s and the scaling family's of 20 players over 10 s; in one process, called from Python. CPU"
        " microseconds of a communication step, all FMUs together: of fmi2DoStep, and in the last column of"
        " the calls that get and set what is exchanged; ratios to the whole game, medians of runs that took"
        " turns. Idle FMUs are told the same every time. Tools unpack each FMU and load the shared library"
        " that it brings; where all load one file, as `mog periods` does, the caches hold its code once.",
        "",
        *_table(["N", "library", "whole", "idle", "ratio", "coupled", "ratio", "get and set"], rows),
        f"Right-hand sides in a step: {counts}.",
        "",
    ]


def _microbench(result: Results) -> list[str]:
    rows = []
    peaks = []
    for row in result["rows"]:
        bandwidth = f"{row['bytes_per_second'] / 1e9:.1f}" if "bytes_per_second" in row else ""
        arithmetic = f"{row['flops_per_second'] / 1e9:.1f}" if "flops_per_second" in row else ""
        if row["name"].startswith("peak/"):
            peaks.append([row["name"].removeprefix("peak/").replace("_", "-"), bandwidth, arithmetic])
            continue
        part, game = row["name"].split("/", 1)
        part = {"rate": "right-hand side", "setup": "linearize and set up", "solve": "solve"}[part]
        per_state = f"{1e9 * row['seconds_per_state']:.2f}"
        rows.append([part, game, f"{1e6 * row['seconds']:.3g}", per_state, bandwidth, arithmetic])
    run = result["paper_run"]
    return [
        "## Parts",
        "",
        "Bytes are the least traffic, what must be read and written once; operations are counted for the"
        " right-hand side only.",
        "",
        *_table(["", "game", "microseconds", "ns per state", "GB/s", "Gflop/s"], rows),
        "What the machine can do, in one thread: a triad c = a + 3 b over working sets of these sizes, and"
        " multiplies with adds that are not fused, as in the kernels.",
        "",
        *_table(["", "GB/s", "Gflop/s"], peaks),
        f"The paper's run at rtol 1e-6 takes {_milliseconds(run['cpu'])} ms for {run['rate_evaluations']}"
        f" right-hand sides: {run['over_its_rate_evaluations']:.1f} times what those alone take.",
        "",
    ]


def _machine(results: Results) -> list[str]:
    first = next(iter(results.values()))["machine"]
    loads = [load for result in results.values() for load in result["load"]]
    versions = ", ".join(f"{name} {number}" for name, number in first["versions"].items())
    return [
        "## Machine",
        "",
        f"{first['processor']}, {first['cores']} cores, {first['memory_gb']} GB, {first['system']};"
        f" {first['compiler']}; Python {first['python']}, {versions}."
        f" Load average while measuring: {min(loads):.1f} to {max(loads):.1f}.",
        "",
    ]


def insert(text: str, document: Path) -> None:
    """Replaces what lies between the markers of a document. Raises ValueError if it has none."""
    before, found, rest = document.read_text().partition(BEGIN)
    _, ended, after = rest.partition(END)
    if not found or not ended:
        raise ValueError(f"{document} lacks the markers {BEGIN} and {END}")
    document.write_text(f"{before}{BEGIN}\n\n{text}\n{END}{after}")


def figure(results: Results, file: Path) -> None:
    """Work-precision diagram, time over the number of players, and bars of what sweeps and changes cost."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    draw: dict[str, Callable[[Any], None]] = {}
    if "precision" in results:
        draw["precision"] = partial(_draw_precision, result=results["precision"])
    if "scaling" in results:
        draw["scaling"] = partial(_draw_scaling, result=results["scaling"])
    if "sweep" in results and "changes" in results:
        draw["costs"] = partial(_draw_costs, sweep=results["sweep"], changes=results["changes"])
    if not draw:
        return
    plt.rcParams.update({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False})
    drawing, all_axes = plt.subplots(1, len(draw), figsize=(5.2 * len(draw), 3.9), squeeze=False)
    for axes, panel in zip(all_axes[0], draw.values(), strict=True):
        axes.grid(visible=True, which="major", linewidth=0.4, color="0.85")
        axes.set_axisbelow(True)
        panel(axes)
    drawing.tight_layout()
    drawing.savefig(file, dpi=120)
    plt.close(drawing)


def _draw_precision(axes: Any, result: Results) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    colors = ["#0072B2", "#D55E00", "#E69F00", "#CC79A7", "#009E73", "#56B4E9", "#999999", "#000000"]
    for (name, curve), color, marker in zip(result["curves"].items(), colors, "os^vDP*X", strict=False):
        own = name == "this core"
        axes.plot(
            [row["error"] for row in curve],
            [1e3 * row["cpu"] for row in curve],
            marker=marker,
            markersize=5 if own else 4,
            linewidth=2.0 if own else 1.0,
            color=color,
            label=name,
        )
    axes.set_xlabel("largest error of x")
    axes.set_ylabel("CPU time, ms")
    axes.set_title("The paper's five vehicles, 20 s")
    axes.invert_xaxis()
    axes.set_ylim(top=8.0 * axes.get_ylim()[1])  # room for the legend
    axes.legend(fontsize=7, frameon=False, loc="upper left", ncols=2)


def _draw_scaling(axes: Any, result: Results) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    players = [row["players"] for row in result["rows"]]
    axes.plot(players, [1e3 * row["cpu"] for row in result["rows"]], "o-", color="#0072B2", label="this core")
    klu = result["klu"]
    if klu["stop"] == 10.0:
        axes.plot([20], [1e3 * klu["klu"]["cpu"]], "s", color="#D55E00", label="KLU, its own ordering")
        axes.plot(
            [20], [1e3 * klu["klu-ordered"]["cpu"]], "^", color="#E69F00", label="KLU, told the structure"
        )
    axes.set_xticks(players, [str(number) for number in players])
    axes.minorticks_off()
    axes.set_xlabel("players N")
    axes.set_ylabel("CPU time, ms")
    axes.set_title(f"Scaling family, 10 s (exponent {result['exponent_20_to_100']:.2f} from 20 to 100)")
    axes.legend(fontsize=7, frameon=False)


def _draw_costs(axes: Any, sweep: Results, changes: Results) -> None:
    """Each figure in parts of what is aimed at, so that shorter is better."""
    bars = {
        "a sweep's run / fmi2DoStep": (sweep["ratio"], 1.5, "{:.2f}"),
        "two processes / half of one": (2.0 / sweep["speedup"], 2.0 / 1.85, "{:.2f}"),
    }
    for name, bound in CHANGES.items():
        bars[f"{name} changed, us"] = (1e6 * changes["rows"][name]["beyond"], bound, "{:.0f}")
    for k, (value, bound, form) in enumerate(bars.values()):
        color = "#0072B2" if value <= bound else "#D55E00"
        axes.barh(k, value / bound, height=0.6, color=color)
        axes.text(0.03, k, form.format(value), color="white", va="center", fontsize=8)
    axes.axvline(1.0, color="black", linewidth=1.0)
    axes.set_yticks(range(len(bars)), list(bars))
    axes.invert_yaxis()
    axes.grid(visible=False, axis="y")
    axes.set_xlabel("in parts of what is aimed at")
    axes.set_title("Sweeps, and changes every 20 ms")
