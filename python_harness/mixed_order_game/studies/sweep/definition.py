"""What a sweep varies: the product of graphs, initial states, sampled points and grid values, row by row.

A row's number fixes its values, so that finished rows of an interrupted sweep need not be run again.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...fmu.build import GameSource
from ...fmu.model import Model, Value, check_value, read_model
from ...game.graphs import CommunicationGraph
from ...version import package_version
from ..designs import DesignError, Range, initial_states, sample
from ..sampler import Settings
from ..sampling import Sampling
from ..worker import Case

LARGEST_SWEEP = 10_000_000
INITIAL_ACTIONS = Range(-10.0, 10.0)


@dataclass(frozen=True)
class Sweep:
    """Definition of a sweep over one FMU. A name without indices stands for all variables of that kind.

    Raises VariableError for names and values that the FMU does not take, GraphError for graphs that it does
    not take, DesignError for a design that makes no sense, ModelError for an FMU that cannot be read.
    """

    fmu: GameSource  # or a game, as Simulator takes
    fixed: Mapping[str, Value] = field(default_factory=dict)  # start values of every row
    grid: Mapping[str, tuple[Value, ...]] = field(default_factory=dict)  # all combinations
    ranges: Mapping[str, Range] = field(default_factory=dict)  # `samples` points drawn from them
    samples: int = 0
    sampling: Sampling = Sampling.LATIN_HYPERCUBE
    graphs: tuple[CommunicationGraph, ...] = ()  # none: the game's own
    initial_states: int = 0  # none: the game's own
    initial_actions: Range = INITIAL_ACTIONS  # of every random x0[i,l]
    initial_velocities: Range | None = None  # of every random v0[i,l]; None: the game's own
    seed: int = 0
    settings: Settings = field(default_factory=Settings)
    neighbourhood: float | None = None  # the final error that no row may exceed

    def __post_init__(self) -> None:
        _ = self.model
        if self.seed < 0:
            raise DesignError(f"seed = {self.seed} is negative")
        if bool(self.ranges) != bool(self.samples):
            raise DesignError("ranges need a number of samples, and samples need ranges")
        if self.neighbourhood is not None and not self.neighbourhood > 0.0:
            raise DesignError(f"neighbourhood = {self.neighbourhood:g} is not positive")
        if self.rows > LARGEST_SWEEP:
            raise DesignError(f"the sweep has {self.rows} rows, more than {LARGEST_SWEEP}")
        for name, values in self.grid.items():
            if not values:
                raise DesignError(f"the grid of {name} is empty")
        self._check_names()
        for graph in self.graphs:
            graph.start_values(self.model)
        _ = self._points, self._states

    def _check_names(self) -> None:
        taken: dict[str, str] = {}
        for name, values in self._axes().items():
            for single in self._names(name):
                if single in taken:
                    raise DesignError(f"{single} is set by both {taken[single]} and {name}")
                taken[single] = name
                for value in values:
                    check_value(self.model.variable(single), value)
        clashes = {"a": bool(self.graphs), "x0": self._random, "v0": self._random and self.initial_velocities}
        for single, axis in taken.items():
            if clashes.get(single.partition("[")[0]):
                raise DesignError(f"{axis} is set twice: it also follows from the graphs or initial states")

    def _axes(self) -> dict[str, tuple[Value, ...]]:
        """Every named axis with the values that its check needs: of ranges the two ends."""
        axes: dict[str, tuple[Value, ...]] = {name: (value,) for name, value in self.fixed.items()}
        for name, values in [*self.grid.items(), *((n, (r.low, r.high)) for n, r in self.ranges.items())]:
            if name in axes:
                raise DesignError(f"{name} is set twice")
            axes[name] = values
        return axes

    @property
    def _random(self) -> bool:
        return self.initial_states > 0

    @cached_property
    def model(self) -> Model:
        """The FMU's own account of its game."""
        return read_model(self.fmu)

    @cached_property
    def shape(self) -> tuple[int, ...]:
        """Lengths of the axes: graphs, initial states, samples, then every grid; the last runs fastest."""
        head = (len(self.graphs), self.initial_states, self.samples)
        return (*(max(1, length) for length in head), *map(len, self.grid.values()))

    @property
    def rows(self) -> int:
        """Number of runs."""
        return prod(self.shape)

    @property
    def varied(self) -> tuple[str, ...]:
        """Names of the table's columns that tell what was varied by a parameter."""
        return (*self.ranges, *self.grid)

    @cached_property
    def _points(self) -> NDArray[np.float64]:
        if not self.ranges:
            return np.empty((1, 0))
        return sample(self.ranges, self.samples, self.sampling, self.seed)

    @cached_property
    def _states(self) -> list[dict[str, float]]:
        if not self._random:
            return [{}]
        model, count = self.model, self.initial_states
        size = (model.players, model.dimension, self.seed)
        states: list[dict[str, float]] = [{} for _ in range(count)]
        boxes = {"x0": (self.initial_actions, 2), "v0": (self.initial_velocities, 3)}
        for stem, (box, stream) in boxes.items():
            if box is not None:
                drawn = initial_states(count, box, *size, stream=stream)
                for state, entries in zip(states, drawn, strict=True):
                    named = model.indexed(stem).items()
                    state |= {variable.name: float(entries[i - 1, k - 1]) for (i, k), variable in named}
        return states

    def case(self, row: int) -> Case:
        """The run of a row."""
        graph, state, _, values = self._row(row)
        start: dict[str, Value] = {**self._expanded(self.fixed), **self._states[state]}
        if self.graphs:
            start |= self.graphs[graph].start_values(self.model)
        return Case(row, start | self._expanded(values))

    def describe(self, row: int) -> dict[str, Any]:
        """What the table tells about a row, by column: the graph, the drawn values, the grid values."""
        graph, state, point, values = self._row(row)
        cells: dict[str, Any] = {"row": row}
        if self.graphs:
            chosen = self.graphs[graph]
            cells["graph"] = chosen.label
            cells["graph_edges"] = len(chosen.edges)
            cells["graph_connectivity"] = chosen.algebraic_connectivity
        if self.initial_states:
            cells["initial_state"] = state
            cells |= self._states[state]
        if self.ranges:
            cells["sample"] = point
        return cells | values

    def varies(self, column: str) -> bool:
        """Whether a column that describe fills has two different values in the table, or more."""
        first = self.describe(0)[column]
        for axis, length in enumerate(self.shape):
            for k in range(1, length):
                index = [k if each == axis else 0 for each in range(len(self.shape))]
                if self.describe(int(np.ravel_multi_index(index, self.shape)))[column] != first:
                    return True
        return False

    def _row(self, row: int) -> tuple[int, int, int, dict[str, Value]]:
        indices: list[int] = []  # as numpy.unravel_index has them
        for length in reversed(self.shape):
            row, index = divmod(row, length)
            indices.insert(0, index)
        graph, state, point, *indices = indices
        values: dict[str, Value] = dict(zip(self.ranges, self._points[point].tolist(), strict=True))
        for (name, axis), index in zip(self.grid.items(), indices, strict=True):
            values[name] = axis[index] if isinstance(axis[index], bool) else float(axis[index])
        return graph, state, point, values

    def _expanded(self, values: Mapping[str, Value]) -> dict[str, Value]:
        return {single: value for name, value in values.items() for single in self._names(name)}

    def _names(self, name: str) -> tuple[str, ...]:
        held = self._name_cache.get(name)
        if held is None:
            held = tuple(variable.name for variable in self.model.select([name]))
            self._name_cache[name] = held
        return held

    @cached_property
    def _name_cache(self) -> dict[str, tuple[str, ...]]:
        return {}

    def as_json(self) -> dict[str, Any]:
        """The definition as plain values, without the FMU's place on this machine."""
        data = {name: getattr(self, name) for name in self.__dataclass_fields__ if name != "fmu"}
        data |= {
            "fixed": dict(self.fixed),
            "grid": {name: list(values) for name, values in self.grid.items()},
            "ranges": {name: asdict(each) for name, each in self.ranges.items()},
            "graphs": [graph.label for graph in self.graphs],
            "initial_actions": asdict(self.initial_actions),
            "initial_velocities": self.initial_velocities and asdict(self.initial_velocities),
            "settings": asdict(self.settings),
        }
        return data

    @cached_property
    def provenance(self) -> dict[str, Any]:
        """Package version, FMU (GUID and fingerprint), definition and what was drawn: they fix every row."""
        return {
            "package_version": package_version(),
            "guid": self.model.guid,
            "fmu": hashlib.sha256(self.model.path.read_bytes()).hexdigest(),
            "title": self.model.title,
            "seed": self.seed,
            "changed": self._expanded(self.fixed),
            "definition": self.as_json(),
            "drawn": hashlib.sha256(
                self._points.tobytes() + json.dumps(self._states, sort_keys=True).encode()
            ).hexdigest(),
        }

    @cached_property
    def fingerprint(self) -> str:
        """Of the provenance; equal fingerprints mean equal rows."""
        text = json.dumps(self.provenance, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()
