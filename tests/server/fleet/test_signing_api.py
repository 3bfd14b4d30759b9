"""A robot's signing key: made with the robot, shown once, replaced and ended by an admin."""

import sqlite3
from contextlib import contextmanager
from dataclasses import replace

import pytest
import segno
from sqlalchemy import event
from sqlalchemy.exc import OperationalError

from db.query.fleet.robots import add_robot
from robot_link.messages import RobotId
from server.access.role import Role
from server.base.secret import SecretStore
from server.fleet.signing_route import shown_key
from tests.server.conftest import MINI, api_client
from tests.server.fleet.test_robot_api import NEW_ROBOT

NEW = RobotId("mini-2")


def secrets_of(station) -> SecretStore:
    return station.foundation.secrets


def new_robot(station, **more: object) -> dict[str, object]:
    site = station.fleet.status(MINI).record.site.model_dump(mode="json")
    return {**NEW_ROBOT, "site": site, **more}


@contextmanager
def commits_fail(station):
    """Every change is made, and then the disk refuses to commit it."""

    def fail(_: object) -> None:
        raise OperationalError("COMMIT", {}, sqlite3.OperationalError("disk I/O error"))

    engine = station.foundation.store._write_engine
    event.listen(engine, "commit", fail)
    try:
        yield
    finally:
        event.remove(engine, "commit", fail)


def secret_files(station) -> dict[str, bytes]:
    folder = station.foundation.settings.secret_dir
    return {file.name: file.read_bytes() for file in folder.iterdir()}


def drawn(text: str) -> list[str]:
    """Return a QR code of 33 modules within a margin of 4, checked by its three corners."""
    size, margin = 33, "0" * 41
    code = segno.make(text.upper(), version=4)
    rows = ["".join(map(str, row)) for row in code.matrix]
    corner = ["1111111", "1000001", "1011101", "1011101", "1011101", "1000001", "1111111"]
    assert [row[:7] for row in rows[:7]] == corner
    assert [row[-7:] for row in rows[:7]] == corner
    assert [row[:7] for row in rows[-7:]] == corner
    assert len(rows) == size
    return [margin] * 4 + [f"0000{row}0000" for row in rows] + [margin] * 4


async def test_the_key_of_a_new_robot_is_shown_once_as_text_and_as_qr_code(client, station):
    added = (await client.post("/api/robots", json=new_robot(station))).json()
    shown = added["signing_key"]
    assert bytes.fromhex(shown["key"]) == secrets_of(station).signing_key(NEW)
    assert shown["qr"] == drawn(shown["key"])
    everything = [
        await client.get(path)
        for path in ("/api/robots", f"/api/robots/{NEW}", "/api/signing", "/api/events")
    ]
    assert not [one.url for one in everything if shown["key"] in one.text]
    states = {one["robot"]: one["state"] for one in everything[2].json()["robots"]}
    assert states == {MINI: "undecided", "grace-1": "undecided", NEW: "on"}


async def test_a_repeated_request_is_not_shown_the_key_and_the_database_does_not_have_it(
    client, station, tmp_path
):
    headers = {"Idempotency-Key": "add it once"}
    body = new_robot(station)
    first, second = [
        (await client.post("/api/robots", json=body, headers=headers)) for _ in range(2)
    ]
    key = first.json()["signing_key"]["key"]
    assert second.headers["Idempotent-Replayed"] == "true"
    assert second.json()["signing_key"] is None
    assert {**first.json(), "signing_key": None}.keys() == second.json().keys()
    files = [one for one in tmp_path.rglob("*") if one.is_file() and "secret" not in one.parts]
    assert files
    assert not [one for one in files if key.encode() in one.read_bytes()]


async def test_a_robot_that_exists_keeps_its_key_when_it_is_added_again(client, station):
    await client.post("/api/robots", json=new_robot(station))
    key = secrets_of(station).signing_key(NEW)
    assert (await client.post("/api/robots", json=new_robot(station))).status_code == 409
    assert secrets_of(station).signing_key(NEW) == key


async def test_signing_is_off_only_where_somebody_said_so(client, station):
    added = (await client.post("/api/robots", json=new_robot(station, signing=False))).json()
    assert added["signing_key"] is None
    assert secrets_of(station).is_signing_off(NEW)


async def test_a_new_key_ends_the_old_one_and_signing_can_be_turned_off(client, station):
    first = (await client.post(f"/api/robots/{MINI}/signing-key")).json()["key"]
    answer = await client.post(f"/api/robots/{MINI}/signing-key")
    assert answer.status_code == 201
    assert answer.json()["key"] != first
    assert secrets_of(station).signing_key(MINI).hex() == answer.json()["key"]
    off = await client.delete(f"/api/robots/{MINI}/signing-key")
    assert off.json() == {"robot": MINI, "state": "off", "fault": None}
    texts = [event["text"] for event in (await client.get("/api/events")).json()["events"]]
    assert any("turned signing off for mini-1" in text for text in texts)
    assert sum("made a new signing key for mini-1" in text for text in texts) == 2


