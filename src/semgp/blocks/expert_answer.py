"""The answers of blocks that solve themselves, in the same pairs and turns as the closed form."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from semgp.blocks.answer import Answers
from semgp.blocks.arrays import F32, I64
from semgp.blocks.experts import BlockExpert, solve_expert
from semgp.blocks.model import BlockModel
from semgp.blocks.pairs import Pairs
from semgp.blocks.solved import class_mass
from semgp.blocks.store import Piece


def answer_by_experts(
    model: BlockModel,
    piece: Piece,
    pairs: Pairs,
    order: I64,
    block: I64,
    features: F32,
    prior: F32,
    answers: Answers,
) -> None:
    """Add the answers to some pairs, sorted by block, all of blocks in one piece."""
    edges = np.flatnonzero(np.diff(block, prepend=-1, append=-1))
    for a, b in pairwise(edges):
        number = int(block[a])
        if number not in piece.experts:
            piece.experts[number] = _solved(model, piece, number, prior)
        rows = order[a:b]
        points, w = pairs.point[rows], pairs.weight[rows]
        X = np.concatenate([pairs.local[rows], _known(features[points], piece, number, pairs.local[rows])], axis=1)
        probability, variance = piece.experts[number].predict(X.astype(np.float64))
        answers.probability[points] += w[:, None] * probability
        answers.variance[points] += w * variance


def _solved(model: BlockModel, piece: Piece, b: int, prior: F32) -> BlockExpert:
    solved = piece.solved
    n, P = int(solved.n[b]), int(solved.n_present[b])
    mass = np.zeros((n, len(prior)))
    mass[:, solved.present[b, :P]] = class_mass(solved, b).T
    X = solved.X[b, :, :n].T.astype(np.float64)
    return solve_expert(model, X, mass, solved.k[b, :n].astype(np.float64), prior.astype(np.float64))


def _known(given: F32, piece: Piece, b: int, local: F32) -> F32:
    """The points' features; where one is unknown, that of the block's nearest member."""
    if not given.shape[1] or not np.isnan(given).any():
        return given
    members = piece.solved.X[b, :, : piece.solved.n[b]]
    r2 = ((local[:, :, None] - members[None, :3]) ** 2).sum(axis=1)
    return np.where(np.isnan(given), members[3:, r2.argmin(axis=1)].T, given)
