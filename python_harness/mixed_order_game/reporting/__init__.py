"""Reports: one self-contained HTML page about a game or a run.

>>> from mixed_order_game.reporting import report
>>> report("MixedOrderGame.fmu", "report.html").passed
"""

from .evidence import Evidence, evidence_of_game, evidence_of_result
from .page import render_page, report

__all__ = [
    "Evidence",
    "evidence_of_game",
    "evidence_of_result",
    "render_page",
    "report",
]
