"""A game's parts, one FMU for each group of players, coupled by a master that exchanges once a period."""

from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import ExitStack
from itertools import pairwise
from types import TracebackType
from typing import Self

import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import fmi2True
from numpy.typing import NDArray

from ..errors import GameError, SimulationError
from ..files.temporary import temporary_folder
from ..game.parts import part_of_game, toml_of_game
from ..interrupts import noted_signals
from .build import GameSource, cached_fmu, native_library
from .model import Model, Value, check_value, read_model
from .reals import Reals
from .run import Simulator

FloatArray = NDArray[np.float64]


class Coupled:
    """The parts of a game, loaded once and run with any period. Use it in a with statement.

    All parts take a step of one period at a time, then each is told what the others' outputs are, which it
    holds over its next step (the scheme of Jacobi): what is heard is one period old at a step's end.
    groups: 1-based players of each part, each player in one of them; one part a player when None.
    Raises ModelError for a game that waits for signals from outside, GameError for other groups, and what
    making and loading FMUs raises.
    """

    def __init__(self, game: GameSource = None, groups: Sequence[Collection[int]] | None = None) -> None:
        self.model: Model = read_model(game)
        self.model.require_all_players()
        self.model.require_plants()
        self.groups = groups_of(self.model.players, groups)
        with ExitStack() as stack, temporary_folder(SimulationError) as folder:
            parts = []
            for number, group in enumerate(self.groups):
                file = folder / f"part{number}.toml"
                file.write_text(toml_of_game(part_of_game(self.model.game, group)), encoding="utf-8")
                parts.append(stack.enter_context(_Part(cached_fmu(file))))
            self._stack = stack.pop_all()
        self._parts = parts
        place = {name: k for k, name in enumerate(name for part in parts for name in part.outputs)}
        self._heard = [np.array([place[name] for name in part.inputs], dtype=np.intp) for part in parts]
        actions = sorted(self.model.indexed("x"))
        self._actions = np.array([place[f"x[{i},{k}]"] for i, k in actions], dtype=np.intp)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.close()

    def run(
        self,
        time: FloatArray,
        *,
        start_values: Mapping[str, Value] | None = None,
        tolerance: float = 1e-6,
        progress: Callable[[float], object] | None = None,
    ) -> FloatArray:
        """Actions (T, N, D) at times (T,), in s, between which nobody talks.

        Raises VariableError for a value that the game would not take, SimulationError when an FMU gives up,
        with the time.
        """
        values = self.model.expanded(start_values or {})
        checked = {name: check_value(self.model.variable(name), value) for name, value in values.items()}
        points = time.tolist()
        actions = np.empty((len(points), len(self._actions)))
        now = points[0]
        try:
            with noted_signals() as take_signals:
                for part in self._parts:
                    part.initialize(checked, points, tolerance)
                told = self._exchange()
                for part in self._parts:
                    part.begin()
                actions[0] = told[self._actions]
                for k, (now, after) in enumerate(pairwise(points), 1):
                    take_signals()
                    for part in self._parts:
                        part.step(now, after - now)
                    told = self._exchange()
                    actions[k] = told[self._actions]
                    if progress is not None:
                        progress(after)
        except FMICallException as error:
            said = next((said for part in self._parts if (said := part.said())), str(error))
            raise SimulationError(said) from error
        return actions.reshape(len(points), self.model.players, self.model.dimension)

    def _exchange(self) -> FloatArray:
        """Tell each part what it hears; all outputs."""
        told = np.concatenate([part.read() for part in self._parts])
        for part, heard in zip(self._parts, self._heard, strict=True):
            part.tell(told[heard])
        return told


def groups_of(players: int, groups: Sequence[Collection[int]] | None) -> tuple[tuple[int, ...], ...]:
    """Groups of 1-based players, one for each player when None. Raises GameError unless each is in one."""
    if groups is None:
        return tuple((number,) for number in range(1, players + 1))
    chosen = tuple(tuple(sorted(set(group))) for group in groups)
    if sorted(number for group in chosen for number in group) != list(range(1, players + 1)):
        raise GameError(
            f"the groups are {[list(group) for group in chosen]}, expected each player from 1 to {players} "
            "in one of them"
        )
    return chosen


class _Part(Simulator):
    """The FMU of some players, stepped by hand."""

    _holds_all_players = False

    def __init__(self, fmu: GameSource) -> None:
        # the one file from which all of them were made: loaded once, processors keep its code in their caches
        self._library = native_library()
        super().__init__(fmu)
        variables = self.model.variables.values()
        self.inputs = [
            each.name
            for each in variables
            if each.causality == "input" and not each.name.startswith("d_ext[")
        ]
        self.outputs = [each.name for each in variables if each.causality == "output"]
        self._told, self._read = (
            Reals([self.model.variable(name).reference for name in names])
            for names in (self.inputs, self.outputs)
        )

    def initialize(self, values: Mapping[str, Value], time: Sequence[float], tolerance: float) -> None:
        """Enter initialization mode with those of the values that it has."""
        own = {name: value for name, value in values.items() if name in self.model.variables}
        self._initialize(own, time, tolerance)

    def begin(self) -> None:
        """Leave initialization mode."""
        self._slave.exitInitializationMode()

    def tell(self, values: FloatArray) -> None:
        """Set the inputs."""
        self._told.tell(self._slave, values)

    def read(self) -> FloatArray:
        """The outputs."""
        return self._read.read(self._slave)

    def step(self, time: float, h: float) -> None:
        """Take one step."""
        self._slave.fmi2DoStep(self._slave.component, time, h, fmi2True)

    def said(self) -> str:
        """The last error that it logged, if any."""
        return self._said()
