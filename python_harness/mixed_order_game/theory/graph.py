"""The matrix of the estimates, M = L (x) I + A_0 of the paper, by its N blocks."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def laplacian(adjacency: FloatArray) -> FloatArray:
    """L = diag(sum_j a_ij) - A, (N, N), of the adjacency matrix A (N, N)."""
    return np.asarray(np.diag(adjacency.sum(axis=1)) - adjacency)


def consensus_blocks(adjacency: FloatArray) -> FloatArray:
    """The blocks L + diag(a_1j, ..., a_Nj), (N, N, N); block j governs all estimates of player j's action.

    Sorting the entries y_ij by j instead of by i turns L (x) I + A_0 into the block diagonal matrix of
    these, because (L (x) I) couples only estimates of the same player and A_0 is diagonal. So an N^2 x N^2
    problem is N problems of size N.
    """
    return np.asarray(laplacian(adjacency) + np.array([np.diag(column) for column in adjacency.T]))


def consensus_eigenvalues(adjacency: FloatArray) -> FloatArray:
    """Eigenvalues of each block in increasing order, (N, N), row j for block j, in units of the edge weights.

    Together they are the eigenvalues of M = L (x) I + A_0. All are positive exactly if every component of the
    graph holds a neighbour of every player; for a connected graph (the paper's Assumption 2) they are. For a
    directed graph they are those of the symmetric part (M + M') / 2, which may be negative: with P = p I the
    proofs need M only through M'P + P M = p (M + M').
    """
    blocks = consensus_blocks(adjacency)
    return np.asarray(np.linalg.eigvalsh(0.5 * (blocks + blocks.transpose(0, 2, 1))))


def consensus_norm(adjacency: FloatArray) -> float:
    """||L (x) I + A_0||, in units of the edge weights."""
    return float(np.linalg.norm(consensus_blocks(adjacency), 2, axis=(1, 2)).max())


def is_connected(adjacency: FloatArray) -> bool:
    """Whether the graph with these edge weights (N, N) is (strongly) connected (the paper's Assumption 2)."""
    return not unreached(adjacency)


def unreached(adjacency: FloatArray) -> list[int]:
    """Players, 0-based, to which no path leads from player 0, or from which none leads to it.

    adjacency (N, N) holds the edge weights.
    """

    def reached(heard: FloatArray) -> NDArray[np.bool_]:
        found = np.zeros(len(heard), dtype=bool)
        found[0] = True
        for _ in range(len(heard)):
            found |= heard[found].any(axis=0)
        return found

    return np.flatnonzero(~(reached(adjacency) & reached(adjacency.T))).tolist()
