"""Nash equilibrium (a zero of the pseudo-gradient) and the strong monotonicity constant."""

from __future__ import annotations

import numpy as np
from scipy.optimize import root

from . import paper_equations as paper
from .game import FloatArray, Game


def _pseudo_gradient(game: Game, x: paper.Numbers) -> paper.Numbers:
    return paper.pseudo_gradient(x, game.cost_quadratic, game.cost_linear, game.cost_coupling)


def pseudo_gradient_jacobian(game: Game, x: FloatArray) -> FloatArray:
    """dP/dx at x (N, D) by complex step; returns (N D, N D)."""
    step = 1e-30
    size = x.size
    jacobian = np.empty((size, size))
    for column in range(size):
        shifted = x.astype(np.complex128).ravel()
        shifted[column] += 1j * step
        jacobian[:, column] = _pseudo_gradient(game, shifted.reshape(x.shape)).imag.ravel() / step
    return jacobian


def nash_equilibrium(game: Game) -> FloatArray:
    """x* with grad_i f_i(x*) = 0 for every player; (N, D). Raises ArithmeticError if no root is found."""
    shape = game.x0.shape

    def gradient(x: FloatArray) -> FloatArray:
        return _pseudo_gradient(game, x.reshape(shape)).ravel()

    def jacobian(x: FloatArray) -> FloatArray:
        return pseudo_gradient_jacobian(game, x.reshape(shape))

    found = root(gradient, np.zeros(game.x0.size), jac=jacobian, tol=1e-14)
    residual = np.max(np.abs(found.fun))
    if not residual < 1e-10 * (1.0 + np.max(np.abs(game.cost_linear))):
        raise ArithmeticError(f"no Nash equilibrium found: {found.message} (residual {residual})")
    return np.asarray(found.x, dtype=np.float64).reshape(shape)


def strong_monotonicity_constant(game: Game, x: FloatArray | None = None) -> float:
    """m of the strong monotonicity assumption: smallest eigenvalue of the symmetric part of dP/dx at x.

    For quadratic costs it is the same at every x (default: the origin). Positive means strongly monotone.
    """
    jacobian = pseudo_gradient_jacobian(game, np.zeros_like(game.x0) if x is None else x)
    return float(np.linalg.eigvalsh(0.5 * (jacobian + jacobian.T))[0])
