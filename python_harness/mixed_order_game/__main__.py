"""python -m mixed_order_game is the command mog."""

from .cli.app import main

main()
