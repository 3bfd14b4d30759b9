"""What the station logs, and what never stands there."""

import json
import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sqlalchemy import text as sql
from sqlalchemy.exc import OperationalError

from db.engine import write_engine
from server.access.role import Role
from server.watch.console import without_secrets
from server.watch.log import FILE, FILES, JsonLines, logged_to_files
from tests.server.station_app import bearer, client_of, running, token_of

ROOM = 100_000
_TOKEN = "grace_" + "Q" * 43
_WORD = "hunter2"


@contextmanager
def logged(folder: Path, limit_bytes: int = ROOM) -> Iterator[Path]:
    root, own_client = logging.getLogger(), logging.getLogger("httpx")
    before = root.level
    root.setLevel(logging.INFO)
    own_client.setLevel(logging.WARNING)
    try:
        with logged_to_files(folder / "log", limit_bytes):
            yield folder / "log" / FILE
    finally:
        root.setLevel(before)
        own_client.setLevel(logging.NOTSET)


def figure_of(scrape: str, name: str) -> float:
    (line,) = (line for line in scrape.splitlines() if line.startswith(f"{name} "))
    return float(line.split()[1])


def lines_of(file: Path) -> list[dict[str, object]]:
    return [json.loads(line) for line in file.read_text().splitlines()]


async def test_a_request_is_found_in_the_log_by_the_id_of_its_answer(tmp_path: Path):
    with logged(tmp_path) as file:
        async with running(tmp_path) as app:
            token = await token_of(app, Role.VIEWER, "eve")
            async with client_of(app, headers=bearer(token)) as client:
                answers = [
                    await client.get("/api/events?after=0&token=" + _TOKEN),
                    await client.get("/api/nothing/" + _TOKEN),
                    await client.get("/api/events", headers={"X-Request-ID": "proxy-4711"}),
                    await client.get("/api/events", headers={"X-Request-ID": "<b>not plain</b>"}),
                ]
    ids = [answer.headers["X-Request-ID"] for answer in answers]
    assert ids[2] == "proxy-4711"
    assert "<" not in ids[3]
    assert answers[1].status_code == 404
    found = {line.get("request_id"): line for line in lines_of(file)}
    first, unknown = found[ids[0]], found[ids[1]]
    assert first["route"] == "/api/events"
    assert first["status"] == 200
    assert first["person"] == "eve"
    assert first["level"] == "info"
    assert str(first["time"]).endswith("+00:00")
    assert unknown["status"] == 404
    text = file.read_text()
    assert _TOKEN not in text
    assert token not in text
    assert "after=0" not in text


