"""The client says what is wrong."""

import socket
import threading
from http.server import BaseHTTPRequestHandler, HTTPServer

import numpy as np
import pytest

from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.service import Client, UnavailableError
from tests.conftest import THREE
from tests.service.requests import (
    asked,
)


def test_a_server_that_is_no_service_is_told_apart() -> None:
    class Page(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.rfile.read(int(self.headers.get("Content-Length", 0)))
            self.send_response(200)
            self.end_headers()
            self.wfile.write(b"<html>")

        do_POST = do_GET

        def log_message(self, *_: object) -> None:
            pass

    with HTTPServer(("127.0.0.1", 0), Page) as server:
        threading.Thread(target=server.serve_forever).start()
        with Client(f"http://127.0.0.1:{server.server_port}") as client:
            with pytest.raises(UnavailableError, match="no answer"):
                client.info()
            with pytest.raises(UnavailableError, match="no answer"):
                client.query(asked())
        server.shutdown()


def test_the_client_says_what_is_wrong(url: str) -> None:
    with Client(url) as client:
        with pytest.raises(InputError, match="NaN or infinite"):
            client.query([[np.nan, 0, 0]])
        with pytest.raises(InputError, match="shape"):
            client.query([1, 2, 3])
        with pytest.raises(InputError, match="are not the map's"):
            client.update(LabelledCloud(np.zeros((1, 3)), type(THREE)(("a", "b")), np.zeros(1, dtype=int)))
        connection = client._connection.sock
        client.info()
        assert client._connection.sock is connection  # kept
        assert connection is not None
        connection.shutdown(socket.SHUT_RDWR)
        assert client.info()["classes"] == list(THREE.names)  # opened again
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    with Client(f"http://127.0.0.1:{port}") as client, pytest.raises(UnavailableError, match="cannot be reached"):
        client.info()
    for bad in ("ftp://a", "localhost:8000", ""):
        with pytest.raises(InputError, match="no URL"):
            Client(bad)
