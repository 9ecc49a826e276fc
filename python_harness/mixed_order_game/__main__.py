"""python -m mixed_order_game is the command mog."""

from .cli import main

main()
