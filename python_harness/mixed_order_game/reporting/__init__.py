"""Reports: one self-contained HTML page about a game or a run.

>>> from mixed_order_game.reporting.page import report
>>> report("MixedOrderGame.fmu", "report.html").passed
"""

from ..extras import need

for package in ("latex2mathml", "matplotlib"):  # the second for colours and bounds of figures
    need(package)
