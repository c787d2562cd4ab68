"""Held-out log-loss of patches and its gradient in all parameters of the model, by the chain rule backwards.

With F = Y A^-1 K_*, G = dL/dF, B = A^-1 K_* and H = (Y A^-1)^T G, the gradients are dL/dK_* = H, dL/dA = -H B^T
and dL/dY = G B^T. The vote's rows of F are Y K_* itself: they add to dL/dK_* alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from semgp.blocks.arrays import F32, F64, I16, I32
from semgp.blocks.covariance import Mixture
from semgp.blocks.link import Link, class_probabilities
from semgp.blocks.patches import Packed
from semgp.blocks.solve import Noise, solve_block
from semgp.blocks.solved import SHARED
from semgp.blocks.uncertain import cross_covariance, cross_derivative, member_derivative


class Gradient(NamedTuple):
    """Sums over patches of the loss and its derivatives.

    loss (1,). kernel (Q, D + 1): in the logarithms of length scales and sf. noise (3,): in s_n, nugget and a. link
    (6,): sums over patches of the derivatives in delta, v_0, the three weights and the error rate.
    """

    loss: F64
    kernel: F64
    noise: F64
    link: F64


@njit(cache=True, nogil=True)
def add_gradient(patches: Packed, n_dims: int, kernel: Mixture, noise: Noise, link: Link, out: Gradient) -> None:
    """Add the mean log-loss of each patch's held-out labels, and its derivatives, to `out`."""
    n_most, m_most = patches.sizes[:, 0].max(), patches.sizes[:, 2].max()
    W_most, wide = SHARED + 3 * patches.sizes[:, 1].max(), max(n_most, m_most)
    K, factor = np.empty(n_most * wide, np.float32), np.empty(n_most * n_most, np.float32)
    rows_flat, G_flat = np.empty(W_most * n_most, np.float32), np.empty(W_most * m_most, np.float32)
    F_flat, p_flat, work = np.empty_like(G_flat), np.empty_like(G_flat), np.empty(wide, np.float32)
    at_X = at_k = at_present = at_mass = at_Y = at_label = 0
    U, V = (5, 3) if len(patches.S) else (0, 0)
    for b in range(len(patches.sizes)):
        n, P, m = patches.sizes[b, 0], patches.sizes[b, 1], patches.sizes[b, 2]
        X = patches.X[at_X : at_X + n_dims * n].reshape(n_dims, n)
        Y = patches.Y[at_Y : at_Y + n_dims * m].reshape(n_dims, m)
        S = patches.S[at_k * U : (at_k + n) * U].reshape(U, n)
        SY = patches.SY[at_label * V : (at_label + m) * V].reshape(V, m)
        k, label = patches.k[at_k : at_k + n], patches.label[at_label : at_label + m]
        present = patches.present[at_present : at_present + P]
        W = SHARED + 3 * P
        rows = rows_flat[: W * n].reshape(W, n)
        rows[SHARED + 2 * P :] = patches.mass[at_mass : at_mass + P * n].reshape(P, n)
        rows[2 + 2 * P] = 0
        for p in range(P):
            rows[2 + 2 * P] += rows[SHARED + 2 * P + p]
        L_inverse = factor[: n * n].reshape(n, n)
        if noise.solve:
            solve_block(X, S, k, n, present, kernel, noise, rows, L_inverse, K, work)
        else:
            rows[: 2 + 2 * P] = 0
        cross = K[: n * m].reshape(n, m)
        cross_covariance(X, S, n, Y, SY, m, kernel, cross, work)
        F, G = F_flat[: W * m].reshape(W, m), G_flat[: W * m].reshape(W, m)
        np.dot(rows, cross, F)
        prob = p_flat[: (P + 1) * m].reshape(P + 1, m)
        class_probabilities(F, present, m, link, prob)
        out.loss[0] += _link_gradient(F, prob, present, label, link, G, out.link)
        H = np.dot(np.ascontiguousarray(rows.T), G)
        cross_derivative(X, S, n, Y, SY, m, kernel, H, 1.0, out.kernel, work)
        if noise.solve:
            B = np.dot(L_inverse.T, np.dot(L_inverse, cross))
            # minus dL/dA: the votes, in the last rows, do not depend on A
            H_solved = np.dot(np.ascontiguousarray(rows[: 2 + 2 * P].T), G[: 2 + 2 * P])
            dA = np.dot(H_solved, np.ascontiguousarray(B.T))
            member_derivative(X, S, n, kernel, dA, -1.0, out.kernel, work)
            G_rows = np.dot(G, np.ascontiguousarray(B.T))
            _noise_gradient(dA, G_rows, rows, k, present, noise, out.noise)
        at_X, at_k, at_present = at_X + n_dims * n, at_k + n, at_present + P
        at_mass, at_Y, at_label = at_mass + P * n, at_Y + n_dims * m, at_label + m


