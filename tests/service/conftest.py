"""Maps to serve, and a service that is up."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.service.requests import (
    HTTP,
    SMALL,
    new_store,
)
from tests.service.running import running


@pytest.fixture(scope="session", autouse=True)
def _closed() -> Iterator[None]:
    with HTTP:
        yield


@pytest.fixture
def store(tmp_path: Path) -> Path:
    return new_store(tmp_path)


@pytest.fixture(scope="module")
def url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """One small-limited service for the tests that change nothing that others see."""
    with running(new_store(tmp_path_factory.mktemp("map")), SMALL) as (url, _):
        yield url
