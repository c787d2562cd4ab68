"""A server that speaks S3, on loopback, and a wire to it that can be cut."""

import os
import shutil
import socket
import subprocess
import threading
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

HOST = "127.0.0.1"


class Wire:
    """Forwards what clients and a server on loopback send each other, as long as it is whole.

    Attributes
    ----------
    port : int
        Where clients connect.
    swallow : int
        So many answers are lost on their way: the server has done what it was asked, and the connection ends.
    """

    def __init__(self, target: int) -> None:
        self._target, self._open, self._whole = target, list[socket.socket](), True
        self.swallow = 0
        self._door = socket.create_server((HOST, 0))
        self.port: int = self._door.getsockname()[1]
        threading.Thread(target=self._accept, daemon=True).start()

    def cut(self) -> None:
        """End all connections, and let no other one come about."""
        self._whole = False
        for end in self._open:
            _end(end)
        self._open.clear()

    def mend(self) -> None:
        """Forward again."""
        self._whole = True

    def close(self) -> None:
        """Cut it for good."""
        self.cut()
        _end(self._door)

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                client, _ = self._door.accept()
                if not self._whole:
                    client.close()
                    continue
                server = socket.create_connection((HOST, self._target))
                self._open += client, server
                threading.Thread(target=self._forward, args=(client, server, False), daemon=True).start()
                threading.Thread(target=self._forward, args=(server, client, True), daemon=True).start()

    def _forward(self, source: socket.socket, sink: socket.socket, answers: bool) -> None:
        with suppress(OSError):
            while data := source.recv(1 << 16):
                if answers and self.swallow:
                    self.swallow -= 1
                    break
                sink.sendall(data)
        _end(source)
        _end(sink)


def _end(one: socket.socket) -> None:
    with suppress(OSError):
        one.shutdown(socket.SHUT_RDWR)
    one.close()


@contextmanager
def s3_server(log: Path) -> Iterator[int]:
    """Run moto's server with the buckets "maps" and "other", and yield its port; skip where there is none."""
    program = shutil.which("moto_server")
    if program is None:
        pytest.skip("moto_server is not installed: pip install 'moto[s3]' flask flask-cors")
    with socket.create_server((HOST, 0)) as free:
        port = free.getsockname()[1]
    with log.open("wb") as file:
        server = subprocess.Popen([program, "-H", HOST, "-p", str(port)], stdout=file, stderr=file)
        try:
            for bucket in ("maps", "other"):
                _make(f"http://{HOST}:{port}/{bucket}", server)
            yield port
        finally:
            server.kill()
            server.wait()


def _make(bucket: str, server: "subprocess.Popen[bytes]") -> None:
    """Make a bucket, once the server answers."""
    while True:
        try:
            with urllib.request.urlopen(urllib.request.Request(bucket, method="PUT"), timeout=10):
                return
        except OSError:
            assert server.poll() is None, "the server did not start"
            time.sleep(0.05)


def s3_settings(port: int) -> dict[str, str]:
    """The environment of who speaks to the server."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("AWS_")}
    return kept | {
        "AWS_ENDPOINT_URL": f"http://{HOST}:{port}",
        "AWS_ALLOW_HTTP": "true",
        "AWS_ACCESS_KEY_ID": "somebody",
        "AWS_SECRET_ACCESS_KEY": "secret",
        "AWS_REGION": "us-east-1",
    }