@njit(cache=True, nogil=True)
def _link_gradient(F: F32, prob: F32, present: I16, label: I32, link: Link, G: F32, g: F64) -> float:
    """Return the mean log-loss; fill in G = dL/dF and add the derivatives in the link's parameters to g."""
    P, m, C = len(present), len(label), len(link.prior)
    prior, delta, v_0 = link.prior, link.delta, link.v_0
    w_i, w_l, w_v = link.indicator, link.log_ratio, link.vote
    place = np.full(C, -1, np.int64)
    for p in range(P):
        place[present[p]] = p
    G[:, :] = 0
    loss, score, slope = 0.0, np.empty(C), np.empty(C)
    for q in range(m):
        for c in range(C):
            score[c] = prob[place[c], q] if place[c] >= 0 else prob[P, q] * link.power[c]
        loss += _score_slope(score, label[q], link, 1 / m, slope, g)
        for c in range(C):
            i = place[c] if place[c] >= 0 else P
            pi = prior[c] if i < P else np.float32(1)
            d = slope[c] / m
            if w_i > 0:
                latent = F[2 + i, q] + pi if i < P else np.float32(1) - F[0, q]
                inside = max(latent, np.float32(0)) + delta * pi
                if latent > 0:
                    G[2 + i if i < P else 0, q] += w_i * d / inside * (1 if i < P else -1)
                g[0] += d * w_i * pi / inside
                g[2] += d * (np.log(inside) + (0.0 if i < P else np.log(prior[c])))
            if w_l > 0:
                z = F[2 + P + i, q] if i < P else F[1, q]
                G[2 + P + i if i < P else 1, q] += w_l * d
                g[3] += d * (z + np.log(prior[c]))
            if w_v > 0:
                v = F[SHARED + 2 * P + i, q] if i < P else np.float32(0)
                inside = v + v_0 * pi
                if i < P:
                    G[SHARED + 2 * P + i, q] += w_v * d / inside
                g[1] += d * w_v * pi / inside
                g[4] += d * (np.log(inside) + (0.0 if i < P else np.log(prior[c])))
    return loss / m


@njit(cache=True, nogil=True)
def _score_slope(score: F64, y: int, link: Link, share: float, slope: F64, g: F64) -> float:
    """Return -log p_y and fill in its derivatives in the logarithms of the pool's scores (C,), which sum to one.

    Adds `share` of that in the error rate to g.
    """
    C = len(score)
    classes = C - 1 if link.other else C
    rest = max(1 - score[C - 1], 1e-6) if link.other else 1.0
    top = 0
    for c in range(classes):
        top = c if score[c] > score[top] else top
    s_top, s_y = min(score[top] / rest, 1.0), score[y] / rest
    unsure = max(1 - s_top, 1e-6)
    u = 0.0
    if link.error_rate > 0:
        odds = unsure / s_top * (max(score[C - 1], 1e-6) if link.other else 1.0)
        w = link.error_rate * odds**link.error_power
        u = w / (1 + w)
    p_y = max((1 - u) * s_y + u * link.errors[y], 1e-12)
    # of log p_y in s_y, and in log w
    through_s, through_w = (1 - u) * s_y / p_y, u * (1 - u) * (link.errors[y] - s_y) / p_y
    for c in range(C):
        d = 0.0
        if c < classes:
            s = score[c] / rest
            d = through_s * ((1.0 if c == y else 0.0) - s)
            d += through_w * link.error_power * (-1.0 if c == top else s / unsure)
        if link.other:
            d += through_w * link.error_power * ((1.0 if c == C - 1 else 0.0) - score[c])
        slope[c] = -d
    if link.error_rate > 0:
        g[5] -= share * through_w / link.error_rate
    return float(-np.log(p_y))


@njit(cache=True, nogil=True)
def _noise_gradient(dA: F32, G_rows: F32, rows: F32, k: F32, present: I16, noise: Noise, g: F64) -> None:
    """Add the derivatives in s_n, nugget and a; dA is minus dL/dA, G_rows is dL/dY."""
    P, a = len(present), noise.a
    for j in range(len(k)):
        total = rows[2 + 2 * P, j]
        g[0] -= dA[j, j] / total
        g[1] -= dA[j, j] / k[j]
        g[2] += G_rows[1, j] * (1 / a - 1 / (total + a))
        for p in range(P):
            mass, pi = rows[SHARED + 2 * P + p, j], noise.prior[present[p]]
            g[2] += G_rows[2 + P + p, j] * (pi / (mass + a * pi) - 1 / (total + a))
