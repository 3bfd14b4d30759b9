"""Messages from robots, orders to them, and plugs: what a satellite link does beside plans."""

from dataclasses import replace
from datetime import UTC, datetime

import pytest
from sqlalchemy import select

from db.query.measured.samples import newest_samples
from db.query.station.events import newest_events
from db.tables import RawFrameRow
from robot_link.messages import (
    LinkState,
    LogId,
    OnboardPlanState,
    RobotMode,
    Sample,
)
from robot_link.station.gateway.gateway import HeldBackError
from tests.server.conftest import GRACE, until
from tests.server.far import (
    LINKS,
    PLUG,
    RADIO,
    far_station,
    order,
    settled,
)
from tests.server.sky import URI, Caller

pytestmark = pytest.mark.usefixtures("no_radio")


async def test_robot_heard_by_satellite_is_heard(far, sky, robot):
    station, client = far
    found = (await client.get("/api/robots/grace-1/state")).json()
    assert found["link"]["carrier"] == "rockblock"
    assert found["position"]["ned_m"] == [150.0, 150.0, 0.0]
    links = {one["kind"]: one for one in (await client.get("/api/robots/grace-1/links")).json()}
    assert links["satellite"]["state"] == "live"
    assert links["satellite"]["carries"] == ["plan", "command", "surface"]
    assert links["radio"]["state"] == "never_heard"
    await station.satellite.refresh()
    due = (await client.get("/api/robots/grace-1/satellite")).json()["next_session_at"]
    assert due is not None


async def test_state_of_the_link_follows_the_last_session(far, sky, robot):
    station, client = far

    async def state():
        await station.satellite.refresh()
        return (await client.get("/api/robots/grace-1/links")).json()[1]["state"]

    sky.clock.advance(minutes=70)
    assert await state() == "stale"
    robot.mode = RobotMode.DIVING
    await robot.call()
    await settled(station)
    assert await state() == "submerged"


async def test_samples_by_satellite_are_stored_and_told_like_radios(far, sky, robot, world):
    station, _client = far
    now = sky.clock.now()
    robot.samples = tuple(
        Sample(
            GRACE,
            LogId(4),
            number,
            "temperature",
            11.0 + number,
            (150.0, 150.0, 1.0),
            2.0,
            now,
            now,
        )
        for number in range(3)
    )
    await robot.call()
    await settled(station)
    stored = await station.foundation.store.query(lambda session: newest_samples(session, GRACE))
    assert [one.value for one in stored] == [pytest.approx(13.0, abs=0.05)]
    assert {number for _, log, number in world.acknowledged if log == 4} == {0, 1, 2}


async def test_message_that_comes_twice_has_an_effect_once(far, sky, robot):
    station, client = far
    said = robot.message()
    assert await sky.deliver(said) is True
    assert await sky.deliver(said) is False
    await settled(station)
    incoming = (await client.get("/api/robots/grace-1/satellite")).json()["incoming"]
    assert [one["is_duplicate"] for one in incoming] == [True, False]
    assert len(incoming) == 2


async def test_old_record_under_a_new_number_proves_nothing(far, sky, robot):
    station, client = far
    robot.position_ned = (170.0, 160.0, 0.0)
    old = robot.message()
    await sky.deliver(old)
    await settled(station)
    robot.position_ned = (180.0, 160.0, 0.0)
    sky.clock.advance(minutes=30)
    await robot.call()
    await settled(station)
    later = replace(old, momsn=old.momsn + 9, session_at=sky.clock.now())
    assert await sky.deliver(later) is True
    await settled(station)
    assert station.fleet.status(GRACE).state.position_ned[0] == 180.0
    newest = (await client.get("/api/robots/grace-1/satellite")).json()["incoming"][0]
    assert newest["is_decoded"] is False
    assert "heard before" in newest["text"]


