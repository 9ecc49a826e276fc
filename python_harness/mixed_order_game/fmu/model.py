"""What an FMU says about itself: sizes, parameters, variables, capabilities, and where its values come from.

Reads modelDescription.xml (through fmpy) and resources/game.toml from the archive; runs nothing.
"""

import difflib
import sys
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import fmpy
import numpy as np

from ..errors import ModelError, UnknownVariableError, VariableError, reason
from ..files.reading import expect_file, read_text, text_of, toml_of
from ..game.definition import expressions_of, named_parameters, with_defaults
from ..names import parse_name
from .build import GameSource, default_game, fmu_of

MODEL_IDENTIFIER = "MixedOrderGame"
Value = float | bool
Entry = TypeVar("Entry")

CAPABILITIES = (
    "canHandleVariableCommunicationStepSize",
    "canInterpolateInputs",
    "maxOutputDerivativeOrder",
    "canGetAndSetFMUstate",
    "canSerializeFMUstate",
    "providesDirectionalDerivative",
    "canBeInstantiatedOnlyOncePerProcess",
    "needsExecutionTool",
)


@dataclass(frozen=True)
class Variable:
    """One variable of the model description; start, minimum and maximum in `unit`, None when not declared."""

    name: str
    reference: int
    type: str  # Real, Integer or Boolean
    causality: str
    variability: str
    start: Value | None
    minimum: float | None
    maximum: float | None
    unit: str | None
    description: str

    @property
    def settable_before_start(self) -> bool:
        """Whether a run may set it before initialization."""
        return self.causality in ("parameter", "input") and self.variability != "constant"

    @property
    def settable_during_run(self) -> bool:
        """Whether a run may set it at a communication point."""
        return self.causality == "input" or (self.causality == "parameter" and self.variability == "tunable")


