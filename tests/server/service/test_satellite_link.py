"""Messages from robots, orders to them, and plugs: what a satellite link does beside plans."""

from dataclasses import replace

import pytest
import pytest_asyncio
from sqlalchemy import select

from db.query.events import newest_events
from db.query.outbox import open_outbox
from db.query.samples import newest_samples
from db.tables import RawFrameRow
from robot_link.gateway.gateway import GatewayFault, GatewayRefusal, HeldBackError
from robot_link.messages import (
    CommandKind,
    CommandLevel,
    LogId,
    OnboardPlanState,
    RobotMode,
    Sample,
)
from server.service import command as command_service
from tests.server.service.conftest import GRACE, until
from tests.server.service.far import (
    LINKS,
    RADIO,
    far_station,
    hear_radio,
    lose_radio,
    place_under,
    settled,
)
from tests.server.service.sky import IMEI, URI, ManualClock, Sky

ORDERS = "/api/robots/grace-1/commands"
PLUG = "/api/robots/grace-1/links/plug"


@pytest.fixture
def sky():
    return Sky(ManualClock())


@pytest.fixture
def robot(sky, tmp_path):
    return place_under(sky, tmp_path)


@pytest_asyncio.fixture
async def far(tmp_path, world, sky, robot, monkeypatch):
    async with far_station(tmp_path, world, sky, monkeypatch) as (station, client):
        world.in_reach = False
        await robot.call()
        await settled(station)
        yield station, client


async def order(client, kind="hold"):
    answer = await client.post(ORDERS, json={"kind": kind})
    assert answer.status_code == 202, answer.text
    return f"/api/commands/{answer.json()['id']}"


def carriers(found, level):
    return {step["carrier"] for step in found["levels"] if step["level"] == level}


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
    assert station.fleet.picture(GRACE).state.position_ned[0] == 180.0
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
        assert station.fleet.picture(GRACE).state is None
    async with far_station(tmp_path, world, sky, monkeypatch) as (station, client):
        await settled(station)
        assert station.fleet.picture(GRACE).state.position_ned[:2] == (170.0, 160.0)
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
    assert station.fleet.picture(GRACE).plan_report.state is OnboardPlanState.DONE


async def test_order_by_satellite_climbs_to_the_robots_own_answer(far, sky, robot):
    station, client = far
    path = await order(client)
    await until(lambda: sky.calls)
    await settled(station)
    found = (await client.get(path)).json()
    assert found["level"] == "queued"
    assert "rockblock" in carriers(found, "queued")
    assert "RockBLOCK took it" in found["text"]
    assert len(sky.calls[0][1]) <= 50
    await robot.call(2)
    done = (await client.get(path)).json()
    assert done["level"] == "applied"
    assert carriers(done, "applied") == {"rockblock"}
    assert [one.kind for one in robot.commands] == [CommandKind.HOLD]
    sky.clock.advance(hours=3)
    await settled(station)
    assert len(sky.calls) == 1, "what was answered is not said again"


async def test_order_without_an_answer_is_said_again_and_acted_on_once(far, sky, robot):
    station, client = far
    path = await order(client)
    await until(lambda: sky.calls)
    await settled(station)
    sky.queues[IMEI].clear()
    for _ in range(3):
        sky.clock.advance(minutes=30)
        await robot.call()
        await settled(station)
    assert len(sky.calls) == 2
    assert (await client.get(path)).json()["level"] in ("queued", "applied")
    robot.hear(sky.calls[0][1])
    robot.hear(sky.calls[1][1])
    assert len(robot.commands) == 1


async def test_order_that_radio_answered_is_not_said_again_by_satellite(far, sky, robot, world):
    station, client = far
    path = await order(client)
    await until(lambda: sky.calls)
    await settled(station)
    number = world.commands[-1][2]
    world.link.level(GRACE, number, CommandLevel.APPLIED)

    async def applied():
        return (await client.get(path)).json()["level"] == "applied"

    await until(applied)
    assert await station.foundation.store.query(open_outbox) == []


