"""Requests to buckets: when they are made again, what is said where that does not help, and how many there are."""

import threading
from collections.abc import Callable
from typing import Any

import pytest

from semgp.errors import FileFormatError, InputError
from semgp.executors import Threads
from semgp.store import MapStore, StoredMap, build, patience
from semgp.store.asking import query
from semgp.store.bucket import BucketFiles
from tests.store.scenes import PLAIN, cloud

obstore = pytest.importorskip("obstore", reason="buckets need the extra cloud")

URL = "s3://maps/drive"
AWAY = "Generic S3 error: Error performing PUT http://127.0.0.1:1/maps - HTTP error: error sending request"


@pytest.fixture
def bucket() -> Any:
    from obstore.store import MemoryStore

    return MemoryStore()


@pytest.fixture(autouse=True)
def pauses(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The pauses that were made, without the time for them."""
    made: list[float] = []
    monkeypatch.setattr("semgp.store.patience.time.sleep", made.append)
    return made


def failing(times: int, text: str = AWAY, kind: type[Exception] | None = None) -> Callable[[], str]:
    """A request that fails some times."""
    errors = iter([(kind or obstore.exceptions.GenericError)(text)] * times)

    def request() -> str:
        for error in errors:
            raise error
        return "answer"

    return request


def test_a_request_is_made_again_with_longer_and_longer_pauses(pauses: list[float]) -> None:
    assert patience.patiently(failing(len(patience.PAUSES))) == "answer"
    assert pauses == sorted(patience.PAUSES)
    with pytest.raises(obstore.exceptions.GenericError):
        patience.patiently(failing(len(patience.PAUSES) + 1))


@pytest.mark.parametrize(
    ("text", "kind", "words"),
    [
        (AWAY, None, None),
        ("status code: 503 Slow Down", None, None),
        ("status code: 429 Too Many Requests", None, None),
        ("status code: 403 Forbidden", "PermissionDeniedError", "access is denied"),
        ("status code: 401 Unauthorized", "UnauthenticatedError", "access is denied"),
        ("status code: 404: <Code>NoSuchBucket</Code>", None, "there is no such bucket"),
        ("status code: 404: <Code>ContainerNotFound</Code>", None, "there is no such bucket"),
        ("HTTP error: builder error\n\nkind: Builder, source: BadScheme", None, "AWS_ALLOW_HTTP"),
    ],
)
def test_only_what_may_pass_is_tried_again(
    text: str, kind: str | None, words: str | None, pauses: list[float]
) -> None:
    error = getattr(obstore.exceptions, kind or "GenericError")
    if words is None:
        assert patience.patiently(failing(1, text, error)) == "answer"
        return
    with pytest.raises(error) as caught:
        patience.patiently(failing(1, text, error))
    assert not pauses
    assert words in patience.problem(caught.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("Error performing PUT http://169.254.169.254/latest/api/token - error sending request", "no credentials"),
        (AWAY, "the server cannot be reached"),
        (AWAY + "\n\nkind: Timeout, source: TimedOut", "AWS_TIMEOUT"),
        (AWAY + "\n\nkind: Connect, source: TimedOut", "the server cannot be reached"),
        ("Something else.\n\nDebug source:\n...", "Something else"),
    ],
)
def test_what_is_wrong_is_said(text: str, words: str) -> None:
    said = patience.problem(obstore.exceptions.GenericError(text))
    assert words in said
    assert "\n" not in said
    assert not said.endswith(".")


def test_a_file_whose_answer_was_lost_is_ours_and_no_other(bucket: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    files, put, lost = BucketFiles(bucket, URL), obstore.put, list[str]()

    def losing(*args: Any, **options: Any) -> None:
        try:
            put(*args, **options)
        finally:
            if args[1] not in lost:
                lost.append(args[1])
                raise obstore.exceptions.GenericError(AWAY)

    monkeypatch.setattr(obstore, "put", losing)
    assert files.create("a", b"mine")
    assert not files.create("a", b"mine")
    put(bucket, "b", b"theirs")
    assert not files.create("b", b"mine")
    assert files.read("b") == b"theirs"


def test_answers_that_are_lost_make_no_server_look_as_if_it_overwrites(
    bucket: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    put, tries = obstore.put, list[int]()

    def losing(*args: Any, **options: Any) -> None:
        tries.append(len(tries))
        try:
            put(*args, **options)
        finally:
            if len(tries) % 2:
                raise obstore.exceptions.GenericError(AWAY)

    monkeypatch.setattr(obstore, "put", losing)
    files = BucketFiles(bucket, URL)
    for _ in range(2):
        assert files.lock().alone is None
    assert len(tries) > 4
    assert files.read("writers.lock") == b""


def test_a_server_that_overwrites_is_refused(bucket: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    put = obstore.put
    monkeypatch.setattr(obstore, "put", lambda store, name, data, mode: put(store, name, data))
    store = MapStore(URL, BucketFiles(bucket, URL))
    store.create(PLAIN)
    with pytest.raises(InputError, match=f"{URL}: this server overwrites"):
        build(store, [cloud(0)], Threads(1))
    assert store.numbers() == [1]


class Together(BucketFiles):
    """Files of a bucket of which so many are asked for at a time: fewer wait for each other until they give up."""

    def __init__(self, bucket: Any, n: int) -> None:
        super().__init__(bucket, URL)
        self.read_barrier, self.write_barrier = (threading.Barrier(n, timeout=30) for _ in range(2))
        self.strict = False

    def read(self, name: str, *more: Any) -> bytes:
        """Read a file, once the others are asked for."""
        if self.strict and name.startswith("tiles/"):
            self.read_barrier.wait()
        return super().read(name, *more)

    def create(self, name: str, data: bytes) -> bool:
        """Create a file, once the others are on their way."""
        if self.strict and name.startswith("tiles/"):
            self.write_barrier.wait()
        return super().create(name, data)


def test_tiles_are_read_and_written_at_once(bucket: Any) -> None:
    clouds = [cloud(i, 5.12 * i, n=200) for i in range(4)]
    with StoredMap.create(MapStore(URL, BucketFiles(bucket, URL)), PLAIN) as made:
        for one in clouds:
            made.update(one)
    n = len(made.store.manifest().tiles)
    assert 4 <= n <= 16
    files = Together(bucket, n)
    store, files.strict = MapStore(URL, files), True
    assert len(StoredMap(store).positions) == len(made)
    assert not list(store.check())
    X = made.positions
    query(store, X, Threads(1))
    opened = StoredMap(store)
    opened.query(X)
    for one in clouds:
        opened.update(one)
    opened.commit()


def test_errors_name_the_file(bucket: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    files = BucketFiles(bucket, URL)
    for function, act, kind in (
        ("get", lambda: files.read("a"), FileFormatError),
        ("list_with_delimiter", lambda: files.names("a"), FileFormatError),
        ("head", lambda: files.age("a"), FileFormatError),
        ("put", lambda: files.create("a", b""), InputError),
        ("delete", lambda: files.remove("a"), InputError),
    ):
        monkeypatch.setattr(obstore, function, lambda *_, **__: failing(100)())
        with pytest.raises(kind, match=f"{URL}/a.*the server cannot be reached"):
            act()
