"""Guessing a password is slowed down, and locks out nobody else."""

import asyncio
import time

import httpx
import pytest

from db.fault import StoreUnavailableError
from server.access import (
    access,
    failure,
    throttle,
)
from server.base.problem import Problem
from tests.server.conftest import until
from tests.server.station_app import (
    BASE_URL,
    PASSWORD,
)


async def test_guessing_a_password_is_slowed_down(admin, anyone):
    wrong = {"name": "ann", "password": "not the password"}
    for _ in range(throttle.FREE_FAILURES):
        assert (await anyone.post("/api/session", json=wrong)).status_code == 401
    answer = await anyone.post("/api/session", json={"name": "ann", "password": PASSWORD})
    assert answer.status_code == 429
    assert int(answer.headers["Retry-After"]) > 0


async def test_many_tries_at_once_are_no_way_around(admin, anyone):
    wrong = {"name": "ann", "password": "not the password"}
    answers = await asyncio.gather(*(anyone.post("/api/session", json=wrong) for _ in range(30)))
    looked_at = [answer.status_code for answer in answers if answer.status_code != 429]
    assert len(looked_at) <= throttle.FREE_FAILURES


async def test_a_stranger_locks_out_neither_who_was_here_before_nor_who_comes_from_elsewhere(
    app, admin, anyone
):
    right = {"name": "ann", "password": PASSWORD}
    for _ in range(throttle.FREE_FAILURES + 1):
        await anyone.post("/api/session", json={"name": "ann", "password": "not the password"})
    assert (await anyone.post("/api/session", json=right)).status_code == 429
    assert (await admin.post("/api/session", json=right)).status_code == 200
    elsewhere = httpx.ASGITransport(app, client=("192.0.2.7", 9))
    async with httpx.AsyncClient(transport=elsewhere, base_url=BASE_URL) as client:
        assert (await client.post("/api/session", json=right)).status_code == 200


async def test_a_forged_mark_of_a_browser_is_none(admin, anyone):
    right = {"name": "ann", "password": PASSWORD}
    for _ in range(throttle.FREE_FAILURES):
        await anyone.post("/api/session", json={"name": "ann", "password": "not the password"})
    for mark in ("", "x", "x.y", "\u00e9.y", admin.cookies["grace_known_8000"][:-1]):
        headers = {"Cookie": f"grace_known_8000={mark}".encode()}
        assert (await anyone.post("/api/session", json=right, headers=headers)).status_code == 429


async def test_one_address_tries_few_names(anyone):
    answers = [
        await anyone.post("/api/session", json={"name": f"n{number}", "password": "x"})
        for number in range(throttle.FREE_FAILURES_OF_ADDRESS + 1)
    ]
    assert [answer.status_code for answer in answers[-2:]] == [401, 429]


@pytest.fixture
def time_s(monkeypatch):
    """What the throttle's clock says, to be set."""
    now_s = [1000.0]
    monkeypatch.setattr(throttle, "monotonic_s", lambda: now_s[0])
    return now_s


def test_a_count_to_which_nothing_is_added_is_forgotten(time_s):
    door, keys = throttle.Throttle(), throttle.Origin.of("192.0.2.1").keys("ann")
    for _ in range(throttle.FREE_FAILURES):
        door.reserve(keys)
    time_s[0] += throttle.FORGOTTEN_S
    door.reserve(keys)
    with pytest.raises(Problem):
        door.reserve(keys)
    time_s[0] += throttle.FORGOTTEN_S + 1
    for _ in range(throttle.FREE_FAILURES):
        door.reserve(keys)
    with pytest.raises(Problem):
        door.reserve(keys)


def test_who_signs_in_does_not_prolong_the_pause_of_an_address(time_s):
    door, origin = throttle.Throttle(), throttle.Origin.of("192.0.2.1")
    for number in range(throttle.FREE_FAILURES_OF_ADDRESS - 1):
        door.reserve(origin.keys(f"n{number}"))
    time_s[0] += 1.0
    ann = door.reserve(origin.keys("ann"))
    time_s[0] += 1.0
    door.succeeded(ann)
    door.reserve(origin.keys("bob"))
    time_s[0] += throttle.PAUSE_S
    cid = door.reserve(origin.keys("cid"))
    with pytest.raises(Problem):
        door.reserve(origin.keys("dan"))
    door.give_back(cid)
    door.succeeded(door.reserve(origin.keys("cid")))
    door.reserve(origin.keys("dan"))
    with pytest.raises(Problem):
        door.reserve(origin.keys("eve"))


def test_what_fails_while_another_is_judged_keeps_its_own_moment(time_s):
    door, origin = throttle.Throttle(), throttle.Origin.of("192.0.2.1")
    ann = door.reserve(origin.keys("ann"))
    for number in range(throttle.FREE_FAILURES_OF_ADDRESS):
        time_s[0] += 1.0
        if number < throttle.FREE_FAILURES_OF_ADDRESS - 1:
            door.reserve(origin.keys(f"n{number}"))
    door.give_back(ann)
    door.reserve(origin.keys("bob"))
    with pytest.raises(Problem):
        door.reserve(origin.keys("cid"))


async def test_a_try_whose_password_was_not_judged_does_not_count(admin, anyone, monkeypatch):
    right = {"name": "ann", "password": PASSWORD}

    def broken(*_):
        raise StoreUnavailableError("The disk is full.")

    with monkeypatch.context() as harm:
        harm.setattr(throttle, "HASHES_WAITING", -throttle.HASHES_AT_ONCE)
        for _ in range(throttle.FREE_FAILURES):
            assert (await anyone.post("/api/session", json=right)).status_code == 503
    with monkeypatch.context() as harm:
        harm.setattr(access.query, "find_person", broken)
        for _ in range(throttle.FREE_FAILURES):
            assert (await anyone.post("/api/session", json=right)).status_code == 503
    assert (await anyone.post("/api/session", json=right)).status_code == 200


def test_a_network_of_ipv6_is_one_address():
    assert throttle.Origin.of("2001:db8::1") == throttle.Origin.of("2001:db8::2:1")
    assert throttle.Origin.of("192.0.2.1") != throttle.Origin.of("192.0.2.2")


async def test_few_passwords_are_looked_at_at_once():
    gate, running, most = throttle.HashGate(), [], []

    def work():
        running.append(1)
        most.append(len(running))
        time.sleep(0.01)
        running.pop()

    many = throttle.HASHES_AT_ONCE + throttle.HASHES_WAITING
    results = await asyncio.gather(
        *(gate.run(work) for _ in range(many + 5)), return_exceptions=True
    )
    assert [error.status for error in results if error is not None] == [503] * 5
    assert max(most) <= throttle.HASHES_AT_ONCE


async def test_failures_stand_in_the_log_and_many_are_an_alarm(app, admin, anyone, monkeypatch):
    monkeypatch.setattr(throttle, "FREE_FAILURES_OF_ADDRESS", 100)
    names = ["ann", *(f"n{number}" for number in range(failure.MANY - 1))]
    for name in names:
        await anyone.post("/api/session", json={"name": name, "password": "not the password"})
    events = (await admin.get("/api/events")).json()["events"]
    texts = [event["text"] for event in events if event["kind"] == "person.sign_in_failed"]
    assert len(texts) == failure.MANY
    assert texts[0] == "A sign-in by the name ann from 127.0.0.1 failed."
    assert texts[1] == "A sign-in by nobody's name from 127.0.0.1 failed."
    alarms = app.state.foundation.alarms
    await until(lambda: [alarm.cause for alarm in alarms.open] == [failure.CAUSE])
