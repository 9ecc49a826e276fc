"""An FMU that shows its estimates, for what needs them of a game whose file asks for outputs alone."""

from pathlib import Path

from ..errors import BuildError
from ..files.reading import read_text, toml_of
from ..files.temporary import temporary_folder
from ..game.host_tool import file_of
from ..game.parts import toml_of_game
from .build import cached_fmu


def fmu_with_estimates(fmu: Path) -> Path:
    """The FMU, or one of the same game with estimates, weights and rates where its file hides them.

    Of a game that is too large to show them unless its file asks for it, the one returned hides them, too.
    Raises as cached_fmu does.
    """
    with file_of(fmu) as file:
        tables = toml_of(read_text(file))
    if tables.get("expose") != "outputs":
        return fmu
    with temporary_folder(BuildError) as folder:
        game = folder / "game.toml"
        shown = {key: value for key, value in tables.items() if key != "expose"}
        game.write_text(toml_of_game(shown), encoding="utf-8")
        return cached_fmu(game)