@pytest.mark.parametrize("data", [b"\x13garbage", bytes(200), b"hello"])
async def test_message_that_cannot_be_read_is_kept_and_flagged(far, sky, robot, data):
    station, client = far
    assert await sky.deliver(robot.message(data=data)) is True
    newest = (await client.get("/api/robots/grace-1/satellite")).json()["incoming"][0]
    assert (newest["is_decoded"], newest["bytes"]) == (False, len(data))
    events = await station.foundation.store.query(newest_events)
    assert any(event.kind == "satellite.undecoded" for event in events)


async def test_payload_that_the_gateway_garbled_is_flagged_with_its_reason(far, sky, robot):
    _, client = far
    said = replace(robot.message(data=b"zz"), fault="the data is no hexadecimal text")
    assert await sky.deliver(said) is True
    newest = (await client.get("/api/robots/grace-1/satellite")).json()["incoming"][0]
    assert newest["text"] == "the data is no hexadecimal text"
    assert newest["is_decoded"] is False


async def test_empty_message_is_legal_and_stranger_is_kept(far, sky, robot):
    _station, client = far
    assert await sky.deliver(robot.message(data=b"")) is True
    newest = (await client.get("/api/robots/grace-1/satellite")).json()["incoming"][0]
    assert newest["is_decoded"] is True
    stranger = robot.message(imei="300234010000009")
    assert await sky.deliver(stranger) is True
    assert await sky.deliver(stranger) is False


async def test_message_that_was_not_passed_on_is_passed_on_after_a_restart(
    tmp_path, world, sky, robot, monkeypatch
):
    async with far_station(tmp_path, world, sky, monkeypatch) as (station, _):
        monkeypatch.setattr(station.satellite, "_pass_on", lambda *_: None)
        robot.position_ned = (170.0, 160.0, 0.0)
        await robot.call()
        assert station.fleet.status(GRACE).state is None
    async with far_station(tmp_path, world, sky, monkeypatch) as (station, client):
        await settled(station)
        assert station.fleet.status(GRACE).state.position_ned[:2] == (170.0, 160.0)
        assert len((await client.get("/api/robots/grace-1/satellite")).json()["incoming"]) == 1


async def test_late_word_on_the_plan_takes_nothing_back(far, sky, robot):
    station, _ = far
    late = robot.message()
    sky.clock.advance(minutes=5)
    robot.plan_state = OnboardPlanState.DONE
    await robot.call()
    await settled(station)
    await sky.deliver(replace(late, arrived_at=sky.clock.now()))
    await settled(station)
    assert station.fleet.status(GRACE).plan_report.state is OnboardPlanState.DONE


async def test_unplugged_satellite_sends_nothing_and_takes_nothing(far, sky, robot):
    station, client = far
    links = (await client.post(PLUG, json={"uri": URI, "plugged": False})).json()
    assert [one["is_plugged"] for one in links] == [True, False]
    assert links[1]["state"] == "unplugged"
    assert links[1]["carries"] == []
    await order(client)
    await order(client, "surface")
    await settled(station)
    assert sky.calls == []
    with pytest.raises(HeldBackError):
        await sky.deliver(robot.message())
    await client.post(PLUG, json={"uri": URI, "plugged": True})
    assert await sky.deliver(robot.message()) is True
    events = await station.foundation.store.query(newest_events)
    plugs = [one.text for one in events if one.kind in {"link.unplugged", "link.plugged"}]
    assert [text.split()[2] for text in plugs] == ["unplugged", "plugged"]
    assert all(text.endswith("RockBLOCK of grace-1.") for text in plugs)


