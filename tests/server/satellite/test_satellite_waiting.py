"""A plan that waits on board of a robot that is heard by satellite alone."""

from robot_link.messages import CommandKind
from robot_link.satellite.blob import Blob
from server.plan.document import mission_of
from server.plan.ledger import PlanLedger
from tests.server.conftest import GRACE, until
from tests.server.far import draft, in_state, lose_radio, queued, settled, transfer_of


async def waiting_of(client):
    return (await client.get(f"/api/robots/{GRACE}/state")).json()["waiting_plan"]


async def test_plan_by_satellite_waits_by_the_word_of_the_robot(far, sky, robot):
    station, client = far
    first = await draft(client)
    _, found = await queued(station, client, sky, first, start=True)
    await robot.call(len(found["parts"]) + 1)
    await in_state(client, f"/api/plans/{first['id']}", "running")
    body = {"kind": "primitives", "legs": [{"kind": "dive", "end_ned": [0, 0, d]} for d in (3, 0)]}
    second = await draft(client, body)
    sky.clock.advance(seconds=30)
    path = await transfer_of(client, second, start=True)

    async def taken():
        await settled(station)
        one = (await client.get(path)).json()
        return one if one["level"] == "queued" else None

    found = await until(taken)
    await robot.call(len(found["parts"]))
    assert robot.waits is not None
    assert (await client.get(f"/api/plans/{second['id']}")).json()["state"] == "sent"
    await robot.call()
    await in_state(client, f"/api/plans/{second['id']}", "waiting")
    done = await in_state(client, path, "kept")
    assert done["level"] == "applied"
    shown = await waiting_of(client)
    assert (shown["plan_id"], shown["flown_plan_id"]) == (second["id"], first["id"])
    assert shown["starts"] is True
    robot.change_over()
    await robot.call()
    await in_state(client, f"/api/plans/{second['id']}", "running")
    await in_state(client, f"/api/plans/{first['id']}", "superseded")
    await settled(station)
    assert [kind for kind in robot.commands if kind.kind is CommandKind.START] == []


async def test_plan_sent_by_radio_is_told_to_wait_by_satellite(far, sky, robot, world):
    station, client = far
    first = await draft(client)
    _, found = await queued(station, client, sky, first, start=True)
    await robot.call(len(found["parts"]) + 1)
    await in_state(client, f"/api/plans/{first['id']}", "running")
    body = {"kind": "primitives", "legs": [{"kind": "dive", "end_ned": [0, 0, d]} for d in (3, 0)]}
    second = await draft(client, body)
    ledger = station.foundation.services.get(PlanLedger)
    mission = mission_of(await ledger.get(second["id"]))
    robot.waits = (mission, False, Blob.of(mission).transfer_id)
    lose_radio(world)
    await robot.call()
    await in_state(client, f"/api/plans/{second['id']}", "waiting")
    robot.waits = None
    await robot.call()
    await in_state(client, f"/api/plans/{second['id']}", "draft")
