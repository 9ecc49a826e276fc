"""The paper's equations, one function each, in the paper's order and notation.

Every function is elementwise over leading axes, so it serves one player or all of them at once, and is
analytic in its state arguments, so that a complex step gives its derivatives.
Shapes: N players, D coordinates, q neurons; (N, D) stands for any leading axes before D.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Numbers: TypeAlias = NDArray[Any]  # float, or complex under a complex step


def _robust_constant() -> float:
    """The constant of the lemma on |eta| - eta tanh(eta / epsilon): K = exp(-(K + 1)), by Newton's method."""
    K = 0.25
    for _ in range(20):
        K -= (K - np.exp(-(K + 1.0))) / (1.0 + np.exp(-(K + 1.0)))
    return float(K)


ROBUST_CONSTANT = _robust_constant()  # dimensionless


# Preliminaries: radial basis function network


def rbf_activation(y_i: Numbers, centers: Numbers, width: float) -> Numbers:
    """s_m(y_i) = exp[-(y_i - mu_m)^T (y_i - mu_m) / rho^2], the activation function of the RBF network.

    y_i (..., N D), centers mu (q, N D), width rho; returns S (..., q), dimensionless.
    """
    difference = y_i[..., np.newaxis, :] - centers
    S: Numbers = np.exp(-np.sum(difference * difference, axis=-1) / width**2)
    return S


def network_output(W: Numbers, S: Numbers) -> Numbers:
    """l_NN = W^T S, the output of the RBF network. W (..., q, D), S (..., q); returns (..., D)."""
    return (S[..., np.newaxis, :] @ W)[..., 0, :]


# Problem description: plants, costs


def first_order_plant(u: Numbers, g: Numbers, d: Numbers) -> Numbers:
    """x_i' = u_i + g_i(x) + d_i(t), the dynamics of first-order players. All (N, D)."""
    return u + g + d


def second_order_plant(v: Numbers, u: Numbers, g: Numbers, d: Numbers) -> tuple[Numbers, Numbers]:
    """x_i' = v_i, v_i' = u_i + g_i(x) + d_i(t), the dynamics of second-order players. All (N, D)."""
    return v, u + g + d


def cost(x: Numbers, quadratic: Numbers, linear: Numbers, constant: Numbers, coupling: Numbers) -> Numbers:
    """f_i(x) = q_i |x_i|^2 + l_i . x_i + const_i + sum_j c_ij |x_i - x_j|^2, the vehicles' h_i + l_i.

    x (N, D), quadratic (N,), linear (N, D), constant (N,), coupling (N, N); returns (N,).
    """
    difference = x[:, np.newaxis, :] - x[np.newaxis, :, :]
    distances: Numbers = np.sum(coupling * np.sum(difference * difference, axis=2), axis=1)
    own: Numbers = quadratic * np.sum(x * x, axis=1) + np.sum(linear * x, axis=1) + constant
    return own + distances


def gradient_at_estimates(y: Numbers, quadratic: Numbers, linear: Numbers, coupling: Numbers) -> Numbers:
    """grad_i f_i(y_i) = df_i/dx_i at x = y_i: 2 q_i y_ii + l_i + 2 sum_j c_ij (y_ii - y_ij).

    y (N, N, D), quadratic (N,), linear (N, D), coupling (N, N); returns (N, D).
    """
    players = np.arange(len(y))
    own: Numbers = y[players, players]
    coupled = coupling.sum(axis=1)[:, np.newaxis] * own - (coupling[:, np.newaxis, :] @ y)[:, 0, :]
    gradient: Numbers = 2.0 * quadratic[:, np.newaxis] * own + linear + 2.0 * coupled
    return gradient


def pseudo_gradient(x: Numbers, quadratic: Numbers, linear: Numbers, coupling: Numbers) -> Numbers:
    """P(x) = [grad_1 f_1(x), ..., grad_N f_N(x)], the map of the strong monotonicity assumption. (N, D)."""
    everyone_knows_x = np.broadcast_to(x, (len(x), *x.shape))
    return gradient_at_estimates(everyone_knows_x, quadratic, linear, coupling)


def unknown_dynamics(x: Numbers, linear: Numbers, square: Numbers, gain: Numbers) -> Numbers:
    """g_i(x)_l = gain_i sum_j (G_ij,l x_jl + H_ij,l x_jl^2): the vehicles' g_i, general.

    x (N, D), linear G and square H (N, N, D), gain (N,); returns (N, D).
    """
    g: Numbers = gain[:, np.newaxis] * np.sum((linear + square * x) * x, axis=1)
    return g


