"""Results that the figures show."""

import pytest

from semgp.evaluation.task import Result
from tests.results import patches_task, results_of


@pytest.fixture(scope="module")
def results() -> list[Result]:
    return results_of(patches_task("282"))