async def test_surface_order_goes_by_radio_and_by_satellite_at_once(far, sky, robot, world):
    station, client = far
    hear_radio(world, sky)
    path = await order(client, "surface")
    await until(lambda: sky.calls)
    await settled(station)
    found = (await client.get(path)).json()
    assert carriers(found, "queued") == {"xbee", "rockblock"}
    assert [kind for _, kind, _ in world.commands] == [CommandKind.SURFACE]
    ((_, data, _, flush),) = sky.calls
    assert len(data) <= 50
    assert not flush


async def test_other_orders_stay_off_the_satellite_while_radio_reaches(far, sky, world):
    station, client = far
    hear_radio(world, sky)
    await order(client)
    await settled(station)
    assert sky.calls == []
    lose_radio(world)
    await settled(station)
    assert sky.calls == []


async def test_surface_order_leaves_although_storage_fails(far, sky, robot, monkeypatch):
    station, _client = far
    monkeypatch.setattr(command_service, "_WRITE_PATIENCE_S", -1.0)
    await station.commands.send(GRACE, CommandKind.SURFACE, by="test")
    await until(lambda: sky.calls)
    robot.hear(sky.calls[0][1])
    assert [one.kind for one in robot.commands] == [CommandKind.SURFACE]
    await settled(station)


async def test_surface_order_goes_to_a_robot_out_of_contact_and_others_wait(far, sky, robot):
    station, client = far
    sky.clock.advance(hours=60)
    await order(client)
    await settled(station)
    assert sky.calls == []
    await order(client, "surface")
    await until(lambda: sky.calls)
    await settled(station)
    assert len(sky.calls) == 1


async def test_refused_order_is_told_and_not_repeated(far, sky):
    station, client = far
    sky.refusals = [GatewayRefusal(GatewayFault.NO_CREDIT, "the account has no credit.")] * 5
    await order(client)
    await until(lambda: sky.calls)
    await settled(station)
    sky.clock.advance(hours=1)
    await settled(station)
    assert len(sky.calls) == 1
    sent = (await client.get("/api/robots/grace-1/satellite")).json()["outgoing"]
    assert [one["state"] for one in sent] == ["refused"]
    assert "no credit" in sent[0]["text"]


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
        assert (RADIO, False) in world.plugs
        unknown = await client.post(PLUG, json={"uri": "xbee://10.0.0.1:1", "plugged": False})
        assert unknown.status_code == 404
    world.plugs.clear()
    async with far_station(tmp_path, world, sky, monkeypatch) as (_, client):
        assert world.plugs == [(RADIO, False)]
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


async def test_order_takes_the_route_that_is_asked_for(far, sky, world):
    station, client = far
    hear_radio(world, sky)
    answer = await client.post(ORDERS, json={"kind": "hold", "route": "satellite"})
    assert answer.status_code == 202, answer.text
    await until(lambda: sky.calls)
    await settled(station)
    assert world.commands == []
    await client.post(PLUG, json={"uri": URI, "plugged": False})
    refused = await client.post(ORDERS, json={"kind": "hold", "route": "satellite"})
    assert refused.status_code == 409
    assert "unplugged" in refused.json()["detail"]


async def test_order_says_why_it_waits(far, sky, world):
    station, client = far
    world.in_reach = False
    sky.clock.advance(hours=60)
    answer = await client.post(ORDERS, json={"kind": "hold", "route": "satellite"})
    await settled(station)
    found = (await client.get(f"/api/commands/{answer.json()['id']}")).json()
    assert found["level"] == "created"
    assert "It is sent when the robot is heard again." in found["text"]


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


async def test_log_says_what_became_of_a_sending_that_was_lost(far, sky, robot):
    station, client = far
    await order(client)
    await until(lambda: sky.calls)
    await settled(station)
    sky.queues[IMEI].clear()
    for _ in range(5):
        sky.clock.advance(minutes=30)
        await robot.call()
        await settled(station)
    sent = (await client.get("/api/robots/grace-1/satellite")).json()["outgoing"]
    assert "answer says that it has it" in sent[0]["text"]
    assert "so it was sent again" in sent[1]["text"]
