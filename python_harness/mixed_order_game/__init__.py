"""Distributed Nash equilibrium seeking for mixed-order games, as an FMU.

>>> import mixed_order_game as mog
>>> result = mog.run("five_vehicles", start_values={"k1": 12.0})
>>> result.x.shape  # time, player, coordinate
(1001, 5, 2)

The names stand in __init__.pyi; each is imported when it is first used. The figures are in
mixed_order_game.results.plot, the command is mog.
"""

import logging

import lazy_loader

logging.getLogger(__name__).addHandler(logging.NullHandler())

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