def disturbance(t: float, bias: Numbers, amplitude: Numbers, frequency: Numbers, phase: Numbers) -> Numbers:
    """d_il(t) = bias + amplitude sin(frequency t + phase): the vehicles' i sin(i t), general. All (N, D)."""
    d: Numbers = bias + amplitude * np.sin(frequency * t + phase)
    return d


# Method establishment


def seeking_error_first_order(x: Numbers, z: Numbers) -> Numbers:
    """e_i = x_i - z_i, the regulation error of first-order players. (N, D)."""
    return x - z


def seeking_error_second_order(k2: float, gradient: Numbers, v: Numbers) -> Numbers:
    """vbar_i = k2 grad_i f_i(y_i) + v_i, the error of second-order players. (N, D), length/s."""
    return k2 * gradient + v


def robust_term(delta: float, epsilon: float, e: Numbers) -> Numbers:
    """phi_i = delta tanh(K delta e_i / epsilon), both orders. e (N, D)."""
    return delta * np.tanh(ROBUST_CONSTANT * delta * e / epsilon)


def control_first_order(k1: float, x: Numbers, z: Numbers, nn: Numbers, phi: Numbers) -> Numbers:
    """u_i = -k1 (x_i - z_i) - W_i^T S_i(y_i) - phi_i, the control law of first-order players. (N, D)."""
    return -k1 * (x - z) - nn - phi


def control_second_order(
    k2: float, k4: float, gradient: Numbers, v: Numbers, nn: Numbers, phi: Numbers
) -> Numbers:
    """u_i = -k2 k4 grad_i f_i(y_i) - k4 v_i - W_i^T S_i - phi_i, the law of second-order players. (N, D)."""
    return -k2 * k4 * gradient - k4 * v - nn - phi


def reference_rate(k2: float, gradient: Numbers) -> Numbers:
    """z_i' = -k2 grad_i f_i(y_i), the reference of first-order players. (N, D), length/s."""
    return -k2 * gradient


def adaptation_inside(beta: float, S: Numbers, e: Numbers) -> Numbers:
    """w' = beta S_i(y_i) e, the adaptive law when w'w < W_max, or w'w = W_max and e w'S < 0.

    One weight column per (player, coordinate): S (..., q), e (...); returns (..., q).
    """
    return beta * S * e[..., np.newaxis]


def adaptation_on_sphere(beta: float, S: Numbers, e: Numbers, w: Numbers) -> Numbers:
    """w' = beta S_i e - beta (e w'S / w'w) w, the adaptive law when w'w = W_max and e w'S >= 0.

    One weight column per (player, coordinate): S and w (..., q), e (...); returns (..., q).
    """
    radial = e * np.sum(w * S, axis=-1) / np.sum(w * w, axis=-1)
    w_rate: Numbers = beta * S * e[..., np.newaxis] - beta * radial[..., np.newaxis] * w
    return w_rate


def shared_signal(first_order: NDArray[np.bool_], x: Numbers, z: Numbers) -> Numbers:
    """xbar_j = z_j for first-order players, x_j for second-order players. first_order (N,); (N, D)."""
    return np.where(first_order[:, np.newaxis], z, x)


def estimate_rate(k3: float, adjacency: Numbers, y: Numbers, xbar: Numbers) -> Numbers:
    """y_ij' = -k3 (sum_k a_ik (y_ij - y_kj) + a_ij (y_ij - xbar_j)), the consensus law.

    adjacency (N, N), y (N, N, D), xbar (N, D); returns (N, N, D), length/s.
    """
    N = len(y)
    degree = adjacency.sum(axis=1)
    neighbours = (adjacency @ y.reshape(N, -1)).reshape(y.shape)
    disagreement = degree[:, np.newaxis, np.newaxis] * y - neighbours
    y_rate: Numbers = -k3 * (disagreement + adjacency[:, :, np.newaxis] * (y - xbar))
    return y_rate


# Without unknown dynamics and disturbances (the global theorem's strategy)


def plain_control_first_order(k1: float, x: Numbers, z: Numbers) -> Numbers:
    """u_i = -k1 (x_i - z_i): the estimation module removed, first-order players. (N, D)."""
    return -k1 * (x - z)


def plain_control_second_order(k2: float, k4: float, gradient: Numbers, v: Numbers) -> Numbers:
    """u_i = -k4 v_i - k2 k4 grad_i f_i(y_i): the estimation module removed, second-order players. (N, D)."""
    return -k4 * v - k2 * k4 * gradient
