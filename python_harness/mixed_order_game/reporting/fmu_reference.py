"""The FMU's reference page, generated from its model description.

`python -m mixed_order_game.reporting.fmu_reference [FMU] > fmu_reference.md`; the paper's example when no FMU
is named.
"""

import re
import sys
from collections.abc import Sequence

from ..errors import MixedOrderGameError
from ..fmu.model import Model, Variable, read_model
from ..names import parse_name

INDICES = {"center": "m", "a": "i,j", "cost_coupling": "i,j", "y": "i,j,l", "y0": "i,j,l", "W": "i,m,l"}
"""Letters of a name's indices; i and i,l for the others."""

SECTIONS = (
    ("Parameters", ("parameter",)),
    ("Inputs", ("input",)),
    ("Outputs", ("output",)),
    ("Calculated parameters and local variables", ("calculatedParameter", "local")),
    ("Independent variable", ("independent",)),
)

WORDS = {
    "canHandleVariableCommunicationStepSize": "communication steps of any size",
    "canInterpolateInputs": "inputs with derivatives (fmi2SetRealInputDerivatives)",
    "maxOutputDerivativeOrder": "highest order of output derivatives",
    "canGetAndSetFMUstate": "states are saved and restored (fmi2GetFMUstate)",
    "canSerializeFMUstate": "saved states as bytes",
    "providesDirectionalDerivative": "directional derivatives",
    "canBeInstantiatedOnlyOncePerProcess": "only one instance a process",
    "needsExecutionTool": "needs another tool",
}

HEAD = """# The FMU

*Generated from `modelDescription.xml` of the paper's example by
`python -m mixed_order_game.reporting.fmu_reference`; do not edit.*

Indices count from 1: player `i`, other player `j`, coordinate `l`, neuron `m`. Another game has other counts
and start values; `mog info GAME --variables` lists its variables one by one. With `expose = "outputs"`, the
default of games of more than 20,000 variables, `y`, `y0` and `W` do not exist, and `a[i,j]` and
`cost_coupling[i,j]` only where they are not zero.

Where a player of the game file has `gains` of its own, the gains are `k1[i]` (players of order 1), `k4[i]`
(order 2), `k2[i]`, `k3[i]`, `beta[i]`, `delta[i]` and `epsilon[i]`; where one has an `rbf` of its own,
`W_max[i]`, `rho[i]` and `center[i,m]`. Where one has `W0`, there are fixed parameters `W0[i,m,l]`, judged
against `W_max` when initialization ends. Where one has `u_max`, there are tunable parameters `u_max[i,l]`,
and `u[i,l]` is the control within its bound. Of a directed graph all `a[i,j]`, i != j, are variables: the
weight with which i hears j.

A *fixed* parameter is set before the run, a *tunable* one also at any communication point.
"""

DERIVATIVES = """## Directional derivatives and dependencies

`fmi2GetDirectionalDerivative` is exact: it comes from the analytic Jacobian, by one product for each call.

|  | unknowns | knowns |
| --- | --- | --- |
| in initialization mode | outputs, `x_star`, states, `der(...)` | parameters, `d_ext`, `time` |
| afterwards | outputs, `der(...)` | states, `d_ext`, `time` |

- Without `y` and `W` among the variables, neither states nor `der(...)` count; other variables are refused
  by name.
- Weight columns stay in their present mode: where one is about to enter or to leave the sphere, the
  derivative is the one-sided one of the present mode. On the sphere the equations divide by `W_max`, not by
  `w'w`.
- With respect to `time`, inputs stand still. A known that is named twice changes by the sum.
- At `x = x_star` the derivative of `nash_error` is defined as 0.
- In a run parameters are those that act: in co-simulation what was set since the last step acts from the next
  one, in model exchange at once.

The model structure lists a dependency exactly where this derivative is not zero for some state and some
values of the parameters that can be set. An edge of weight zero counts, because it can be set; a term that
the game's unknown dynamics lack does not. A factor of 1 is declared `constant`, one that only parameters
change `tunable`.
"""