@dataclass(frozen=True)
class Model:
    """An FMU's own account of its game. N players, D coordinates, q neurons."""

    path: Path
    name: str
    description: str
    guid: str
    generation_tool: str
    fmi_version: str
    stop_time: float  # s, default experiment
    step: float  # s, default experiment
    tolerance: float  # relative, default experiment
    capabilities: Mapping[str, Mapping[str, bool | int]]  # by interface
    variables: Mapping[str, Variable]  # in the order of the file
    game: Mapping[str, Any] = field(repr=False)  # resources/game.toml as tables, its defaults applied

    @cached_property
    def order(self) -> tuple[int, ...]:
        """(N,), 1 velocity-driven, 2 acceleration-driven."""
        return tuple(int(player["order"]) for player in self.game["player"])

    @property
    def players(self) -> int:
        """N."""
        return len(self.order)

    @cached_property
    def dimension(self) -> int:
        """D."""
        return max(index[1] for index in self.indexed("u"))

    @property
    def neurons(self) -> int:
        """q."""
        return len(self.game["rbf"]["centers"])

    @property
    def title(self) -> str:
        """Title of the game."""
        return str(self.game["title"])

    @property
    def player_names(self) -> tuple[str, ...]:
        """(N,)."""
        return tuple(
            str(player.get("name", f"player {number}"))
            for number, player in enumerate(self.game["player"], 1)
        )

    @property
    def elsewhere(self) -> tuple[int, ...]:
        """1-based numbers of the players that are in other FMUs."""
        return tuple(n for n, player in enumerate(self.game["player"], 1) if player.get("elsewhere"))

    @property
    def external(self) -> tuple[int, ...]:
        """1-based numbers of the players whose plants are outside."""
        return tuple(
            n for n, player in enumerate(self.game["player"], 1) if player.get("plant") == "external"
        )

    def require_all_players(self) -> None:
        """Raises ModelError for an FMU that waits for players outside."""
        if self.elsewhere:
            raise ModelError(
                f"{self.path} holds a part of a game: player {self.elsewhere[0]} is elsewhere; "
                "mog ssp connects the parts"
            )

    def require_plants(self) -> None:
        """Raises ModelError for an FMU that waits for plants outside."""
        if self.external:
            number = self.external[0]
            raise ModelError(
                f"{self.path} waits for the plant of player {number}, which is external: connect it in a "
                f"tool, or give Python's run plant={{{number}: f}}"
            )

    @cached_property
    def expressions(self) -> Mapping[str, Sequence[int]]:
        """1-based numbers of the players whose cost, dynamics or disturbance has an expression; by part."""
        return expressions_of(self.game)

    @cached_property
    def _groups(self) -> dict[str, dict[tuple[int, ...], Variable]]:
        groups: dict[str, dict[tuple[int, ...], Variable]] = {}
        for variable in self.variables.values():
            stem, index = parse_name(variable.name)
            groups.setdefault(stem, {})[index] = variable
        return groups

    def indexed(self, stem: str) -> Mapping[tuple[int, ...], Variable]:
        """Variables of one kind by their 1-based indices: indexed("x")[1, 2] is x[1,2]; empty if none."""
        return self._groups.get(stem, {})

    def signals(self, *, estimates: bool = False) -> list[str]:
        """Names of what a run records unless told otherwise: outputs, locals and x_star.

        Left out are the weights W, all time derivatives and, unless wanted, the estimates y. x and v of
        external plants, which are inputs, are among them.
        """
        left_out = ("W",) if estimates else ("W", "y")
        return [
            variable.name
            for variable in self.variables.values()
            if (
                variable.causality in ("output", "local", "calculatedParameter")
                or (variable.causality == "input" and parse_name(variable.name)[0] in ("x", "v"))
            )
            and variable.variability != "constant"
            and parse_name(variable.name)[0] not in left_out
            and not variable.name.startswith("der(")
        ]

    def variable(self, name: str) -> Variable:
        """The variable of that name. Raises VariableError naming the nearest ones."""
        if name not in self.variables:
            raise self._unknown(name, self.variables)
        return self.variables[name]

    def select(self, names: Iterable[str]) -> list[Variable]:
        """Variables by name; x stands for every x[i,l], der(x) for every der(x[i,l]), each once.

        Raises VariableError.
        """
        chosen: dict[str, Variable] = {}
        for name in names:
            rates = self._rates(name)
            if name in self.variables:
                chosen[name] = self.variables[name]
            elif name in self._groups:
                chosen |= {variable.name: variable for variable in self._groups[name].values()}
            elif rates:
                chosen |= {rate: self.variables[rate] for rate in rates}
            else:
                raise self._unknown(name, [*self._groups, *self.variables])
        return list(chosen.values())

    def expanded(self, values: Mapping[str, Entry]) -> dict[str, Entry]:
        """The values by single variables: a name without indices stands for all of its kind, as in select.

        Raises VariableError for a name that does not exist and a variable that two names set.
        """
        expanded: dict[str, Entry] = {}
        set_by: dict[str, str] = {}
        for name, value in values.items():
            for variable in self.select([name]):
                single = variable.name
                if single in set_by:
                    raise VariableError(f"{single} is set by both {set_by[single]} and {name}")
                set_by[single], expanded[single] = name, value
        return expanded

    def _rates(self, name: str) -> list[str]:
        """Names of all time derivatives of one kind, der(x[1,1]), ... for der(x); none for another name."""
        if not (name.startswith("der(") and name.endswith(")")):
            return []
        stem = name.removeprefix("der(").removesuffix(")")
        named = (f"der({variable.name})" for variable in self.indexed(stem).values())
        return [rate for rate in named if rate in self.variables]

    def _unknown(self, name: str, known: Iterable[str]) -> UnknownVariableError:
        stem = parse_name(name)[0]
        if any(each.fixed and each.name == stem for each in named_parameters(self.game)):
            return UnknownVariableError(f"{stem} is fixed, a part of the game's expressions and no variable")
        near = difflib.get_close_matches(name, dict.fromkeys(known), n=3, cutoff=0.5)
        hint = f"; did you mean {' or '.join(near)}?" if near else ""
        return UnknownVariableError(f"there is no variable {name}{hint}")

    @property
    def edges(self) -> tuple[tuple[int, int, float], ...]:
        """Communication graph, positive weights: (i, j, weight), 1-based, i < j, or (from, to, weight)."""
        weights = ((pair, float(variable.start or 0.0)) for pair, variable in self.indexed("a").items())
        heard = [(pair, weight) for pair, weight in weights if weight > 0.0]
        return tuple(sorted((j, i, w) if self.directed else (i, j, w) for (i, j), w in heard))

    @property
    def directed(self) -> bool:
        """Whether the communication graph is directed: a[i,j] is then with what weight i hears j."""
        return any(i > j for i, j in self.indexed("a"))

    @property
    def gains(self) -> dict[str, float]:
        """Start values of the gains by name, k1[1], ... where players have their own; k1 to k4 in 1/s."""
        names = ("k1", "k2", "k3", "k4", "beta", "delta", "epsilon", "rho", "W_max")
        variables = [variable for name in names for variable in self.select([name])]
        return {variable.name: float(variable.start or 0.0) for variable in variables}

    @cached_property
    def is_paper_example(self) -> bool:
        """Whether the FMU's game is the paper's example that comes with this package.

        Title, exposure and the two switches of the strategy may differ: they change no value of the game.
        """
        paper = toml_of(read_text(default_game()))
        free = dict.fromkeys(("title", "expose", "strategy"))
        return {**paper, **free} == {**self.game, **free}

    def start_values(self, changes: Mapping[str, Value] | None = None) -> dict[str, Value]:
        """Every parameter and input with its start value, changes in place of the model's own.

        In changes a name without indices stands for all of its kind.
        Raises VariableError for a change that the FMU would not take.
        """
        values = {
            name: variable.start
            for name, variable in self.variables.items()
            if variable.causality in ("parameter", "input") and variable.start is not None
        }
        for name, value in self.expanded(changes or {}).items():
            values[name] = check_value(self.variable(name), value)
        return values

    def changed_values(self, values: Mapping[str, Value]) -> dict[str, Value]:
        """Those of the parameters and inputs that differ from the model's own start values."""
        return {name: value for name, value in values.items() if self.variable(name).start != value}