async def test_robots_own_messages_are_priced_beside_the_budget(far, sky, robot):
    _, client = far
    message = robot.message()
    await sky.deliver(message)
    found = (await client.get("/api/robots/grace-1/satellite")).json()
    paid = -(-len(message.data) // 50)
    assert found["incoming"][0]["credits"] == paid
    assert found["credits_heard_today"] == sum(one["credits"] for one in found["incoming"])
    assert found["credits_today"] == 0
    assert found["credits_left"] == found["credits_per_day"]


async def test_plug_that_was_pulled_stays_pulled_after_a_restart(
    tmp_path, world, sky, robot, monkeypatch
):
    async with far_station(tmp_path, world, sky, monkeypatch) as (_, client):
        for uri in LINKS:
            await client.post(PLUG, json={"uri": uri, "plugged": False})
        assert (RADIO, False) in world.switched
        unknown = await client.post(PLUG, json={"uri": "xbee://10.0.0.1:1", "plugged": False})
        assert unknown.status_code == 404
    world.switched.clear()
    async with far_station(tmp_path, world, sky, monkeypatch) as (_, client):
        assert world.switched == [(RADIO, False)]
        links = (await client.get("/api/robots/grace-1/links")).json()
        assert [one["is_plugged"] for one in links] == [False, False]


async def test_every_byte_of_the_satellite_is_in_the_journal(far, sky, robot):
    station, client = far
    await order(client)
    await until(lambda: sky.calls)
    await settled(station)
    said = robot.message()
    await sky.deliver(said)
    await settled(station)

    def journal(session):
        rows = session.scalars(select(RawFrameRow).where(RawFrameRow.carrier == "rockblock"))
        return {(row.outgoing, row.data) for row in rows}

    async def complete():
        kept = await station.foundation.store.query(journal)
        return {(True, sky.calls[0][1]), (False, said.data)} <= kept

    await until(complete)


async def test_key_that_cannot_be_read_holds_messages_back_and_ends_nothing(
    far, sky, robot, tmp_path
):
    station, client = far
    file = next((tmp_path / "secret").glob("robot-*"))
    key = file.read_text()
    file.write_text("no key")
    with pytest.raises(HeldBackError):
        await sky.deliver(robot.message())
    await order(client)
    await settled(station)
    assert sky.calls == []
    file.write_text(key)
    await settled(station)
    await until(lambda: sky.calls)
    assert await sky.deliver(robot.message()) is True


def satellite_link(station):
    return station.fleet.status(GRACE).satellite_link


async def test_only_what_the_robots_key_proves_is_contact(tmp_path, world, sky, robot, monkeypatch):
    """Garbage, another key, an empty message, and a session that no gateway could still bring."""
    long_ago = datetime(2020, 1, 1, tzinfo=UTC)
    stranger = Caller(sky, GRACE, 2, bytes(32), robot.imei)
    unproved = [
        robot.message(data=b"hello"),
        stranger.message(),
        stranger.message(session_at=long_ago),
        robot.message(session_at=long_ago),
        robot.message(data=b""),
    ]
    for _ in range(2):  # before and after a restart
        async with far_station(tmp_path, world, sky, monkeypatch) as (station, client):
            for said in unproved:
                await sky.deliver(said)
            await settled(station)
            await station.satellite.refresh()
            assert satellite_link(station).state is LinkState.NEVER_HEARD
            assert satellite_link(station).heard_at is None
            shown = (await client.get("/api/robots/grace-1/satellite")).json()
            assert shown["next_session_at"] is None
            sky.clock.advance(hours=4)
            await station.satellite.refresh()
            assert [one.cause for one in station.foundation.alarms.open if one.robot == GRACE] == []


async def test_old_record_under_a_new_number_ends_no_alarm(far, sky, robot):
    station, _ = far
    old = robot.message()
    await sky.deliver(old)
    await settled(station)
    heard_at = satellite_link(station).heard_at
    sky.clock.advance(hours=4)

    def overdue():
        return [
            one.cleared_at is None
            for one in station.foundation.alarms.open
            if (one.robot, one.cause) == (GRACE, "contact")
        ]

    await until(overdue)
    await sky.deliver(replace(old, momsn=old.momsn + 9, session_at=sky.clock.now()))
    await settled(station)
    await station.satellite.refresh()
    assert satellite_link(station).heard_at == heard_at
    assert satellite_link(station).state is LinkState.STALE
    assert overdue() == [True]
