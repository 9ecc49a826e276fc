"""A game as an object: read, changed, written, built and run."""

from collections.abc import Callable, Mapping
from copy import deepcopy
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tomlkit
from tomlkit.exceptions import TOMLKitError

from ..errors import GameError, MissingEntryError
from ..extras import need
from ..files.reading import ReadError, expect_file, read_text
from ..files.temporary import temporary_folder
from ..files.writing import GAME, write_file
from ..fmu.build import build_fmu, cached_fmu, game_file
from ..fmu.model import Model, read_model
from ..fmu.run import run
from ..notebook import folded, page, paragraph, table
from ..results.result import MOST_SHOWN, Result
from .check import Problem, check_game
from .symbols import text_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Expression = str | Callable[..., Any]
"""A text of the game files' language, or a function that SymPy's symbols are given to."""


class Game:
    """A game definition, as its file has it: tables, lists and numbers that may be changed at will.

    What is written keeps the comments and the order of the file that was read. Whether the game is valid is
    judged when it is built; check() tells what is wrong. Every function that takes a game takes one of these.

    Parameters
    ----------
    source
        A game file (.toml), a game of the package by its name, or tables; the paper's example when left out.

    Raises
    ------
    GameError
        For a file that is missing (a FileNotFoundError, too) or no TOML.

    Examples
    --------
    >>> game = mog.Game("five_vehicles")
    >>> game["gains"]["k1"] = 12.0
    >>> game.player(2)["x0"] = [1.0, -1.0]
    >>> game.set_cost(1, "(x[1,1] - 3)^2 + x[1,2]^2 + x[1,1] * x[2,1]")
    >>> game.run(stop_time=0.1).x[0, 1].tolist()
    [1.0, -1.0]
    >>> game.write("changed.toml").name
    'changed.toml'
    """

    def __init__(self, source: Path | str | Mapping[str, Any] | None = None) -> None:
        if not isinstance(source, Mapping):
            source = game_file(source)
            expect_file(source, "game file", GameError)
        try:
            text = tomlkit.dumps(source) if isinstance(source, Mapping) else read_text(source)
            self._document = tomlkit.parse(text)
        except (ReadError, TOMLKitError, TypeError, ValueError) as error:
            raise GameError(f"{'the tables' if isinstance(source, Mapping) else source}: {error}") from error

    def __repr__(self) -> str:
        return f"<Game {self.get('title', 'without a title')}: {len(self.get('player', []))} players>"

    def __getitem__(self, key: str) -> Any:
        """A table or value of the file by its key. Raises GameError if there is none."""
        if key not in self._document:
            raise MissingEntryError(f"the game has no {key}; it has {', '.join(self._document)}")
        return self._document[key]

    def __setitem__(self, key: str, value: Any) -> None:
        self._document[key] = value

    def __delitem__(self, key: str) -> None:
        self[key]
        del self._document[key]

    def __contains__(self, key: object) -> bool:
        return key in self._document

    def get(self, key: str, default: Any = None) -> Any:
        """A table or value of the file by its key, else the default."""
        return self._document.get(key, default)

    def player(self, number: int) -> Any:
        """The table of a player, counted from 1. Raises GameError if there is none."""
        players = self["player"]
        if not 1 <= number <= len(players):
            raise MissingEntryError(f"there is no player {number}: the game has {len(players)}")
        return players[number - 1]

    def set_cost(self, number: int, cost: Expression) -> None:
        """Let an expression be the whole cost of a player: a text, or a function of symbols.

        The function gets x and returns a SymPy expression of x[i, l], which counts from 1: lambda x:
        (x[1, 1] - 3) ** 2. Raises MissingPackageError where that is given without SymPy, GameError for a
        function that the language has not.
        """
        self.player(number)["cost"] = {"expression": cost if isinstance(cost, str) else text_of(cost)}

    def copy(self) -> "Game":
        """Another one, to be changed by itself."""
        return deepcopy(self)

    def text(self) -> str:
        """The game file."""
        return tomlkit.dumps(self._document)

    def write(self, path: Path | str, *, force: bool = False) -> Path:
        """Write the game file (.toml); only force replaces a file that exists. Returns its path."""
        text = self.text()
        return write_file(Path(path), GAME, lambda file: file.write(text.encode()), force=force)

    def check(self) -> tuple[Problem, ...]:
        """What is wrong with it; lines and columns are those of text()."""
        with temporary_folder(GameError) as folder:
            return check_game(self._written(folder))

    def build(self, output: Path | str | None = None, *, force: bool = False) -> Path:
        """Make its FMU; where no output is named, in the user's cache folder. Raises as build_fmu does."""
        with temporary_folder(GameError) as folder:
            game = self._written(folder)
            try:
                return cached_fmu(game) if output is None else build_fmu(game, Path(output), force=force)
            except GameError as error:  # of a file that the caller knows nothing of
                raise GameError(str(error).replace(str(game), "the game")) from None

    def plot(self, axes: "Axes | None" = None, *, width: float = 3.5) -> "Axes":
        """Draw the communication graph.

        Parameters, what is returned and the need of Matplotlib are as for `Result.plot`.

        Raises
        ------
        GameError
            For a game that breaks the definition of one.
        """
        need("matplotlib")
        from ..results.plot import plot_graph

        model = self.model()
        return plot_graph(model.edges, model.order, axes, directed=model.directed, width=width)

    def _repr_html_(self) -> str:
        """For notebooks: the players, and folded the game file."""
        from html import escape

        rows = [
            (str(i), str(player.get("name", "")), str(player.get("order", "")), str(player.get("x0", "")))
            for i, player in enumerate(self.get("player", []), start=1)
        ]
        players = table(["player", "name", "order", "x0"], rows[:MOST_SHOWN])
        more = [paragraph(f"and {len(rows) - MOST_SHOWN} more")] if len(rows) > MOST_SHOWN else []
        return page(
            repr(self)[1:-1], players, *more, folded("Game file", f"<pre>{escape(self.text())}</pre>")
        )

    def model(self) -> Model:
        """What its FMU says of itself. Raises as build does."""
        return read_model(self.build())

    def run(self, **options: Any) -> Result:
        """Run it once, with the options of mixed_order_game.run. Raises as build and run do."""
        return run(self.build(), **options)

    def _written(self, folder: Path) -> Path:
        path = folder / "game.toml"
        path.write_text(self.text(), encoding="utf-8")
        return path
