"""What the shell completes: games and files, variables of a game, kinds of graphs."""

from collections.abc import Iterable, Iterator
from pathlib import Path

import typer

from ..errors import MixedOrderGameError
from ..game.graph_kinds import GRAPH_KINDS

FMU_SUFFIXES, GAME_SUFFIXES, RESULT_SUFFIXES = (".fmu",), (".toml",), (".parquet", ".csv")


def complete_game(incomplete: str) -> list[str]:
    """Games of the package, game files and FMUs."""
    return _named(incomplete, (*GAME_SUFFIXES, *FMU_SUFFIXES))


def complete_game_file(incomplete: str) -> list[str]:
    """Games of the package and game files."""
    return _named(incomplete, GAME_SUFFIXES)


def complete_source(incomplete: str) -> list[str]:
    """Games of the package, game files, FMUs and results."""
    return _named(incomplete, (*GAME_SUFFIXES, *FMU_SUFFIXES, *RESULT_SUFFIXES))


def complete_setting(context: typer.Context, incomplete: str) -> list[str]:
    """NAME= of what can be set before a run; a name without indices stands for all of its kind."""
    return [f"{name}=" for name in _variables(context, settable=True) if name.startswith(incomplete)]


def complete_variables(context: typer.Context, incomplete: str) -> list[str]:
    """The last of several variables to record, separated by commas."""
    between = [k for k, c in enumerate(incomplete) if c == "," and _closed(incomplete[:k])]
    begun = between[-1] + 1 if between else 0
    before, last = incomplete[:begun], incomplete[begun:]
    return [before + name for name in _variables(context, settable=False) if name.startswith(last)]


def _closed(text: str) -> bool:
    """Whether no bracket is open: commas inside brackets belong to names."""
    return text.count("[") == text.count("]")


def complete_graphs(incomplete: str) -> list[str]:
    """Kinds of graphs."""
    return [kind for kind in GRAPH_KINDS if kind.startswith(incomplete)]


def complete_kind(incomplete: str) -> list[str]:
    """Kinds of figures."""
    from ..extras import has

    if not has("matplotlib"):
        return []
    from ..results.plot import KINDS

    return [kind for kind in KINDS if kind.startswith(incomplete)]


def _named(incomplete: str, suffixes: Iterable[str]) -> list[str]:
    from ..fmu.build import shipped_games

    try:
        names = [name for name in shipped_games() if name.startswith(incomplete)]
    except MixedOrderGameError:  # of an installation without games
        names = []
    return names + sorted(_files(incomplete, tuple(suffixes)))


def _files(incomplete: str, suffixes: tuple[str, ...]) -> Iterator[str]:
    begun = Path(incomplete)
    folder = begun if incomplete.endswith("/") or not incomplete else begun.parent
    stem = "" if folder == begun else begun.name
    try:
        found = [path for path in folder.iterdir() if path.name.startswith(stem) and path.name[0] != "."]
    except OSError:
        return
    for path in found:
        if path.is_dir():
            yield f"{path}/"
        elif path.suffix.lower() in suffixes:
            yield str(path)


def _variables(context: typer.Context, *, settable: bool) -> list[str]:
    """Kinds of variables of the game that the command line names so far, then the variables themselves."""
    from ..fmu.model import read_model
    from ..names import parse_name

    given = context.params.get("game") or next(iter(context.args), None)  # of a line not yet whole
    try:
        model = read_model(given)
    except MixedOrderGameError:
        return []
    names = [each.name for each in model.variables.values() if each.settable_before_start or not settable]
    return list(dict.fromkeys([*(parse_name(name)[0] for name in names), *names]))
