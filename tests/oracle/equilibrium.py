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
    """x* with grad_i f_i(x*) = 0 and a convex f_i along x_i for every player; (N, D).

    Raises ArithmeticError if no root is found or a player could lower its cost there.
    """
    shape = game.x0.shape

    def gradient(x: FloatArray) -> FloatArray:
        return _pseudo_gradient(game, x.reshape(shape)).ravel()

    def jacobian(x: FloatArray) -> FloatArray:
        return pseudo_gradient_jacobian(game, x.reshape(shape))

    # each gradient in the unit of its second derivatives: no player's scale hides another's residual
    unit = np.abs(jacobian(np.zeros(game.x0.size))).max(axis=1)
    unit[unit == 0.0] = 1.0

    def scaled(x: FloatArray) -> FloatArray:
        return gradient(x) / unit

    def scaled_jacobian(x: FloatArray) -> FloatArray:
        return jacobian(x) / unit[:, None]

    found = root(scaled, np.zeros(game.x0.size), jac=scaled_jacobian, tol=1e-14)
    residual = np.max(np.abs(found.fun))
    if not residual < 1e-10 * (1.0 + np.max(np.abs(gradient(np.zeros(game.x0.size)) / unit))):
        raise ArithmeticError(f"no Nash equilibrium found: {found.message} (residual {residual})")
    second = jacobian(found.x).reshape(*shape, *shape)
    for i in range(game.players):
        if np.linalg.eigvalsh(second[i, :, i, :])[0] < -1e-12 * np.abs(second[i]).max():
            raise ArithmeticError(f"player {i + 1} could lower its cost where all gradients vanish")
    return np.asarray(found.x, dtype=np.float64).reshape(shape)


def strong_monotonicity_constant(game: Game, x: FloatArray | None = None) -> float:
    """m of the strong monotonicity assumption: smallest eigenvalue of the symmetric part of dP/dx at x.

    For quadratic costs it is the same at every x (default: the origin). Positive means strongly monotone.
    """
    jacobian = pseudo_gradient_jacobian(game, np.zeros_like(game.x0) if x is None else x)
    return float(np.linalg.eigvalsh(0.5 * (jacobian + jacobian.T))[0])