JUDGED = """## What judges a run

`settling_time`, `settled`, `control_energy`, `control_peak`, `error_peak` and `overshoot` tell of the run up
to the present time, and do not depend on how it is sampled: they are found along the integrator's own steps,
peaks and crossings between their ends by its interpolation. Reading them leaves no trace in the run.

- A run is settled while `nash_error` is within the band: `settling_band`, or 2 % of its initial value. After
  a change of the costs it is measured to the equilibrium then in force. Where the initial value is 0 and no
  band is set, `settling_time` is 0.
- `error_peak` begins at `judge_from`, an absolute time, and is 0 before it. Setting `judge_from` during the
  run, to whatever value, begins it anew at once, at `judge_from` or now, whichever is later.
- Where the control jumps, because a parameter changes, say, `control_peak` counts both sides.
- By model exchange they are found at each accepted step (`fmi2CompletedIntegratorStep`), from Hermite's
  cubic between its ends, and are as fine as the importer's steps allow.
- An FMU of some players knows no equilibrium, and has `control_energy` and `control_peak` of its own players.
"""


def fmu_reference(model: Model) -> str:
    """The page (Markdown) of an FMU: experiment, capabilities and every kind of variable."""
    blocks = [
        HEAD,
        "## At a glance\n",
        _table(
            ("", ""),
            [
                ("model", model.name),
                ("game", model.title),
                ("FMI version", model.fmi_version),
                ("default experiment", f"0 to {model.stop_time:g} s, step {model.step:g} s"),
                ("default relative tolerance", f"{model.tolerance:g}"),
                ("variables", f"{len(model.variables)}"),
            ],
        ),
        "## Capabilities\n",
        _table(
            ("capability", *model.capabilities),
            [
                (
                    f"{WORDS[name]} (`{name}`)",
                    *(_plain(each.get(name, "-")) for each in model.capabilities.values()),
                )
                for name in WORDS
                if any(name in each for each in model.capabilities.values())
            ],
        ),
        DERIVATIVES,
        JUDGED,
    ]
    for title, causalities in SECTIONS:
        groups = _groups(model, causalities)
        if groups:
            rows = [_row(stem, variables) for stem, variables in groups.items()]
            header = ("variable", "count", "kind", "unit", "start", "range", "meaning")
            blocks += [f"## {title}\n", _table(header, rows)]
    return "\n".join(blocks)


def main(arguments: Sequence[str]) -> int:
    """Print the page of an FMU. Returns the exit code."""
    if len(arguments) > 1:
        sys.stderr.write("usage: python -m mixed_order_game.reporting.fmu_reference [FMU]\n")
        return 2
    try:
        sys.stdout.write(fmu_reference(read_model(arguments[0] if arguments else None)))
    except MixedOrderGameError as error:
        sys.stderr.write(f"fmu_reference: {error}\n")
        return 1
    return 0


def _groups(model: Model, causalities: Sequence[str]) -> dict[str, list[Variable]]:
    groups: dict[str, list[Variable]] = {}
    for variable in model.variables.values():
        if variable.causality in causalities:
            groups.setdefault(_stem_and_index(variable)[0], []).append(variable)
    return groups


def _row(stem: str, variables: Sequence[Variable]) -> tuple[str, ...]:
    first = variables[0]
    _, index = _stem_and_index(first)
    base = stem.removeprefix("der(").removesuffix(")")
    letters = f"[{INDICES.get(base, ('', 'i', 'i,l')[min(len(index), 2)])}]" if index else ""
    name = f"`{stem.replace(base, base + letters)}`"
    kinds = dict.fromkeys(f"{each.variability} {each.type} {each.causality}" for each in variables)
    units = dict.fromkeys(each.unit or "" for each in variables)
    starts = dict.fromkeys(each.start for each in variables)
    start = "differs" if len(starts) > 1 else _plain(next(iter(starts)))
    meanings = dict.fromkeys(each.description for each in variables)
    return (
        name,
        str(len(variables)),
        ", ".join(kinds),
        ", ".join(unit for unit in units if unit not in ("", "1")),
        start,
        _range(first),
        "; ".join(meanings),
    )


def _stem_and_index(variable: Variable) -> tuple[str, tuple[int, ...]]:
    """As parse_name; der(x[1,2]) has the stem der(x)."""
    derivative = re.fullmatch(r"der\((.*)\)", variable.name)
    if derivative is None:
        return parse_name(variable.name)
    stem, index = parse_name(derivative[1])
    return f"der({stem})", index


def _range(variable: Variable) -> str:
    low, high = variable.minimum, variable.maximum
    if low is None and high is None:
        return ""
    if high is None and low is not None:
        return (
            "at least 0"
            if low == 0.0
            else "positive"
            if 0.0 < low < sys.float_info.epsilon
            else f"at least {low:g}"
        )
    if low is None:
        return f"at most {high:g}"
    return f"{low:g} to {high:g}"


def _plain(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return (
        "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)
        + "\n"
    )


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