def _range_of(variable: Variable) -> str:
    low, high = variable.minimum, variable.maximum
    if high is None and low == sys.float_info.min:  # how a schema says "positive"
        return "a positive number"
    if high is None:
        return f"a number of at least {low:g}"
    if low is None:
        return f"a number of at most {high:g}"
    return f"a number from {low:g} to {high:g}"


def check_value(variable: Variable, value: object, *, during_run: bool = False) -> Value:
    """The value as float, int or bool, if the variable can be set to it at that time.

    Raises VariableError: not settable, wrong type, not finite, or outside [minimum, maximum].
    """
    name = variable.name
    kind = f"{variable.variability} {variable.causality}"
    if not variable.settable_before_start:
        raise VariableError(f"{name} cannot be set: it is a {kind}")
    if during_run and not variable.settable_during_run:
        raise VariableError(f"{name} cannot be set during a run: it is a {kind}")
    if isinstance(value, np.generic) or (isinstance(value, np.ndarray) and value.ndim == 0):
        value = value.item()
    if variable.type == "Boolean":
        if not isinstance(value, bool):
            raise VariableError(f"{name} is true or false, not {value!r}")
        return value
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise VariableError(f"{name} is a number, not {value!r}")
    if not np.isfinite(value):
        raise VariableError(f"{name} must be finite, not {value}")
    below = variable.minimum is not None and value < variable.minimum
    above = variable.maximum is not None and value > variable.maximum
    if below or above:
        raise VariableError(f"{name} is {value:g}, expected {_range_of(variable)}")
    return float(value)


