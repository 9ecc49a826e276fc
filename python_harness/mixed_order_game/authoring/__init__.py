"""Game files: made from a recipe, checked with line numbers, described by a JSON Schema for editors.

>>> from mixed_order_game.authoring import Recipe, check_game, new_game
>>> text = new_game(Recipe(players=4, dimension=1, graph="path", seed=7))
>>> check_game("my_game.toml")  # problems, each with its line; empty if the game is valid
"""

from .check_game import Problem, check_game
from .new_game import Recipe, new_game
from .schema import game_schema, schema_path

__all__ = [
    "Problem",
    "Recipe",
    "check_game",
    "game_schema",
    "new_game",
    "schema_path",
]
