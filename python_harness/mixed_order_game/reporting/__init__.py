"""Reports: one self-contained HTML page about a game or a run.

>>> from mixed_order_game.reporting.page import report
>>> report("MixedOrderGame.fmu", "report.html").passed
"""