def read_model(fmu: GameSource = None) -> Model:
    """Read what an FMU says of itself: sizes, parameters, variables, capabilities. Runs nothing.

    Parameters
    ----------
    fmu
        An FMU (.fmu), a game file (.toml), a game of the package by its name, a `Game`; the paper's example
        when left out.

    Returns
    -------
    Model

    Raises
    ------
    ModelError
        For a file that is missing (a FileNotFoundError, too) or is no FMU of this project.
    GameError, BuildError
        As making the FMU does.

    Examples
    --------
    >>> model = mog.read_model("five_vehicles")
    >>> model.order, model.dimension
    ((1, 1, 1, 2, 2), 2)
    """
    path = fmu_of(fmu)
    expect_file(path, "FMU", ModelError)
    try:
        with zipfile.ZipFile(path) as archive:
            game = with_defaults(toml_of(text_of(archive.read("resources/game.toml"))))
        description = fmpy.read_model_description(str(path), validate=False)
    except KeyError as error:
        raise ModelError(f"{path} is not an FMU of this project: {error.args[0]}") from error
    except Exception as error:  # zipfile, lxml and fmpy raise what they please for a broken file
        raise ModelError(f"{path} cannot be read as an FMU: {reason(error)}") from error
    interface = description.coSimulation
    if interface is None or interface.modelIdentifier != MODEL_IDENTIFIER:
        raise ModelError(f"{path} is not an FMU of this project: it has no co-simulation {MODEL_IDENTIFIER}")

    experiment = description.defaultExperiment
    interfaces = {"co-simulation": interface, "model exchange": description.modelExchange}
    return Model(
        path=path,
        name=description.modelName,
        description=description.description or "",
        guid=description.guid,
        generation_tool=description.generationTool or "",
        fmi_version=description.fmiVersion,
        stop_time=float(experiment.stopTime),
        step=float(experiment.stepSize),
        tolerance=float(experiment.tolerance),
        capabilities={
            kind: {name: getattr(each, name) for name in CAPABILITIES if hasattr(each, name)}
            for kind, each in interfaces.items()
            if each is not None
        },
        variables={variable.name: _variable(variable) for variable in description.modelVariables},
        game=game,
    )


def _variable(scalar: Any) -> Variable:
    declared = scalar.declaredType

    def attribute(name: str) -> Any:
        """The variable's own attribute, else that of its declared type."""
        own = getattr(scalar, name)
        return getattr(declared, name) if own is None and declared is not None else own

    def number(name: str) -> float | None:
        text = attribute(name)
        return None if text is None else float(text)

    start: Value | None = None
    if scalar.start is not None:
        start = scalar.start in ("true", "1") if scalar.type == "Boolean" else float(scalar.start)
    return Variable(
        name=scalar.name,
        reference=scalar.valueReference,
        type=scalar.type,
        causality=scalar.causality,
        variability=scalar.variability,
        start=start,
        minimum=number("min"),
        maximum=number("max"),
        unit=attribute("unit"),
        description=scalar.description or "",
    )


@dataclass(frozen=True)
class Source:
    """Where one group of values of the paper's example comes from."""

    group: str
    names: Sequence[str]
    source: str  # "the paper's" or "ours"


PAPER_EXAMPLE_SOURCES = (
    Source("costs", ("cost_quadratic", "cost_linear", "cost_coupling"), "the paper's"),
    Source("unknown dynamics g", ("dynamics_gain",), "the paper's"),
    Source("disturbances d", ("disturbance_amplitude", "disturbance_frequency"), "the paper's"),
    Source("RBF centres and width", ("center", "rho"), "the paper's"),
    Source("weight bound and adaptation", ("W_max", "beta"), "the paper's"),
    Source("robust term", ("delta", "epsilon"), "the paper's"),
    Source("initial actions and velocities", ("x0", "v0"), "the paper's"),
    Source("gains", ("k1", "k2", "k3", "k4"), "ours: the paper prints none"),
    Source("communication graph", ("a",), "ours: the paper's figure was not at hand"),
    Source("initial references and estimates", ("z0", "y0"), "ours: zero, the paper does not say"),
)
"""The paper's example group by group: which values are printed in the paper and which are decided here."""


def sources(model: Model) -> tuple[Source, ...]:
    """Sources of the paper's example; empty for any other game, whose file is its source."""
    return PAPER_EXAMPLE_SOURCES if model.is_paper_example else ()
