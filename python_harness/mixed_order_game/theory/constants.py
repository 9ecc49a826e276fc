"""Constants of the assumptions: monotonicity, Lipschitz constants, Hessian rows, norms of matrices.

Everything is that of one coordinate where coordinates do not interact: a matrix h (N, N) acting on D
coordinates alike is h (x) I_D and has the same norm.

Where costs have expressions the Jacobian of the gradients varies. Over a box it is a matrix h in the middle
plus one whose entries have bounds, and a norm is at most that of h plus that of these bounds: the mean values
of the Jacobian between two joint actions of the box lie within the same bounds, as the box is convex.
"""

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from ..game.bounds import GameBounds
from ..game.definition import require_coefficients
from ..game.parameters import GameParameters
from .graph import consensus_eigenvalues, consensus_norm, laplacian
from .spectrum import gradient_map, monotonicity_constant, nash_equilibrium

FloatArray = NDArray[np.float64]

ROUNDING = 1e-12
"""By what a ball may seem to exceed its box."""


@dataclass(frozen=True, eq=False)
class LoopConstants:
    """Constants of costs and graph. n of the N players are of order 1; f and s name the two groups.

    grad_i f_i(x) = sum_j h_ij x_j + l_i; B (N, N^2) is the map y -> [h_i y_i]_i of the estimates,
    E = 1_N (x) I (N^2, N), so that B E = h; M = L (x) I + A_0. Over a box h and B are those in the middle,
    of all N D actions, and `variation` bounds what the Jacobian differs from h by.
    """

    parameters: GameParameters
    h: FloatArray  # (N, N), the gradient map; (N D, N D) over a box
    variation: FloatArray  # of the same size, zero for quadratic costs
    monotonicity: float  # m of Assumption 3
    lipschitz: FloatArray  # (N,), l_i of Assumption 1
    eigenvalues: FloatArray  # (N, N), of L + diag(a_.j), row j

    @property
    def players(self) -> int:
        """N."""
        return self.parameters.players

    def _rows(self, players: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Rows of h that belong to some of the players."""
        return np.repeat(players, len(self.h) // self.players)

    def _norm(self, players: NDArray[np.bool_]) -> float:
        """Largest norm of these players' rows."""
        rows = self._rows(players)
        return float(np.linalg.norm(self.h[rows], 2) + np.linalg.norm(self.variation[rows], 2))

    def _estimates_variation(self, players: NDArray[np.bool_]) -> float:
        """Bound of what B differs by from the one in the middle, of these players' rows."""
        blocks = self.variation.reshape(self.players, -1, len(self.h))[players]
        return float(np.linalg.norm(blocks, 2, axis=(1, 2)).max(initial=0.0))

    @property
    def dimension(self) -> int:
        """D."""
        return self.parameters.dimension

    @property
    def first(self) -> NDArray[np.bool_]:
        """(N,), true for players of order 1."""
        return self.parameters.first_order

    @property
    def first_players(self) -> int:
        """n."""
        return int(self.first.sum())

    @property
    def second_players(self) -> int:
        """N - n."""
        return self.players - self.first_players

    @property
    def slowest_consensus(self) -> float:
        """lambda_min(M); of a directed graph, where M is not symmetric, lambda_min((M + M') / 2)."""
        return float(self.eigenvalues.min())

    @property
    def fastest_consensus(self) -> float:
        """||M|| = lambda_max(M)."""
        if self.parameters.directed:
            return consensus_norm(self.parameters.adjacency)
        return float(self.eigenvalues.max())

    @property
    def largest_lipschitz(self) -> float:
        """max_i l_i = ||B||: B has one row h_i for each player and the rows act on different estimates."""
        return float(self.lipschitz.max())

    @property
    def pseudo_gradient_norm(self) -> float:
        """||h||, the Lipschitz constant of the pseudo-gradient; the paper bounds it by sqrt(N) max l_i."""
        return self._norm(np.ones(self.players, dtype=bool))

    @property
    def first_rows_norm(self) -> float:
        """||h_f||, Lipschitz constant of the rows of order 1; 0 if there are none."""
        return self._norm(self.first) if self.first_players else 0.0

    @property
    def second_rows_norm(self) -> float:
        """||h_s||, the same of the rows of order 2."""
        return self._norm(~self.first) if self.second_players else 0.0

    @property
    def first_lipschitz(self) -> float:
        """max of l_i over order 1, ||B_f||; 0 if there are none."""
        return float(self.lipschitz[self.first].max(initial=0.0))

    @property
    def hessian_norm(self) -> float:
        """||H_1|| = max of l_i over order 2: row i of H_1 holds player i's Hessian row, in its own columns.

        With D coordinates the row is h_i (x) I_D and the norm stays. 0 if there is no player of order 2.
        """
        return float(self.lipschitz[~self.first].max(initial=0.0))

    @property
    def paper_b(self) -> float:
        """b = sup ||H_1|| ||L (x) I + A_0|| of the paper, in units of the edge weights."""
        return self.hessian_norm * self.fastest_consensus

    @cached_property
    def exact_b(self) -> float:
        """||B_s M||, what b is a bound of: H_1 [y_i']_s = -k3 B_s M (y - 1 (x) xbar), not more.

        M'(e_i (x) h_i) = (L'e_i) (x) h_i + e_i (x) (a_i. o h_i), so each row costs N^2 numbers.
        """
        if not self.second_players:
            return 0.0
        A = self.parameters.adjacency
        L = laplacian(A)
        coordinates = len(self.h) // self.players
        rows = [
            (
                np.outer(L[i], self.h[row])
                + np.outer(np.eye(self.players)[i], np.repeat(A[i], coordinates) * self.h[row])
            ).ravel()
            for i in np.flatnonzero(~self.first)
            for row in range(i * coordinates, (i + 1) * coordinates)
        ]
        varying = self._estimates_variation(~self.first) * self.fastest_consensus
        return float(np.linalg.norm(np.array(rows), 2)) + varying

    @cached_property
    def estimate_pull(self) -> float:
        """max over |y| = 1 of y'E B y, at least 0; the paper's bound for it is sqrt(N) max l_i.

        E B has rank N. The nonzero eigenvalues of (X Y' + Y X') / 2 with X = E, Y = B' are those of
        [[Y'X, Y'Y], [X'X, X'Y]] / 2 = [[h, diag(l_i^2)], [N I, h']] / 2, of size 2 N.
        """
        N = self.players
        small = 0.5 * np.block([[self.h, self._squares], [N * np.eye(len(self.h)), self.h.T]])
        varying = math.sqrt(N) * self._estimates_variation(np.ones(N, dtype=bool))
        return max(0.0, float(np.linalg.eigvals(small).real.max()) + varying)

    def estimate_coupling(self, p: float) -> float:
        """||2 p E h - B'||, factor of k2 |y - 1 (x) xbar| |xbar - x*| in (V_1 + p |y - 1 (x) xbar|^2)'.

        Its square is the largest eigenvalue of diag(l_i^2) - 2 p (h h + (h h)') + 4 p^2 N h'h, since
        B B' = diag(l_i^2) and B E = h. The paper's bound is max l_i (1 + 2 p N).
        """
        hh = self.h @ self.h
        gram = self._squares - 2.0 * p * (hh + hh.T) + 4.0 * p * p * self.players * self.h.T @ self.h
        everyone = np.ones(self.players, dtype=bool)
        varying = self._estimates_variation(everyone)
        if varying > 0.0:
            varying += 2.0 * p * math.sqrt(self.players) * float(np.linalg.norm(self.variation, 2))
        return math.sqrt(max(0.0, float(np.linalg.eigvalsh(gram)[-1]))) + varying

    @cached_property
    def _squares(self) -> FloatArray:
        """B B': the rows of different players act on different estimates."""
        blocks = self.h.reshape(self.players, -1, len(self.h))
        return np.asarray(block_diag(*(block @ block.T for block in blocks)))


def loop_constants(parameters: GameParameters) -> LoopConstants:
    """Constants of a game with quadratic costs, or over the box of its bounds.

    l_i = ||h_i||: grad_i f_i(x) = (h_i (x) I_D) x + l_i, so this Lipschitz constant is the smallest one.
    """
    eigenvalues = consensus_eigenvalues(parameters.adjacency)
    bounds = parameters.bounds
    if bounds is not None:
        return LoopConstants(
            parameters=parameters,
            h=bounds.gradients.middle,
            variation=bounds.gradients.radius,
            monotonicity=bounds.monotonicity,
            lipschitz=bounds.gradients.lipschitz,
            eigenvalues=_without_rounding(eigenvalues, eigenvalues),
        )
    h = gradient_map(parameters)
    return LoopConstants(
        parameters=parameters,
        h=h,
        variation=np.zeros_like(h),
        monotonicity=float(_without_rounding(np.array(monotonicity_constant(parameters)), h)),
        lipschitz=np.asarray(np.linalg.norm(h, axis=1)),
        eigenvalues=_without_rounding(eigenvalues, eigenvalues),
    )


def _without_rounding(eigenvalues: FloatArray, matrix: FloatArray) -> FloatArray:
    """Eigenvalues of a matrix (N, N), or of N of them, with 0 for those that rounding alone can make."""
    rounding = 4.0 * np.finfo(float).eps * len(matrix) * float(np.abs(matrix).max())
    return np.where(np.abs(eigenvalues) <= rounding, 0.0, eigenvalues)


@dataclass(frozen=True, eq=False)
class DynamicsConstants:
    """Lipschitz constants in 1/s of the unknown dynamics g on two balls about x*, for actions and estimates.

    Infinite radii give global constants, which are infinite where g has a square.
    """

    lipschitz: FloatArray  # (N,), eta_i of Assumption 5 on the larger of the two balls
    first_tracking: float  # gain of x_f - z_f in [g_i(x) - g_i(xbar)], rows of order 1
    second_tracking: float  # the same for rows of order 2
    first_estimates: float  # gain of y - 1 (x) xbar in [g_i(xbar) - g_i(y_i)], order 1
    second_estimates: float  # the same for order 2
    velocity_lipschitz: FloatArray = field(default_factory=lambda: np.zeros(1))  # (N,), nu_i
    first_velocities: float = 0.0  # gain of v_s in [g_i(x, v) - g_i(x, 0)], rows of order 1
    second_velocities: float = 0.0  # the same for rows of order 2

    def of_velocities(self, players: NDArray[np.bool_]) -> float:
        """max nu_i of some of the players; 0 if there are none."""
        return float(np.broadcast_to(self.velocity_lipschitz, players.shape)[players].max(initial=0.0))

    @property
    def largest(self) -> float:
        """max eta_i."""
        return float(self.lipschitz.max())


NO_DYNAMICS = DynamicsConstants(np.zeros(1), 0.0, 0.0, 0.0, 0.0)
"""g = 0: the setting of Theorem 2."""


def dynamics_constants(
    parameters: GameParameters, action_radius: float = math.inf, estimate_radius: float = math.inf
) -> DynamicsConstants:
    """Lipschitz constants of g while |x - x*| <= action_radius and |y_i - x*| <= estimate_radius.

    g_i(x) - g_i(y_i) is split at xbar. From xbar to x only the actions of order 1 change, by x_f - z_f, so
    the first difference costs the norm of the columns f of the Jacobian; from xbar to y_i all change. With
    |dg_il/dx_jl| = |G + 2 H x_jl| <= |G + 2 H x*_jl| + 2 |H| r entrywise, the norm of the matrix of bounds
    is a bound of the norm. The paper takes sqrt(n) max eta_i and sqrt(N - n) max eta_i for the columns f.
    The bounds over a box serve balls that lie in it; beyond them nothing is known, and all are infinite.
    """
    if parameters.bounds is not None:
        return _over_box(parameters, parameters.bounds, max(action_radius, estimate_radius))
    require_coefficients(parameters.expressions, "a Lipschitz constant of g", "dynamics")
    x_star = nash_equilibrium(parameters)
    first = parameters.first_order

    def jacobian_bound(radius: float) -> FloatArray:
        H = np.abs(parameters.dynamics_square)
        growth = np.where(H > 0.0, 2.0 * H * radius if math.isfinite(radius) else math.inf, 0.0)
        at_equilibrium = parameters.dynamics_linear + 2.0 * parameters.dynamics_square * x_star[np.newaxis]
        return np.asarray(np.abs(at_equilibrium) + growth)

    def norm(matrices: FloatArray) -> float:
        """Largest 2-norm over coordinates, (rows, columns, D)."""
        if not matrices.size:
            return 0.0
        if not np.all(np.isfinite(matrices)):
            return math.inf
        return float(np.linalg.norm(np.moveaxis(matrices, 2, 0), 2, axis=(1, 2)).max())

    actions, estimates = jacobian_bound(action_radius), jacobian_bound(estimate_radius)
    own = np.linalg.norm(estimates, axis=1).max(axis=1)
    everywhere = np.maximum(own, np.linalg.norm(actions, axis=1).max(axis=1))
    return DynamicsConstants(
        lipschitz=np.asarray(everywhere),
        first_tracking=norm(actions[first][:, first]),
        second_tracking=norm(actions[~first][:, first]),
        first_estimates=float(own[first].max(initial=0.0)),
        second_estimates=float(own[~first].max(initial=0.0)),
    )


def _over_box(parameters: GameParameters, bounds: GameBounds, radius: float) -> DynamicsConstants:
    first = parameters.first_order
    along_actions, along_velocities = bounds.dynamics.lipschitz, bounds.velocities.lipschitz
    if radius > bounds.reach * (1.0 + ROUNDING) or not np.isfinite(along_actions + along_velocities).all():
        return DynamicsConstants(
            np.full(parameters.players, math.inf), math.inf, math.inf, math.inf, math.inf
        )
    largest = np.abs(bounds.dynamics.middle) + bounds.dynamics.radius
    by_velocities = np.abs(bounds.velocities.middle) + bounds.velocities.radius
    rows = np.repeat(first, parameters.dimension)

    def norm(matrix: FloatArray) -> float:
        return float(np.linalg.norm(matrix, 2)) if matrix.size else 0.0

    own = bounds.dynamics.lipschitz
    return DynamicsConstants(
        lipschitz=own,
        first_tracking=norm(largest[rows][:, rows]),
        second_tracking=norm(largest[~rows][:, rows]),
        first_estimates=float(own[first].max(initial=0.0)),
        second_estimates=float(own[~first].max(initial=0.0)),
        velocity_lipschitz=along_velocities,
        first_velocities=norm(by_velocities[rows]),
        second_velocities=norm(by_velocities[~rows]),
    )


def dynamics_bound(parameters: GameParameters, radius: float) -> FloatArray:
    """A bound (N, D) of |g_il(y)| for |y - x*| <= r: |g_il(x*)| + r |G_il + 2 H_il x*| + r^2 max_j |H_ijl|.

    Exact for linear g. Of dynamics that depend on velocities it is one of |g_il(y, 0)|.
    The bounds over a box serve balls that lie in it.
    """
    if parameters.bounds is not None:
        known = radius <= parameters.bounds.reach * (1.0 + ROUNDING)
        return np.where(known, parameters.bounds.dynamics_size, math.inf)
    require_coefficients(parameters.expressions, "a bound of g", "dynamics")
    x_star = nash_equilibrium(parameters)
    slope = parameters.dynamics_linear + 2.0 * parameters.dynamics_square * x_star[np.newaxis]
    curvature = np.abs(parameters.dynamics_square).max(axis=1)
    at_equilibrium = np.abs(parameters.unknown_dynamics(x_star))
    return np.asarray(at_equilibrium + radius * np.linalg.norm(slope, axis=1) + radius**2 * curvature)
