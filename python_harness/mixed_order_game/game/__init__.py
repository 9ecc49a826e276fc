"""Game files: read, made from a recipe, checked with line numbers, described by a JSON Schema for editors.

>>> from mixed_order_game.game.check import check_game
>>> from mixed_order_game.game.new import Recipe, new_game
>>> text = new_game(Recipe(players=4, dimension=1, graph="path", seed=7))
>>> check_game("my_game.toml")  # problems, each with its line; empty if the game is valid
"""
