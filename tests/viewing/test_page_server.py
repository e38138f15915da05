"""What another web page, another name of this machine, or a guess of the address achieves: nothing."""

import io
import json
import shutil
import socket
from datetime import timedelta

import numpy as np
import pyarrow.parquet as pq
import pytest
from starlette.testclient import TestClient

import fleet2d
from fleet2d.errors import InputError
from fleet2d.viewing import page_server
from fleet2d.viewing.page_data import PageData
from fleet2d.viewing.page_server import PageServer, kept_token, new_token, page_app
from fleet2d.viewing.served_runs import ServedRuns

TOKEN = "0123456789abcdefghijABCDEFGHIJ01"
PORT = 8765
OWN = f"http://127.0.0.1:{PORT}"
FACTS = f"/{TOKEN}/run/0/facts.json"


@pytest.fixture
def client(run_dir):
    app = page_app(ServedRuns([run_dir]), TOKEN, PORT)
    with TestClient(app, base_url=OWN) as client:
        yield client


def test_own_page_is_answered(client):
    answer = client.get(FACTS, headers={"Origin": OWN, "Sec-Fetch-Site": "same-origin"})
    assert 200 == answer.status_code
    assert "first" == answer.json()["title"]


@pytest.mark.parametrize(
    "path", ["/", "/session.json", f"/{TOKEN[:-1]}/session.json", "/x/page.js"]
)
def test_address_without_the_token_is_refused(client, path):
    answer = client.get(path)
    assert 403 == answer.status_code
    assert "token" in answer.json()["message"]


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:8765", "127.0.0.1:80", "127.0.0.1", ""]
)
def test_other_name_for_this_machine_is_refused(client, host):
    assert 403 == client.get(FACTS, headers={"Host": host}).status_code


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "http://127.0.0.1:80", "https://127.0.0.1:8765"]
)
def test_other_page_is_refused_even_with_the_token(client, origin):
    assert 403 == client.get(FACTS, headers={"Origin": origin}).status_code


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_request_that_a_browser_marks_as_of_another_site_is_refused(client, site):
    assert 403 == client.get(FACTS, headers={"Sec-Fetch-Site": site}).status_code


def test_change_that_names_no_origin_is_refused(client):
    assert 403 == client.post(f"/{TOKEN}/live/0/order", json={}).status_code


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
def test_nothing_outside_the_runs_is_served(client, path):
    assert client.get(f"/{TOKEN}/{path}").status_code in (404, 422)


def test_every_answer_has_a_strict_policy(client):
    for path in (f"/{TOKEN}/", FACTS, "/", f"/{TOKEN}/nothing"):
        headers = client.get(path).headers
        assert "default-src 'none'" in headers["content-security-policy"]
        assert "unsafe" not in headers["content-security-policy"]
        assert "frame-ancestors 'none'" in headers["content-security-policy"]
        assert "no-referrer" == headers["referrer-policy"]
        assert "access-control-allow-origin" not in headers


def test_server_listens_on_the_loopback_only(run_dir):
    server = PageServer([run_dir])
    assert "127.0.0.1" == server.listens_at[0]
    assert server.address.startswith("http://127.0.0.1:")
    server.close()


def test_browser_that_comes_before_the_server_runs_is_not_refused(run_dir):
    server = PageServer([run_dir])
    try:
        socket.create_connection(server.listens_at, timeout=10).close()
    finally:
        server.close()


def test_tokens_differ_and_are_long():
    tokens = {new_token() for _ in range(100)}
    assert 100 == len(tokens)
    assert min(map(len, tokens)) >= 32


def client_of(*sources):
    return TestClient(page_app(ServedRuns(sources), "token", PORT), base_url=f"{OWN}/token/")


@pytest.fixture
def copy(run_dir, tmp_path):
    target = tmp_path / "copy"
    shutil.copytree(run_dir, target)
    return target


