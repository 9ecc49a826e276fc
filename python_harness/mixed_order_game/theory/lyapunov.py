"""P and Q of the Lyapunov equation M'P + P M = Q for M = L (x) I + A_0, and the best choice of them.

The paper prints P M + M P = Q, which is the same for an undirected graph, where M is symmetric.

The choice made everywhere in this package is P = p I, Q = p (M + M'). For symmetric M, Q = 2 p M, it is the
best one: with v the unit eigenvector of M to its smallest eigenvalue,

    lambda_min(Q) <= v'Q v = 2 lambda_min(M) v'P v <= 2 lambda_min(M) ||P||,

with equality for P = p I, and the proofs use P only through ||P|| = lambda_max(P) and lambda_min(Q) (and,
for the size of the sublevel sets, lambda_min(P), for which P = p I has the largest value too). Only the
number p is left to choose; each certificate does so for itself. The solution for Q = I, P = M^-1 / 2, reaches
the same ratio but has a smaller lambda_min(P). Of a directed graph M + M' may have a negative eigenvalue
although all modes of M decay; then P = p I proves nothing, and the analysis says so.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_continuous_lyapunov

from .graph import consensus_blocks

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class LyapunovPair:
    """What the proofs need of P and Q. P is dimensionless, Q has the unit of the edge weights."""

    smallest_P: float  # lambda_min(P)
    largest_P: float  # lambda_max(P) = ||P||
    smallest_Q: float  # lambda_min(Q)


def scaled_identity(consensus_rate: float, scale: float) -> LyapunovPair:
    """P = p I, Q = p (M + M'). consensus_rate is lambda_min((M + M') / 2), scale is p > 0."""
    return LyapunovPair(scale, scale, 2.0 * scale * consensus_rate)


def identity_right_side(adjacency: FloatArray) -> tuple[FloatArray, LyapunovPair]:
    """The solution for Q = I: blocks P_j of M_j'P_j + P_j M_j = I, (N, N, N), and its constants.

    M_j = L + diag(a_.j); for symmetric M_j, P_j = M_j^-1 / 2.
    Raises numpy.linalg.LinAlgError if the graph leaves a block singular.
    """
    M = consensus_blocks(adjacency)
    if np.array_equal(adjacency, adjacency.T):
        blocks = np.asarray(0.5 * np.linalg.inv(M))
    else:
        blocks = np.array([solve_continuous_lyapunov(block.T, np.eye(len(block))) for block in M])
    eigenvalues = np.linalg.eigvalsh(blocks)
    return blocks, LyapunovPair(float(eigenvalues.min()), float(eigenvalues.max()), 1.0)
