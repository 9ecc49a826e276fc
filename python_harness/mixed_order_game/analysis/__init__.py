"""Are the gains good for the graph? What the paper's theorems guarantee, what holds, and what a run shows.

>>> from mixed_order_game.analysis import analyse
>>> found = analyse("my_game.toml", simulation=False)
>>> found.exact.stable, found.value("theorem 2", "k3*")
"""

from .analysis import analyse
from .certificate import Certificate, best_certificate, sufficient_gains, theorem_2_rate, theorem_2_thresholds
from .constants import DynamicsConstants, LoopConstants, dynamics_constants, loop_constants
from .design import Design, paper_design, sharper_design
from .exact_loop import ExactLoop, exact_ceiling, exact_loop, exact_threshold
from .findings import Analysis, Demonstration, Row
from .game import AnalysedGame, Gains, read_game
from .hypotheses import Hypothesis
from .rendering import print_analysis

__all__ = [
    "AnalysedGame",
    "Analysis",
    "Certificate",
    "Demonstration",
    "Design",
    "DynamicsConstants",
    "ExactLoop",
    "Gains",
    "Hypothesis",
    "LoopConstants",
    "Row",
    "analyse",
    "best_certificate",
    "dynamics_constants",
    "exact_ceiling",
    "exact_loop",
    "exact_threshold",
    "loop_constants",
    "paper_design",
    "print_analysis",
    "read_game",
    "sharper_design",
    "sufficient_gains",
    "theorem_2_rate",
    "theorem_2_thresholds",
]