def test_page_and_its_parts_are_served(run_dir):
    client = client_of(run_dir)
    assert '<div id="page">' in client.get("").text
    assert client.get("page.js").headers["content-type"].startswith("text/javascript")
    assert client.get("page.css").headers["content-type"].startswith("text/css")


def test_facts_are_those_of_the_run(run_dir):
    facts = client_of(run_dir).get("run/0/facts.json").json()
    run = fleet2d.open_run(run_dir)
    assert run.digest == facts["digest"]
    assert run.manifest["steps"] == facts["steps"] == facts["end_step"]
    assert [room.name for room in run.plan.rooms] == [
        room["name"] for room in facts["home"]["rooms"]
    ]
    assert ["bath_door", "office_door"] == [door["name"] for door in facts["home"]["doors"]]
    roles = {table["name"]: table["role"] for table in facts["tables"]}
    assert ("algorithm", "layer", "log", "metric") == (
        roles["ltp"], roles["layer.dust"], roles["events"], roles["room_share"],
    )  # fmt: skip


def test_part_of_a_table_is_served_by_range(run_dir):
    answer = client_of(run_dir).get("run/0/tables/events.parquet", headers={"Range": "bytes=0-3"})
    assert 206 == answer.status_code
    assert b"PAR1" == answer.content


def test_walls_change_when_a_door_moves(run_dir):
    data = PageData(fleet2d.open_run(run_dir))
    changes = data.facts["walls"]
    assert len(changes) > 3
    assert 0 == changes[0]["step"]
    assert [c["step"] for c in changes] == sorted({c["step"] for c in changes})
    assert len(data.all_walls()) <= 4
    walls = [sum(n < 0 for n in each["neighbors"]) for each in data.all_walls()]
    assert len(set(walls)) > 1


def test_sightings_cover_the_observations(run_dir):
    run = fleet2d.open_run(run_dir)
    lane = PageData(run).sightings[0]
    steps = run.tables["observations"]["step"].to_pylist()
    stretch = np.searchsorted(lane["first"], steps, side="right") - 1
    assert (stretch >= 0).all()
    assert (steps <= np.array(lane["last"])[stretch]).all()
    assert not any(lane["false"])
    ghosts = "robots.astro.camera.perception={false_positives: {per_hour: 30}}"
    unsure = fleet2d.run("bundled:paper", "simulation.duration=6 h", ghosts, seed=3)
    assert any(any(lane["false"]) for lane in PageData(unsure).sightings)


def test_random_walks_are_sent_as_positions(tmp_path):
    alone = ("users.ana={type: meander}", "robots=null", "algorithms=null", "metrics=null")
    run = fleet2d.run("bundled:paper", "simulation.duration=1 h", *alone)
    data = PageData(run)
    assert 1.0 == data.facts["walks_every_s"]
    poses = pq.read_table(data.table_path("poses"))
    assert run.path("ana", timedelta(seconds=1)).x.tolist() == poses["x"].to_pylist()
    client = client_of(data)  # a run in memory is served like a stored one
    assert data.facts["title"] == client.get("run/0/facts.json").json()["title"]
    assert b"PAR1" == client.get("run/0/tables/key_frames.parquet").content[:4]


@pytest.mark.parametrize(
    ("file", "content", "words"),
    [
        ("manifest.json", b"{", "damaged"),
        ("manifest.json", b'{"format": 99}', "later Fleet2D"),
        ("floorplan.json", None, "missing"),
        ("floorplan.json", b"[]", "floorplan.json"),
    ],
)
def test_damaged_run_is_refused_with_a_message(copy, file, content, words):
    path = copy / file
    if content is None:
        path.unlink()
    else:
        path.write_bytes(content)
    answer = client_of(copy).get("run/0/facts.json")
    assert 422 == answer.status_code
    assert words in answer.json()["message"]


def test_damaged_table_is_noted_and_the_rest_shown(copy):
    (copy / "events.parquet").write_bytes(b"PAR1")
    answer = client_of(copy).get("run/0/facts.json")
    assert 200 == answer.status_code
    assert any("events" in note for note in answer.json()["notes"])