async def test_a_damaged_key_is_told_and_a_new_one_mends_it(client, station):
    secrets_of(station).new_signing_key(MINI)
    file = station.foundation.settings.secret_dir / f"signing-{MINI}"
    file.write_text("no key")
    (told,) = [
        one for one in (await client.get("/api/signing")).json()["robots"] if one["robot"] == MINI
    ]
    assert told["state"] == "unreadable"
    assert f"signing-{MINI} does not hold 32 bytes" in told["fault"]
    assert (await client.post(f"/api/robots/{MINI}/signing-key")).status_code == 201


@pytest.mark.parametrize("name", ["signing", "stamps"])
async def test_a_file_that_cannot_be_read_is_named_but_not_where_it_is(client, station, name):
    if name == "stamps":
        secrets_of(station).new_signing_key(MINI)
    (station.foundation.settings.secret_dir / f"{name}-{MINI}").mkdir()
    (told,) = [
        one for one in (await client.get("/api/signing")).json()["robots"] if one["robot"] == MINI
    ]
    assert told == {
        "robot": MINI,
        "state": "unreadable",
        "fault": f"secret/{name}-{MINI}: Is a directory.",
    }


@pytest.mark.parametrize("changes", [{"system_id": 9}, {"links": ["xbee://127.0.0.1:9"]}])
async def test_a_recording_gets_no_radio_without_a_decision_on_its_signing(
    client, station, changes
):
    record = replace(
        station.fleet.status(MINI).record,
        id=RobotId("eva-035"),
        kind="recorded",
        system_id=None,
        links=(),
    )
    await station.foundation.store.write(lambda session: add_robot(session, record))
    await station.refresh(record.id)
    refused = await client.patch(f"/api/robots/{record.id}", json={"name": "Eva", **changes})
    assert refused.status_code == 409
    assert refused.json()["detail"] == "eva-035 is a recording; it has no radio."
    assert station.fleet.status(record.id).record == record
    renamed = await client.patch(f"/api/robots/{record.id}", json={"name": "Eva"})
    assert renamed.json()["name"] == "Eva"


def test_a_key_is_not_shown_in_its_own_words():
    shown = shown_key(MINI, bytes(range(32)))
    assert shown.key not in repr(shown)
    assert shown.qr[9] not in repr(shown)


@pytest.mark.parametrize("role", [Role.VIEWER, Role.PILOT])
async def test_only_an_administrator_makes_and_ends_keys(station, role):
    path = f"/api/robots/{MINI}/signing-key"
    async with api_client(station, role) as caller:
        answers = [
            await caller.post(path),
            await caller.delete(path),
            await caller.get("/api/signing"),
        ]
    assert [answer.status_code for answer in answers] == [403, 403, 403]
    assert secrets_of(station).signing_key(MINI) is None


async def test_nobody_makes_a_key_for_a_robot_that_does_not_exist(client, station):
    assert (await client.post("/api/robots/nobody/signing-key")).status_code == 404
    assert secrets_of(station).signing_key("nobody") is None


@pytest.mark.parametrize("method", ["POST", "DELETE"])
@pytest.mark.parametrize("had", ["nothing", "off", "damaged", "key"])
async def test_a_decision_that_is_not_committed_leaves_the_key_as_it_was(
    client, station, method, had
):
    file = station.foundation.settings.secret_dir / f"signing-{MINI}"
    if had == "key":
        secrets_of(station).new_signing_key(MINI)
        secrets_of(station).signing_marks(MINI).write_text('{"stamp": 5, "streams": []}')
    elif had != "nothing":
        file.write_text({"off": "off", "damaged": "no key"}[had])
    before = secret_files(station)
    with commits_fail(station):
        for _ in range(2):
            answer = await client.request(method, f"/api/robots/{MINI}/signing-key")
            assert answer.status_code == 503
            assert "Try again when it works" in answer.json()["detail"]
    assert secret_files(station) == before
    answer = await client.request(method, f"/api/robots/{MINI}/signing-key")
    assert answer.is_success
    assert secret_files(station).keys() == {*before, file.name} - {f"stamps-{MINI}"}


@pytest.mark.parametrize("signing", [True, False])
async def test_a_robot_that_is_not_added_has_no_decision(client, station, signing):
    before = secret_files(station)
    body = new_robot(station, signing=signing)
    with commits_fail(station):
        assert (await client.post("/api/robots", json=body)).status_code == 503
    assert secret_files(station) == before
    assert (await client.post("/api/robots", json=body)).status_code == 201
    assert secret_files(station).keys() == {*before, f"signing-{NEW}"}
