"""Scans that two reliability tests share."""

import pytest

from semgp.cloud import LabelledCloud
from tests.reliability.annotators import annotated, by_confusion


@pytest.fixture(scope="module")
def confused() -> list[LabelledCloud]:
    return annotated(by_confusion)