async def test_a_failure_is_logged_with_the_id_that_its_answer_has(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    with logged(tmp_path) as file:
        async with running(tmp_path) as app:
            token = await token_of(app, Role.VIEWER)

            def fail() -> None:
                raise RuntimeError(f"the address was /x?ticket={_TOKEN}")

            monkeypatch.setattr(app.state.foundation.metrics, "text", lambda store: fail())
            async with client_of(app, headers=bearer(token)) as client:
                answer = await client.get("/metrics")
    assert answer.status_code == 500
    request = answer.headers["X-Request-ID"]
    told = [line for line in lines_of(file) if line.get("request_id") == request]
    assert {line["logger"] for line in told} >= {"grace.request", "server.base.problem"}
    (failure,) = [line for line in told if "exception" in line]
    assert "ticket=(secret)" in str(failure["exception"])
    assert _TOKEN not in file.read_text()


def test_files_together_never_grow_beyond_the_limit(tmp_path: Path):
    with logged(tmp_path) as file:
        for number in range(5_000):
            logging.getLogger("grace.test").info("line %d says something", number)
    files = sorted(file.parent.glob(f"{FILE}*"))
    assert len(files) == FILES
    assert sum(each.stat().st_size for each in files) <= ROOM
    assert {each.stat().st_mode & 0o077 for each in files} == {0}
    assert "line 4999" in lines_of(file)[-1]["message"].__str__()


@pytest.mark.parametrize(
    "text",
    [
        f"GET /sign-in?token={_TOKEN}&next=1",
        f"Authorization: Bearer {_TOKEN}",
        f"/api/gateways/rockblock/push/{_TOKEN}",
        f"/ack/{_TOKEN}",
        f"the script sent {_TOKEN} twice",
        f"password={_TOKEN}",
        f"https://example.org/hook?key={_TOKEN}",
        f'password="{_WORD}"',
        f"password='{_WORD} of two words'",
        f"api_key=b'{_WORD}'",
        f'{{"password": "{_WORD}", "name": "ann"}}',
        f"input_value={{'password': '{_WORD}'}}",
        json.dumps(json.dumps({"token": _WORD})),
        f"postgresql+psycopg://grace:{_WORD}@db.example/grace",
        f"redis://:{_WORD}@127.0.0.1",
        f"postgresql://grace@db.example/grace?password={_WORD}",
    ],
)
def test_what_lets_somebody_in_is_never_logged(text: str):
    line = JsonLines().format(logging.makeLogRecord({"msg": text, "note": text, "more": [text]}))
    assert json.loads(line).keys() >= {"message", "note", "more"}
    for told in (without_secrets(text), line):
        assert _TOKEN not in told
        assert _WORD not in told
        assert "words" not in told
        assert "(secret)" in told


@pytest.mark.parametrize(
    "text",
    ["GET http://127.0.0.1:8000/api/health 200", "the token of mini-1 ran out: ask", "key: none"],
)
def test_what_is_no_secret_is_logged_as_it_is(text: str):
    assert without_secrets(text) == text


@given(st.text(alphabet=st.sampled_from("ab=:@/\\'\" {}é\n") | st.characters(codec="utf-8")))
def test_a_line_is_json_beside_whatever_secret(text: str):
    line = JsonLines().format(logging.makeLogRecord({"msg": f"password={text}", "note": text}))
    assert "\n" not in line
    assert json.loads(line).keys() >= {"message", "note"}


def test_numbers_stay_numbers_in_a_line():
    record = logging.makeLogRecord({"msg": "x", "status": 404, "duration_ms": 0.5, "is_old": True})
    line = json.loads(JsonLines().format(record))
    assert (line["status"], line["duration_ms"], line["is_old"]) == (404, 0.5, True)


def test_values_that_go_to_the_database_are_in_no_traceback(tmp_path: Path):
    engine = write_engine(f"sqlite:///{tmp_path / 'a.db'}")
    with engine.connect() as connection, pytest.raises(OperationalError) as failed:
        connection.execute(sql("INSERT INTO nowhere VALUES (:word)"), {"word": _WORD})
    engine.dispose()
    assert _WORD not in str(failed.value)


async def test_lines_that_a_stuck_disk_makes_the_log_drop_are_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    goes_on = threading.Event()
    monkeypatch.setattr("server.watch.log.WAITING_MAX", 5)
    monkeypatch.setattr("server.watch.log._Files.emit", lambda *_: goes_on.wait())
    name = "grace_log_lines_dropped_total"
    async with running(tmp_path, metrics_on_loopback=True) as app, client_of(app) as client:
        with logged(tmp_path):
            try:
                before = figure_of((await client.get("/metrics")).text, name)
                for number in range(100):
                    logging.getLogger("grace.test").info("line %d", number)
                after = figure_of((await client.get("/metrics")).text, name)
            finally:
                goes_on.set()
    assert before == 0.0
    assert after >= 100 - 5 - 1


def test_a_line_is_json_whatever_it_holds():
    record = logging.makeLogRecord(
        {
            "msg": 'a "quote",\na new line and %s',
            "args": ("µ",),
            "robot": "mini-1",
            "levelname": "INFO",
        }
    )
    line = JsonLines().format(record)
    assert "\n" not in line
    assert json.loads(line)["robot"] == "mini-1"
    assert json.loads(line)["message"] == 'a "quote",\na new line and µ'
