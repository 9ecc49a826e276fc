"""Are the gains good for the graph? What the paper's theorems guarantee, what holds, and what a run shows.

>>> from mixed_order_game.theory.analysis import analyse
>>> found = analyse("my_game.toml", simulation=False)
>>> found.exact.stable, found.value("theorem 2", "k3*")
"""
