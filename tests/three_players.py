"""The head of a game file for three players; tests add parameters and players."""


def head(*, k3: float = 50.0, delta: float = 2.0, epsilon: float = 0.5, weight: float = 0.5) -> str:
    """All tables before them, with this weight of edge 2-3."""
    return f"""
title = "Three players"
dimension = 1
[gains]
k1 = 10.0
k2 = 1.0
k3 = {k3}
k4 = 20.0
beta = 5.0
delta = {delta}
epsilon = {epsilon}
[rbf]
centers = [-1.0, 0.0, 1.0, 2.0]
width = 5.0
W_max = 1000.0
[graph]
edges = [[1, 2], [2, 3, {weight}], [3, 1]]
"""
