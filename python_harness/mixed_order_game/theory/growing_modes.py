"""Whether a loop that is too large for its eigenvalues is stable: how many of them have positive real parts.

Without robust part and perturbation the estimates of a player answer to what they estimate alone. With the
Laplace transform C(s) of their answers the loop of `spectrum.linear_loop` shrinks from (2 + N) N D states to

    T(s) xbar = 0,  T = diag(q) + h o C,  q_a = s / k2 (order 1), s (s + k4) / (k2 k4) (order 2),
    C_.j = (s + K3 M_j)^-1 K3 a_.j,  M_j = L + diag(a_.j).

Its other modes, those of K3 M_j and -k1, decay. So what grows are the zeros of det T in the right half-plane,
and the argument principle counts them: where det T turns by less than its degree times pi along the imaginary
axis, it has half as many zeros there as half-turns are missing.

No turn is passed over. As -K3 M_j has no negative entry beside its diagonal, exp(-K3 M_j t) >= 0, and no
entry of (iw + K3 M_j)^-1 exceeds that of (K3 M_j)^-1 in size: |C_ij(iw)| <= C_ij(0) = 1 and
|C_.j(iw) - C_.j(iv)| <= |w - v| (K3 M_j)^-1 |C_.j(iv)|. Steps from v to w are so short that the 1-norm of
E(w) = T(iw) T(iv)^-1 - I stays below 1 on the way. Elimination does not raise that norm and needs no
pivoting, so the pivots of I + E stay in the right half-plane, and their arguments add up to that of the
determinant.

All of this holds as well along s = -r + iw, with C_ij(-r) in place of 1 and K3 M_j - r I in place of K3 M_j,
as long as r is below the least eigenvalue of every K3 M_j. So bisection finds a rate r that no mode is slower
than.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from time import monotonic

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lu_factor

from ..errors import SimulationError
from ..game.parameters import GameParameters
from .graph import consensus_blocks, is_connected
from .spectrum import consensus_rate, gradient_map, owners

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Answers = Callable[[complex], ComplexArray]

LARGEST = 250
"""Most players: inverses and modes of all M_j are N^3 numbers each, 125 MB; 200 take some 2 s of one core."""

WIDTH = 1.01
"""Ratio of the rates at which bisection of the slowest one ends."""

CHANGE = 0.9
"""Bound of the 1-norm of E over a step."""

SHORTEST = 1e-12
"""A step of this part of the whole way is too short to tell a zero from one on the imaginary axis."""

AT_LEAST = "a lower bound, by counting eigenvalues: no mode is slower"
"""What the rate of a large loop is."""


@dataclass(frozen=True)
class Stability:
    """Whether a loop decays, and how that is known, in half a sentence."""

    stable: bool | None  # None: not decided
    told: str
    rate: float = 0.0  # 1/s, no mode decays more slowly; 0 where none is known


def stability(game: GameParameters, *, rate: bool = True, time_limit: float = 60.0) -> Stability:
    """Of a loop by counting its eigenvalues with positive real parts, where that is possible.

    rate: whether a rate is sought, too, which takes some ten times as long. time_limit in s of computing.
    """
    states = len(owners(game)) * (2 + game.players)
    deadline = monotonic() + time_limit
    try:
        loop = _ReducedLoop(game)
        count = loop.beyond(0.0, deadline)
    except SimulationError as error:
        return Stability(None, f"the loop has {states:,} states, too many for its eigenvalues, and {error}")
    if not count:
        least = _slowest_rate(loop, deadline) if rate else 0.0
        parts = f"real parts of at most {-least:g} 1/s" if least > 0.0 else "negative real parts"
        told = f"all {states:,} eigenvalues have {parts}"
        return Stability(stable=True, told=told, rate=least)
    have = "has a positive real part" if count == 1 else "have positive real parts"
    return Stability(stable=False, told=f"{count:,} of the {states:,} eigenvalues {have}")


def growing_modes(game: GameParameters, *, time_limit: float = 60.0) -> int:
    """How many eigenvalues of `linear_loop` have positive real parts; none has the real part 0.

    Raises SimulationError for more than LARGEST players, a graph that is not connected, an eigenvalue that is
    0 or imaginary to rounding, and when computing takes longer than time_limit, in s.
    """
    deadline = monotonic() + time_limit
    return _ReducedLoop(game).beyond(0.0, deadline)


def _slowest_rate(loop: "_ReducedLoop", deadline: float) -> float:
    """A rate in 1/s, of three digits, that no mode of a stable loop is slower than; 0 if there is no time.

    The slowest mode's is at most 2 % larger, unless it is beyond the loop's limit or time was over.
    """
    low, high = 0.0, loop.limit
    try:
        while high > WIDTH * low:
            middle = math.sqrt(low * high) if low else 0.5 * high
            if loop.beyond(middle, deadline):
                high = middle
            else:
                low = middle
    except SimulationError:  # out of time, or an eigenvalue on the line
        pass
    return float(f"{0.995 * low:.3g}")  # rounded down


def _argument(matrix: ComplexArray) -> float:
    """Of the determinant of I + E in radians, the 1-norm of E below 1: exact, not up to turns."""
    factors, _ = lu_factor(matrix)
    return float(np.angle(np.diag(factors)).sum())


class _ReducedLoop:
    """T along s = -rate + iw, in 1/s; an action for each coordinate unless coordinates are alike."""

    def __init__(self, game: GameParameters) -> None:
        if game.players > LARGEST:
            raise SimulationError(f"the game has {game.players} players, more than {LARGEST}")
        if not is_connected(game.adjacency):
            raise SimulationError("the graph is not connected: some estimates are corrected by nothing")
        of = owners(game)
        self._pairs = np.ix_(of, of)
        self._h = gradient_map(game) if game.jacobian is None else game.jacobian
        self._first = game.first_order[of]
        self._k2, self._k = game.of_players("k2")[of], game.regulation[of]
        a, k3, blocks = game.adjacency, game.of_players("k3"), consensus_blocks(game.adjacency)
        self._scaled = k3[:, np.newaxis] * blocks  # K3 M_j
        self._answers = (
            _by_solving(self._scaled, k3[:, np.newaxis] * a) if game.directed else _by_modes(blocks, k3, a)
        )
        self.limit = min(consensus_rate(game), float(self._k[self._first].min(initial=math.inf)))
        """Rate of the slowest mode that T does not have"""

    def beyond(self, rate: float, deadline: float) -> int:
        """How many eigenvalues have real parts above -rate, below the limit; none has -rate.

        Raises SimulationError if one has to rounding, and at the deadline.
        """
        self._rate = rate
        self._inverses = np.linalg.inv(self._scaled - rate * np.eye(len(self._scaled)))
        end = self._end()
        v, turned, step = 0.0, 0.0, end
        matrix, change = self._at(v)
        while v < end:
            try:
                inverse = np.linalg.inv(matrix)
            except np.linalg.LinAlgError:
                raise self._on_the_line(v) from None
            size = np.abs(inverse)
            while not (change(min(v + step, end)) @ size).max() <= CHANGE:
                step *= 0.7
                if step < SHORTEST * end:
                    raise self._on_the_line(v)
            v, step = min(v + step, end), 1.5 * step
            matrix, change = self._at(v)
            turned += _argument(matrix @ inverse)
            if monotonic() > deadline:
                raise SimulationError(f"the time for computing was over at {v:.3g} of {end:.3g} 1/s")
        s = self._s(end)
        own = np.angle(s) * len(matrix) + np.angle(s + self._k[~self._first]).sum()
        return round(float(own + _argument(matrix / self._own(end)) - turned) / math.pi)

    def _s(self, w: float) -> complex:
        return complex(-self._rate, w)

    def _own(self, w: float) -> ComplexArray:
        """q (n,), which grows with w."""
        s = self._s(w)
        second = s * (s + self._k) / (self._k2 * self._k)
        return np.asarray(np.where(self._first, s / self._k2, second), dtype=np.complex128)

    def _at(self, v: float) -> tuple[ComplexArray, Callable[[float], FloatArray]]:
        """T (n, n) at v, and by how much its columns' entries differ at most in sum from there to w, (n,)."""
        answers, own = self._answers(self._s(v)), self._own(v)
        slopes = (self._inverses @ np.abs(answers)[:, :, np.newaxis])[:, :, 0].T
        sums = (np.abs(self._h) * slopes[self._pairs]).sum(axis=0)

        def change(w: float) -> FloatArray:
            return np.asarray(np.abs(self._own(w) - own) + (w - v) * sums)

        return np.diag(own) + self._h * answers.T[self._pairs], change

    def _end(self) -> float:
        """Where diag(q) outweighs the rest of T so much that nothing happens beyond."""
        largest = self._answers(self._s(0.0)).real.T[self._pairs]
        weights, w = (np.abs(self._h) * largest).sum(axis=0), float(self._k2.min())
        while (weights > CHANGE * np.abs(self._own(w))).any():
            w *= 1.1
        return w

    def _on_the_line(self, w: float) -> SimulationError:
        return SimulationError(f"an eigenvalue is {self._s(w) or 0.0:.4g} to rounding")


def _by_modes(blocks: FloatArray, k3: FloatArray, a: FloatArray) -> Answers:
    """C(s)', (N, N), row j of the estimates of player j, from the modes of K3^1/2 M_j K3^1/2, symmetric."""
    root = np.sqrt(k3)
    rates, modes = np.linalg.eigh(root[:, np.newaxis] * blocks * root)
    modes *= root[:, np.newaxis]
    shares = modes * np.einsum("jik,ij->jk", modes, a)[:, np.newaxis, :]

    def answers(s: complex) -> ComplexArray:
        return np.asarray((shares @ (1.0 / (s + rates))[:, :, np.newaxis])[:, :, 0])

    return answers


def _by_solving(scaled: FloatArray, pull: FloatArray) -> Answers:
    """The same of a directed graph, whose modes may be far from orthogonal."""
    unit = np.eye(len(pull))

    def answers(s: complex) -> ComplexArray:
        return np.asarray(np.linalg.solve(s * unit + scaled, pull.T[:, :, np.newaxis])[:, :, 0])

    return answers
