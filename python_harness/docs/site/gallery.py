"""The gallery: a page for each game of the package, with its text, figures of a run, x* and its file."""

import re
from pathlib import Path

from mixed_order_game import Model, read_model, run
from mixed_order_game.fmu.build import DEFAULT_GAME, shipped_games
from mixed_order_game.game.equilibrium import judge_equilibrium
from mixed_order_game.results.plot import result_figures, save_figure

FIRST = ("plane", "positions")
"""The figure that stands for a game in the overview: the first of these that it has."""


def write_gallery(folder: Path) -> None:
    """Run every game and write its page and figures, and an overview."""
    folder.mkdir(parents=True)
    overview = ["# Gallery", "", "Every game of the package, run as its file has it.", ""]
    shipped = shipped_games()
    games = dict(
        sorted(shipped.items(), key=lambda game: game[0] != DEFAULT_GAME)
    )  # the paper's example first
    for name, file in games.items():
        model = read_model(file)
        figures = result_figures(run(file))
        for kind, axes in figures.items():
            save_figure(axes, folder / f"{name}_{kind}.png")
        (folder / f"{name}.md").write_text(page(name, file, model, list(figures)), encoding="utf-8")
        picture = next(kind for kind in FIRST if kind in figures)
        overview += figure(f"{name}_{picture}", f"[{model.title}]({name}.md): {sizes(model)}")
    contents = ["```{toctree}", ":hidden:", "", *games, "```"]
    (folder / "index.md").write_text("\n".join([*overview, *contents]) + "\n", encoding="utf-8")


def page(name: str, file: Path, model: Model, kinds: list[str]) -> str:
    """The page of one game, as Markdown."""
    head, definition = split(file.read_text(encoding="utf-8"))
    equilibrium = judge_equilibrium(file)
    lines = [
        f"# {model.title}",
        "",
        f"{sizes(model)}{f': {equilibrium.sentence}' if equilibrium else '.'}",
        "",
    ]
    lines += ["```console", f"mog run {name}", f"mog report {name} --output {name}.html", "```", ""]
    lines += [prose(head), ""]
    for kind in kinds:
        lines += figure(f"{name}_{kind}", kind.capitalize())
    return "\n".join([*lines, "## Its file", "", "```toml", definition.rstrip(), "```"]) + "\n"


def figure(name: str, caption: str) -> list[str]:
    """A figure, as Markdown; two stand side by side where there is room."""
    return [f"```{{figure}} {name}.png", ":figclass: gallery", f":alt: {name}", caption, "```", ""]


def sizes(model: Model) -> str:
    """As in "5 players, 3 of first and 2 of second order, in 2 coordinates"."""
    first, second = (list(model.order).count(order) for order in (1, 2))
    kinds = f"{first} of first and {second} of second order"
    orders = kinds if first and second else "all of first order" if first else "all of second order"
    return f"{model.players} players, {orders}, in {model.dimension} coordinate{'s' * (model.dimension > 1)}"


def split(text: str) -> tuple[str, str]:
    """The comment that a game file begins with, and the rest."""
    head = re.match(r"(#.*\n)*", text)
    end = 0 if head is None else head.end()
    return re.sub(r"^# ?", "", text[:end], flags=re.MULTILINE), text[end:].lstrip()


def prose(text: str) -> str:
    """Plain text as Markdown; indented lines, which are formulas, stay as they are."""
    return "\n".join(
        line if line.startswith("    ") else re.sub(r"([*_<\[\\`|])", r"\\\1", line)
        for line in text.splitlines()
    )
