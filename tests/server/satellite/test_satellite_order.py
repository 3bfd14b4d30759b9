"""Orders by satellite: said until they are answered, acted on once."""

from datetime import datetime, timedelta

import pytest

from db.query.satellite.outbox import open_outbox
from robot_link.messages import CommandKind, CommandLevel, RobotMode
from robot_link.robot_program import CommandOutcome
from robot_link.station.gateway.gateway import GatewayFault, GatewayRefusal
from server.command import commands as command_service
from server.command.state import CommandChanged
from server.fleet.status import RobotStatus
from tests.server.conftest import GRACE, until
from tests.server.far import (
    ORDERS,
    PLUG,
    hear_radio,
    lose_radio,
    order,
    settled,
)
from tests.server.sky import IMEI, URI

pytestmark = pytest.mark.usefixtures("no_radio")


def carriers(found, level):
    return {step["carrier"] for step in found["levels"] if step["level"] == level}


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


async def story(station, client, robot=GRACE):
    """Return what every page tells of a robot's orders: log, satellite list, commands, alarms."""
    events = (await client.get("/api/events", params={"limit": 1000})).json()["events"]
    sent = (await client.get(f"/api/robots/{robot}/satellite")).json()["outgoing"]
    commands = (await client.get(f"/api/robots/{robot}/commands")).json()
    return (
        [one["text"] for one in events if one["kind"].startswith("command.")],
        [one["text"] for one in sent],
        [(one["kind"], one["level"]) for one in commands],
        [one for one in station.foundation.alarms.open if one.robot == robot],
    )


async def test_surface_order_that_left_before_it_was_written_is_one_order(
    far, sky, robot, world, monkeypatch
):
    station, client = far
    shown = []
    station.foundation.bus.subscribe(CommandChanged, lambda event: shown.append(event.command))
    monkeypatch.setattr(command_service, "_WRITE_PATIENCE_S", -1.0)
    path = await order(client, "surface")
    await until(lambda: len(sky.calls) == 2)
    await settled(station)
    emergency = world.commands[0][2]
    world.link.level(GRACE, emergency, CommandLevel.EXPIRED)  # the radio drops it for the second
    await robot.call(4)
    await settled(station)

    async def applied():
        return (await client.get(path)).json()["level"] == "applied"

    await until(applied)
    log, sent, commands, alarms = await story(station, client)
    assert commands == [("surface", "applied")]
    assert "grace-1 obeys: it is coming up." in log
    assert not [one for one in (*log, *sent) if "refused" in one or "given up" in one]
    assert alarms == []
    assert (await client.get(path)).json()["id"] == shown[-1].id
    assert not [one for one in shown if one.level in ("refused", "expired")]
    await until(lambda: not station.commands._written)


async def test_order_that_a_later_one_overtook_was_not_refused(far, sky, robot):
    station, client = far
    early = await order(client, "hold")
    await until(lambda: sky.calls)
    await settled(station)
    (queued,) = sky.queues[IMEI]
    sky.queues[IMEI].clear()
    await order(client, "resume")
    await until(lambda: len(sky.calls) == 2)
    await settled(station)
    await robot.call(2)
    robot.hear(queued.data)
    await robot.call()
    await settled(station)
    found = (await client.get(early)).json()
    assert found["level"] == "expired"
    assert found["levels"][-1]["reason"] == "a later order took its place"
    _, sent, _, alarms = await story(station, client)
    assert sent[-1] == (
        "The hold order: RockBLOCK took it. The robot's answer says that it has it."
    )
    assert alarms == []


async def test_refused_surface_order_is_critical_until_the_robot_is_up(far, sky, robot):
    station, client = far
    robot.mode = RobotMode.GLIDING
    robot.outcome = CommandOutcome.NOT_NOW
    path = await order(client, "surface")
    await until(lambda: sky.calls)
    await settled(station)
    await robot.call(2)
    await settled(station)
    assert (await client.get(path)).json()["level"] == "refused"

    def standing():
        return [
            (one.cause, one.level)
            for one in station.foundation.alarms.open
            if one.robot == GRACE and one.cleared_at is None and "satellite" not in one.text
        ]

    await until(lambda: standing() == [("surface order", "critical")])
    _, sent, _, _ = await story(station, client)
    assert "answer says that it has it" in sent[0]
    robot.mode = RobotMode.IDLE
    await robot.call()
    await until(lambda: standing() == [])


async def test_surface_forecast_tells_the_time_that_the_send_sheet_knows(far, sky, world):
    station, client = far
    await station.satellite.refresh()
    due = (await client.get("/api/robots/grace-1/satellite")).json()["next_session_at"]
    shown = (await client.get("/api/robots/grace-1")).json()
    assert shown["surface_forecast"] == (
        f"Reaches grace-1 at its next session by RockBLOCK, expected about {due[11:16]}Z"
    )
    assert shown["next_contact"] == {"at": due, "text": f"Next session about {due[11:16]}Z"}
    hear_radio(world, sky)
    forecast = (await client.get("/api/robots/grace-1")).json()["surface_forecast"]
    assert forecast == "Reaches grace-1 now by XBee"
    lose_radio(world)
    sky.clock.advance(hours=3)
    await station.satellite.refresh()
    forecast = (await client.get("/api/robots/grace-1")).json()["surface_forecast"]
    assert forecast == "Reaches grace-1 at its next session by RockBLOCK"


async def test_an_overdue_call_leaves_the_next_surfacing_of_the_plan_it_flies(
    far, sky, monkeypatch
):
    station, client = far
    await station.satellite.refresh()
    called_at = (await client.get("/api/robots/grace-1")).json()["next_contact"]["at"]
    up_at = datetime.fromisoformat(called_at) + timedelta(hours=1)
    monkeypatch.setattr(RobotStatus, "next_surfacing", lambda _: up_at)
    assert (await client.get("/api/robots/grace-1")).json()["next_contact"]["at"] == called_at
    sky.clock.advance(hours=3)
    await station.satellite.refresh()
    shown = (await client.get("/api/robots/grace-1")).json()["next_contact"]
    assert datetime.fromisoformat(shown["at"]) == up_at
    assert shown["text"] == f"Next surfacing about {up_at:%H:%M}Z"
