"""Votes of scans, their agreement, and steps of EM, against naive loops."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.sparse import csr_array

from semgp.classes import MISSING
from semgp.cloud import LabelledCloud
from semgp.reliability.agreement import BINS, range_agreement, sensor_ranges
from semgp.reliability.dawid_skene import Errors, Expected, expect, fit, maximise
from semgp.reliability.votes import scan_votes, usable_scans
from tests.reliability.annotators import RESOLUTION, random_scans

F64 = NDArray[np.float64]


def naive_shares(scans: Sequence[LabelledCloud]) -> dict[tuple[int, ...], dict[int, dict[int, float]]]:
    """Voxel -> scan -> label -> share, of the voxels that two scans have seen."""
    said: dict[tuple[int, ...], dict[int, dict[int, float]]] = defaultdict(
        lambda: defaultdict(lambda: defaultdict(float))
    )
    for i, cloud in enumerate(scans):
        for j, point in enumerate(cloud.points):
            mass = 1.0 if cloud.confidence is None else float(cloud.confidence[j])
            if cloud.hard_labels[j] != MISSING and mass > 0:
                said[tuple(np.floor(point / RESOLUTION).astype(int))][i][int(cloud.hard_labels[j])] += mass
    for voxel in said.values():
        for shares in voxel.values():
            total = sum(shares.values())
            shares.update({label: mass / total for label, mass in shares.items()})
    return {v: dict(by_scan) for v, by_scan in said.items() if len(by_scan) >= 2}


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_votes_against_loops(seed: int) -> None:
    scans = random_scans(seed)
    expected = naive_shares(scans)
    used = usable_scans(scans, RESOLUTION)
    votes = scan_votes(used, [c.hard_labels for c in used], RESOLUTION)
    found: dict[int, dict[int, dict[int, float]]] = defaultdict(lambda: defaultdict(dict))
    for voxel, scan, kind, share in zip(votes.voxel, votes.scan, votes.kind, votes.share):
        assert int(kind) not in found[voxel][scan]
        found[int(voxel)][int(scan)][int(kind)] = float(share)

    def as_rows(voxels: dict) -> list:  # type: ignore[type-arg]
        return sorted([sorted((s, k, round(x, 9)) for s, k2 in v.items() for k, x in k2.items()) for v in voxels])

    assert as_rows(found.values()) == as_rows(expected.values())  # type: ignore[arg-type]
    assert sorted(votes.scans) == sorted(len(v) for v in expected.values())
    assert sorted(found) == list(range(len(votes.scans)))


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_agreement_against_loops(seed: int) -> None:
    scans = [replace(c, confidence=None) for c in random_scans(seed, points=30)]
    ranges = [sensor_ranges(c)[c.labelled] for c in scans]
    edges = np.geomspace(min(r.min() for r in ranges), max(r.max() for r in ranges), BINS + 1)[1:-1]
    entries: dict[tuple[int, ...], list[tuple[int, int, int]]] = defaultdict(list)
    for i, cloud in enumerate(scans):
        for point, label in zip(cloud.points[cloud.labelled], cloud.hard_labels[cloud.labelled]):
            at = int(np.searchsorted(edges, np.linalg.norm(point - cloud.origin)))
            entries[tuple(np.floor(point / RESOLUTION).astype(int))].append((i, int(label), at))
    pairs, agreeing = np.zeros((BINS, BINS)), np.zeros((BINS, BINS))
    for said in entries.values():
        size = {i: sum(j == i for j, _, _ in said) for i, _, _ in said}
        for (i, label, at), (j, other, there) in combinations(said, 2):
            if i != j:
                share = 1 / size[i] / size[j] / (len(size) - 1)
                for pair in ((at, there), (there, at)):
                    pairs[pair] += share
                    agreeing[pair] += share * (label == other)
    found = range_agreement(scans, resolution=RESOLUTION)
    filled = np.unique(np.searchsorted(edges, np.concatenate(ranges)))
    np.testing.assert_allclose(found.pairs, pairs[np.ix_(filled, filled)], atol=1e-9)
    np.testing.assert_allclose(found.agreeing, agreeing[np.ix_(filled, filled)], atol=1e-9)
    rate = agreeing.sum(axis=1)[filled] / np.where(pairs.sum(axis=1) > 0, pairs.sum(axis=1), np.nan)[filled]
    known = pairs.sum(axis=1)[filled] > 1e-9
    np.testing.assert_allclose(found.rate[known], rate[known], atol=1e-9)


def random_votes(seed: int, items: int = 40) -> tuple[F64, Errors]:
    rng = np.random.default_rng(seed)
    N = rng.choice([0.0, 0.5, 1.0, 3.0], (items, 4)) + np.eye(4)[rng.integers(0, 4, items)]
    return N, Errors(rng.uniform(0.1, 2, (4, 4)), rng.uniform(0.1, 2, 4))


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_one_step_of_em_against_loops(seed: int) -> None:
    N, prior = random_votes(seed)
    errors = maximise(Expected(np.zeros((4, 4)), np.zeros(4), 0.0), prior)
    said, true, log_likelihood = np.zeros((4, 4)), np.zeros(4), 0.0
    for row in N:
        joint = [
            errors.frequencies[t] * np.prod([errors.matrix[t, k] ** row[k] for k in range(4)]) for t in range(4)
        ]
        log_likelihood += float(np.log(sum(joint)))
        for t in range(4):
            true[t] += joint[t] / sum(joint)
            for k in range(4):
                said[t, k] += joint[t] / sum(joint) * row[k]
    expected = expect(csr_array(N), errors)
    np.testing.assert_allclose(expected.said, said)
    np.testing.assert_allclose(expected.true, true)
    assert expected.log_likelihood == pytest.approx(log_likelihood)
    new = maximise(expected, prior)
    for t in range(4):
        assert new.frequencies[t] == pytest.approx(
            (true[t] + prior.frequencies[t]) / (40 + prior.frequencies.sum())
        )
        for k in range(4):
            total = said[t].sum() + prior.matrix[t].sum()
            assert new.matrix[t, k] == pytest.approx((said[t, k] + prior.matrix[t, k]) / total)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_likelihood_never_falls(seed: int) -> None:
    N, prior = random_votes(seed)
    objectives = [fit(csr_array(N), prior, iterations).objective for iterations in range(1, 15)]
    assert (np.diff(objectives) > -1e-12).all()
    assert objectives[-1] > objectives[0]
