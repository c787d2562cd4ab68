"""Bags of ROS 1 and ROS 2: their topics, and their messages in the order of time."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any
from weakref import finalize

from semgp.errors import FileFormatError, InputError, MissingExtraError, SemgpError
from semgp.logs.definitions import typestore

SUFFIXES = (".bag", ".mcap", ".db3")
"""Files that are bags; so is a folder with a metadata.yaml."""

MENDING = {".bag": "rosbag reindex", ".mcap": "mcap recover"}
"""What mends the index of a file; of all others, "ros2 bag reindex"."""


@dataclass(frozen=True)
class Topic:
    """A topic of a bag: its name, the type of its messages such as "sensor_msgs/msg/Image", and their number."""

    name: str
    type: str
    count: int


@dataclass(frozen=True)
class Place:
    """Where in a bag a message is, and what its header says.

    Parameters
    ----------
    topic : str
        Its topic.
    logged, turn : int
        When it was recorded, in nanoseconds, and how many messages of the topic were at that very moment before
        it.
    stamp : int
        When it was taken, in nanoseconds, by its header.
    frame : str
        Its header's frame.
    """

    topic: str
    logged: int
    turn: int
    stamp: int
    frame: str


class Bag:
    """A bag that is open for reading until nobody holds it any more.

    Messages are decoded by the standard definitions of their types, never by code made from the file's own.

    Parameters
    ----------
    path : str or Path
        A ROS 1 bag (`.bag`), a ROS 2 bag (a folder with `metadata.yaml`), or one of its files (`.mcap`, `.db3`).

    Raises
    ------
    FileFormatError
        A file that is damaged, truncated or no bag.
    MissingExtraError
        rosbags is not installed.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.ros1 = self.path.suffix.lower() == ".bag"
        self._types = typestore(ros1=self.ros1)
        self._lock = Lock()
        with self._decoding():
            for file in [self.path] if self.path.suffix == ".db3" else self.path.glob("*.db3"):
                _require_all_pages(file)
            self._reader = _reader(self.path, self.ros1)
            self._reader.open()
            finalize(self, self._reader.close)
            topics = self._reader.topics
            self.topics = {
                name: Topic(name, t.msgtype or "several types", t.msgcount) for name, t in topics.items()
            }
            self._connections = {name: t.connections for name, t in topics.items()}
            self.begin, self.end = self._reader.start_time, self._reader.end_time

    def topics_of(self, *types: str) -> list[Topic]:
        """Return the topics of some types that have messages."""
        return [topic for topic in self.topics.values() if topic.type in types and topic.count]

    def require(self, name: str, *types: str) -> Topic:
        """Return the topic of a name.

        Raises
        ------
        InputError
            No such topic, or one of another type than those that are asked for.
        """
        found = self.topics.get(name)
        if found is None:
            raise InputError(f"{self.path} has no topic {name}; {self.listing()}")
        if found.type not in types:
            raise InputError(f"{self.path}: topic {name} holds {found.type}, not {' or '.join(types)}.")
        return found

    def listing(self) -> str:
        """Return a text that lists the topics, their types and counts."""
        rows = "".join(
            f"\n  {t.name}  {t.type}  {t.count:,}" for t in sorted(self.topics.values(), key=lambda t: t.name)
        )
        return f"its topics are{rows}" if rows else "it has no topics."

    def places(self, topic: str) -> Iterator[Place]:
        """Yield where the messages of a topic are, whose type begins with a std_msgs/Header."""
        last, turn = None, 0
        for logged, raw in self._raw([topic]):
            with self._decoding():
                stamp, frame = self._header(raw)
            turn = turn + 1 if logged == last else 0
            last = logged
            yield Place(topic, logged, turn, stamp, frame)

    def messages(self, topic: str) -> Iterator[Any]:
        """Yield the messages of a topic."""
        for _, raw in self._raw([topic]):
            yield self._decoded(topic, raw)

    def message(self, place: Place) -> Any:
        """Return the message at a place."""
        with self._lock:
            for turn, (_, raw) in enumerate(self._raw([place.topic], place.logged, place.logged + 1)):
                if turn == place.turn:
                    return self._decoded(place.topic, raw)
        raise FileFormatError(self.path, f"lost a message of {place.topic}: it has changed since it was opened.")

    def _raw(
        self, topics: list[str], start: int | None = None, stop: int | None = None
    ) -> Iterator[tuple[int, bytes]]:
        connections = [connection for topic in topics for connection in self._connections[topic]]
        with self._decoding():
            if connections:
                for _, logged, raw in self._reader.messages(connections, start, stop):
                    yield logged, raw

    def _header(self, raw: bytes) -> tuple[int, str]:
        """Return the stamp in nanoseconds and the frame that a serialised message begins with."""
        order = "<" if self.ros1 or raw[1] & 1 else ">"
        seconds, nanoseconds, length = struct.unpack_from(order + "III", raw, 4)  # after seq, or the encapsulation
        text = raw[16 : 16 + length]
        if len(text) < length:
            raise FileFormatError(self.path, "has a message that ends within its header.")
        return seconds * 10**9 + nanoseconds, bytes(text).rstrip(b"\0").decode()

    def _decoded(self, topic: str, raw: bytes) -> Any:
        with self._decoding():
            kind = self.topics[topic].type
            return self._types.deserialize_ros1(raw, kind) if self.ros1 else self._types.deserialize_cdr(raw, kind)

    @contextmanager
    def _decoding(self) -> Iterator[None]:
        """Turn whatever the decoders of rosbags, sqlite and the compressions raise into FileFormatError."""
        try:
            yield
        except (SemgpError, GeneratorExit):
            raise
        except Exception as error:  # damaged bytes make them fail in any way
            problem = str(error).rstrip(".") or type(error).__name__
            mend = MENDING.get(self.path.suffix.lower(), "ros2 bag reindex")
            raise FileFormatError(
                self.path,
                f"is damaged, truncated or no bag: {problem}. A recording cut off may be mended by {mend}.",
            ) from error


def is_bag(path: Path) -> bool:
    """Tell from its name, or the folder's contents, whether a path is a bag."""
    return (path.is_file() and path.suffix.lower() in SUFFIXES) or (path / "metadata.yaml").is_file()


def _require_all_pages(file: Path) -> None:
    """Check that an sqlite3 file is as long as its header says: sqlite itself reads what is cut off as zeros."""
    with file.open("rb") as opened:
        header = opened.read(100)
    if len(header) < 100:
        raise FileFormatError(file, "is damaged, truncated or no bag: it ends within its header.")
    page, changes, pages, valid_for = struct.unpack_from(">16xH6xII60xI", header)
    expected = (65536 if page == 1 else page) * pages
    if changes == valid_for and file.stat().st_size < expected:
        raise FileFormatError(
            file, f"is damaged, truncated or no bag: it lacks the end of its {expected:,} bytes."
        )


def _reader(path: Path, ros1: bool) -> Any:
    """Return rosbags' reader of a bag."""
    try:
        if ros1:
            from rosbags.rosbag1 import Reader as Reader1

            return Reader1(path)
        from rosbags.rosbag2 import Reader as Reader2

        return Reader2(path)
    except ImportError as error:
        raise MissingExtraError("reading and writing bags", "ros") from error
