"""What another web page, another name of this machine, or a guess of the address achieves: nothing."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from fleet2d.viewer.server.application import ServedRuns, page_app
from fleet2d.viewer.server.guard import new_token
from fleet2d.viewer.server.serve import PageServer

TOKEN = "0123456789abcdefghijABCDEFGHIJ01"
PORT = 8765
OWN = f"http://127.0.0.1:{PORT}"
FACTS = f"/{TOKEN}/run/0/facts.json"


@pytest.fixture
def client(run_dir: Path) -> Iterator[TestClient]:
    app = page_app(ServedRuns([run_dir]), TOKEN, PORT)
    with TestClient(app, base_url=OWN) as client:
        yield client


def test_own_page_is_answered(client: TestClient) -> None:
    answer = client.get(FACTS, headers={"Origin": OWN, "Sec-Fetch-Site": "same-origin"})
    assert 200 == answer.status_code
    assert "first" == answer.json()["title"]


@pytest.mark.parametrize(
    "path", ["/", "/session.json", f"/{TOKEN[:-1]}/session.json", "/x/page.js"]
)
def test_address_without_the_token_is_refused(client: TestClient, path: str) -> None:
    answer = client.get(path)
    assert 403 == answer.status_code
    assert "token" in answer.json()["message"]


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:8765", "127.0.0.1:80", "127.0.0.1", ""]
)
def test_other_name_for_this_machine_is_refused(client: TestClient, host: str) -> None:
    assert 403 == client.get(FACTS, headers={"Host": host}).status_code


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "http://127.0.0.1:80", "https://127.0.0.1:8765"]
)
def test_other_page_is_refused_even_with_the_token(client: TestClient, origin: str) -> None:
    assert 403 == client.get(FACTS, headers={"Origin": origin}).status_code


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_request_that_a_browser_marks_as_of_another_site_is_refused(
    client: TestClient, site: str
) -> None:
    assert 403 == client.get(FACTS, headers={"Sec-Fetch-Site": site}).status_code


def test_change_that_names_no_origin_is_refused(client: TestClient) -> None:
    assert 403 == client.post(f"/{TOKEN}/live/order", json={}).status_code


@pytest.mark.parametrize(
    "path",
    [
        "run/0/tables/..%2F..%2Fmanifest.parquet",
        "run/0/tables/%2e%2e%2fmanifest.parquet",
        "run/0/tables/....parquet",
        "..%2f..%2fpyproject.toml",
        "%2e%2e/server.py",
        "sources.sha256",
        "manifest.json",
        "run/0/manifest.json",
        "run/1/facts.json",
        "run/-1/facts.json",
        "run/0/walls/9999.json",
    ],
)
def test_nothing_outside_the_runs_is_served(client: TestClient, path: str) -> None:
    assert client.get(f"/{TOKEN}/{path}").status_code in (404, 422)


def test_every_answer_has_a_strict_policy(client: TestClient) -> None:
    for path in (f"/{TOKEN}/", FACTS, "/", f"/{TOKEN}/nothing"):
        headers = client.get(path).headers
        assert "default-src 'none'" in headers["content-security-policy"]
        assert "unsafe" not in headers["content-security-policy"]
        assert "frame-ancestors 'none'" in headers["content-security-policy"]
        assert "no-referrer" == headers["referrer-policy"]
        assert "access-control-allow-origin" not in headers


def test_server_listens_on_the_loopback_only(run_dir: Path) -> None:
    server = PageServer([run_dir])
    assert "127.0.0.1" == server.listens_at[0]
    assert server.address.startswith("http://127.0.0.1:")
    server.close()


def test_tokens_differ_and_are_long() -> None:
    tokens = {new_token() for _ in range(100)}
    assert 100 == len(tokens)
    assert min(map(len, tokens)) >= 32
