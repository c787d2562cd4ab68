"""Who may ask the service, and for what."""

import base64
import sys
from pathlib import Path

import pytest

from semgp.errors import InputError, MissingExtraError
from semgp.service import Client
from semgp.service.clouds import encode_cloud
from semgp.service.server import serve
from semgp.service.service import Service
from tests.service.requests import (
    HTTP,
    NPZ,
    TOKEN,
    asked,
    part,
    post,
    refused,
)
from tests.service.running import running


def test_token(store: Path) -> None:
    with running(store, token=TOKEN) as (url, _):
        assert "Bearer" in refused(HTTP.get(url + "/info"), 401)
        for wrong in ("Bearer wrong", "Bearer", "Basic !!", "Basic " + base64.b64encode(b"me:no").decode(), "?"):
            refused(HTTP.get(url + "/", headers={"Authorization": wrong}), 401)
        for right in (f"Bearer {TOKEN}", "Basic " + base64.b64encode(f"me:{TOKEN}".encode()).decode()):
            assert HTTP.get(url + "/info", headers={"Authorization": right}).status_code == 200
        assert HTTP.get(url + "/info", headers={"Host": "map.example", "Authorization": right}).status_code == 200
        assert HTTP.get(url + "/healthz").json() == {"status": "ok"}
        assert HTTP.get(url + "/readyz").json() == {"status": "ready"}
        with Client(url, TOKEN) as client:
            assert len(client.query(asked())) == 50
        with Client(url) as client, pytest.raises(InputError, match="token"):
            client.info()


def test_other_machines_need_a_token(store: Path) -> None:
    with pytest.raises(InputError, match="give a token"):
        serve(Service(store), host="0.0.0.0", port=0)
    with pytest.raises(InputError, match="16 printable"):
        serve(Service(store), port=0, token="short")


def test_names_of_other_machines_are_not_answered(url: str) -> None:
    assert "this machine" in refused(HTTP.get(url + "/info", headers={"Host": "evil.example"}), 421)
    for host in ("localhost", "127.0.0.1:80", "[::1]:8000"):
        assert HTTP.get(url + "/info", headers={"Host": host}).status_code == 200


def test_read_only(store: Path) -> None:
    with running(store, read_only=True) as (url, _):
        assert "--read-only" in refused(post(url, encode_cloud(part(1)), NPZ, "/update"), 409)


@pytest.mark.parametrize("missing", ["fastapi", "uvicorn"])
def test_without_the_extra(missing: str, store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(MissingExtraError, match=r"semgp\[serve\]"):
        serve(Service(store), port=0)