def test_unfinished_run_is_shown_as_far_as_it_goes(copy):
    manifest = json.loads((copy / "manifest.json").read_text())
    manifest |= {"status": "running", "digest": None, "tables": {}}
    (copy / "manifest.json").write_text(json.dumps(manifest))
    (copy / "observations.parquet").rename(copy / "observations.parquet.partial")
    facts = client_of(copy).get("run/0/facts.json").json()
    assert "running" == facts["status"]
    assert "observations" not in [table["name"] for table in facts["tables"]]
    assert any("cut off" in note for note in facts["notes"])
    assert [] != next(t for t in facts["tables"] if t["name"] == "events")["columns"]


def test_tables_of_a_run_that_was_cut_off_are_served_from_its_journal(tmp_path):
    out = tmp_path / "cut"
    simulation = fleet2d.Simulation(
        "bundled:paper", "simulation.duration=6 h", "artifacts.checkpoint=1 h", seed=4, out=out
    )
    simulation.advance(4 * 3600)
    copied = shutil.copytree(out, tmp_path / "copied")  # as a crash would leave it
    simulation.finish()
    client = client_of(copied)
    facts = client.get("run/0/facts.json").json()
    assert "running" == facts["status"]
    for name in ("key_frames", "events", "observations"):
        answer = client.get(f"run/0/tables/{name}.parquet")
        assert 200 == answer.status_code
        complete = pq.read_table(out / f"{name}.parquet")["step"].to_pylist()
        steps = pq.read_table(io.BytesIO(answer.content))["step"].to_pylist()
        assert 0 < len(steps) <= len(complete)
        assert complete[: len(steps)] == steps or "key_frames" == name


@pytest.fixture
def state(tmp_path, monkeypatch):
    """The state folder of a user."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state" / "fleet2d" / "view-token"


def test_a_link_stays_valid_as_the_token_is_kept_where_only_the_user_reads_it(state):
    """A link to a moment was dead as soon as `fleet2d view` was started again."""
    assert kept_token() == kept_token() == state.read_text()
    assert state.stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize("damage", ["others read it", "short", "link", "folder is a file"])
def test_a_kept_token_that_cannot_be_trusted_is_not_used(state, damage):
    if damage == "folder is a file":
        state.parent.parent.write_text("")
    else:
        kept = kept_token()
        if damage == "others read it":
            state.chmod(0o644)
        elif damage == "short":
            state.write_text("short")
        else:
            other = state.with_name("other")
            state.rename(other)
            state.symlink_to(other)
        assert kept_token() != kept
    assert kept_token() != kept_token()
    assert len(kept_token()) >= 32


def test_a_page_behind_a_tunnel_or_proxy_answers_under_the_stated_address_only(run_dir):
    app = page_app(ServedRuns([run_dir]), "token", PORT, seen_at="https://robots.example/fleet2d")
    at = {url: TestClient(app, base_url=url) for url in ("https://robots.example", "http://evil")}
    assert at["https://robots.example"].get("/token/session.json").status_code == 200
    refused = at["http://evil"].get("/token/session.json")
    assert refused.status_code == 403
    assert "--seen-at" in refused.json()["message"]


def test_what_is_no_address_of_a_proxy_is_refused(run_dir):
    with pytest.raises(InputError, match="http://localhost:9000"):
        PageServer([run_dir], seen_at="localhost:9000")


@pytest.mark.parametrize(("opens", "said"), [(True, False), (False, True)])
def test_no_browser_is_said_with_what_helps(opens, said, monkeypatch):
    monkeypatch.setattr(page_server.webbrowser, "open", lambda _: opens)
    monkeypatch.setattr(PageServer, "run", lambda _: None)
    lines = []
    server = PageServer([])
    server.show(open_browser=True, announce=lines.append)
    server.close()
    assert server.address in lines[0]
    assert said == (page_server.NO_BROWSER in lines)
