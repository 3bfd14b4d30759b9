import asyncio
import sqlite3
from datetime import UTC, datetime, timedelta

import pytest

from db.query.mission.commands import add_command, list_commands
from db.query.mission.missions import get_mission
from robot_link.messages import CommandKind, CommandLevel, CommandNumber, CommandReport
from server.command import commands
from server.transfer.state import TransferEvidence, WithdrawnError, apply
from tests.server.conftest import FAST, GRACE, MINI, open_station, until


async def order(client, kind="surface", robot=MINI, **headers):
    answer = await client.post(
        f"/api/robots/{robot}/commands", json={"kind": kind}, headers=headers
    )
    assert answer.status_code == 202, answer.text
    return answer.json()["id"]


async def level(client, command, wanted):
    async def reached():
        found = (await client.get(f"/api/commands/{command}")).json()
        return found if found["level"] == wanted else None

    return await until(reached)


async def test_each_level_is_shown_with_its_time_and_carrier(client, world):
    found = await level(client, await order(client), "applied")
    assert [step["level"] for step in found["levels"]] == ["queued", "radio", "applied"]
    assert {step["carrier"] for step in found["levels"]} == {"xbee"}
    assert found["text"] == "mini-1 obeys: it is coming up."


async def test_nothing_is_claimed_before_the_robot_answered(client, world):
    world.in_reach = False
    found = await level(client, await order(client), "queued")
    assert "has not answered yet" in found["text"]


async def test_a_late_lower_level_never_takes_back_a_higher_one(client, station, world):
    command = await order(client)
    await level(client, command, "applied")
    world.tell(CommandReport(MINI, CommandNumber(1), CommandLevel.RADIO, datetime.now(UTC), "xbee"))
    await order(client, "hold")
    assert (await client.get(f"/api/commands/{command}")).json()["level"] == "applied"


async def test_unknown_robot_command_and_kind_are_refused_in_words(client):
    unknown = await client.post("/api/robots/nobody/commands", json={"kind": "surface"})
    assert (unknown.status_code, unknown.json()["detail"]) == (404, "There is no robot 'nobody'.")
    assert (await client.get("/api/commands/command-999")).status_code == 404
    wrong = await client.post("/api/robots/mini-1/commands", json={"kind": "dance"})
    assert wrong.status_code == 422
    assert wrong.json()["errors"][0]["loc"] == ["kind"]


async def test_same_request_twice_acts_once(client, world):
    first = await order(client, **{"Idempotency-Key": "one"})
    again = await order(client, **{"Idempotency-Key": "one"})
    assert first == again
    assert {number for _, _, number in world.commands if number < 1000} == {1}


async def test_surface_reaches_the_radio_although_the_database_is_locked(
    client, station, world, tmp_path, monkeypatch
):
    """It leaves while the database is still being waited for, not after that has failed."""
    monkeypatch.setattr(commands, "_WRITE_PATIENCE_S", 0.1)
    store, may_fail = station.foundation.store, asyncio.Event()
    write = store.write

    async def write_late(change):
        await may_fail.wait()
        return await write(change)

    monkeypatch.setattr(store, "write", write_late)
    other = sqlite3.connect(tmp_path / "station.sqlite3", timeout=60, isolation_level=None)
    other.execute("BEGIN EXCLUSIVE")
    ordering = asyncio.create_task(
        client.post("/api/robots/mini-1/commands", json={"kind": "surface"})
    )
    await until(lambda: world.commands)
    may_fail.set()
    answer = await ordering
    keyed = await client.post(
        "/api/robots/mini-1/commands",
        json={"kind": "surface"},
        headers={"Idempotency-Key": "abort"},
    )
    assert keyed.status_code == 202
    other.execute("ROLLBACK")
    other.close()
    assert answer.status_code == 202
    assert {kind for _, kind, _ in world.commands} == {CommandKind.SURFACE}
    found = await level(client, answer.json()["id"], "applied")
    assert found["robot"] == MINI


async def test_unwritten_surface_order_ends_the_automation_once_storage_works(
    client, station, world, workers, tmp_path
):
    world.robots[MINI].may_fly.clear()
    mission = await station.surveys.create(MINI, FAST, automation=True, by="test")
    await until(lambda: world.robots[MINI].state.name == "RUNNING")
    world.in_reach = False
    other = sqlite3.connect(tmp_path / "station.sqlite3", timeout=60, isolation_level=None)
    other.execute("BEGIN EXCLUSIVE")
    await order(client)
    other.execute("ROLLBACK")
    other.close()

    async def stopped():
        return (await client.get(f"/api/missions/{mission}")).json()["state"] == "stopped"

    await until(stopped)


async def test_other_orders_are_refused_while_the_database_is_locked(client, world, tmp_path):
    other = sqlite3.connect(tmp_path / "station.sqlite3", timeout=60, isolation_level=None)
    other.execute("BEGIN EXCLUSIVE")
    answer = await client.post("/api/robots/mini-1/commands", json={"kind": "hold"})
    other.execute("ROLLBACK")
    other.close()
    assert answer.status_code == 503
    assert world.commands == []


async def test_surface_purges_the_automation_of_that_robot(client, station, world, workers):
    world.robots[MINI].may_fly.clear()
    mission = (
        await client.post(
            "/api/robots/mini-1/missions",
            json={"kind": "adaptive_survey", "config": FAST, "automation": True},
        )
    ).json()["id"]

    async def running():
        return (await client.get(f"/api/missions/{mission}")).json()["state"] == "running"

    await until(running)
    await until(lambda: world.robots[MINI].state.name == "RUNNING")

    async def flown():
        plan = (await client.get(f"/api/missions/{mission}")).json()["plan_id"]
        return (await client.get(f"/api/plans/{plan}")).json()["state"] == "running"

    await until(flown)
    await order(client)

    async def stopped():
        found = (await client.get(f"/api/missions/{mission}")).json()
        return found if found["state"] == "stopped" else None

    found = await until(stopped)
    assert not found["automation"]
    assert "ordered mini-1 to the surface" in found["message"]
    world.robots[MINI].may_fly.set()

    async def plan_ended():
        plan = (await client.get(f"/api/plans/{found['plan_id']}")).json()
        return plan["state"] == "cancelled"

    await until(plan_ended)
    plan = (await client.get(f"/api/plans/{found['plan_id']}")).json()
    assert plan["message"] == f"mini-1 came up as ordered; that ended {plan['id']}."
    assert plan["ladder"]["running_at"] is not None
    record = await station.foundation.store.query(lambda session: get_mission(session, mission))
    assert (record.state, record.automation) == ("stopped", False)


async def send_dive(client):
    """Send a dive of two legs; return the plan's id and the transfer's."""
    legs = [{"kind": "dive", "end_ned": [0, 0, depth]} for depth in (0.5, 0.0)]
    made = await client.post("/api/robots/mini-1/plans", json={"kind": "primitives", "legs": legs})
    plan = made.json()["id"]
    sent = await client.post(f"/api/plans/{plan}/upload", json={"start": True})
    return plan, sent.json()["id"]


async def test_surface_withdraws_an_upload_and_keeps_the_draft(client, world):
    world.may_upload.clear()
    plan, transfer = await send_dive(client)
    await until(lambda: world.uploads)
    await order(client)
    found = (await client.get(f"/api/transfers/{transfer}")).json()
    assert found["state"] == "withdrawn"
    assert (await client.get(f"/api/plans/{plan}")).json()["state"] == "draft"
    assert world.cancelled_uploads


async def test_withdrawn_upload_says_nothing_more_of_its_plan(client, station, world):
    """Whoever carried it may be about to write down that its first bytes left."""
    world.may_upload.clear()
    plan, transfer = await send_dive(client)
    await order(client)
    store = station.foundation.store
    at = datetime.now(UTC)

    def late(session):
        apply(session, transfer, TransferEvidence.FIRST_BYTES, at, "late")

    with pytest.raises(WithdrawnError):
        await store.write(late)
    assert (await client.get(f"/api/plans/{plan}")).json()["state"] == "draft"
    found = (await client.get(f"/api/transfers/{transfer}")).json()
    assert found["state"] == "withdrawn"


async def test_nothing_is_started_after_a_surface_order_whatever_was_on_its_way(
    client, station, world, workers, monkeypatch
):
    def too_late(robot):
        """The transfer's task is not stopped: only the database can hold it back."""

    monkeypatch.setattr(station.transfers, "stop_for", too_late)
    world.may_upload.clear()
    mission = await station.surveys.create(MINI, FAST, automation=True, by="test")
    await until(lambda: world.uploads)
    await order(client)
    world.may_upload.set()
    await until(lambda: not station.transfers._tasks)
    await asyncio.sleep(0.3)
    assert {kind for _, kind, _ in world.commands} == {CommandKind.SURFACE}

    async def stopped():
        return (await client.get(f"/api/missions/{mission}")).json()["state"] == "stopped"

    await until(stopped)


async def test_orders_that_were_under_way_are_sent_again_after_a_restart(tmp_path, world):
    now = datetime.now(UTC)

    def write(session):
        add_command(
            session,
            MINI,
            CommandKind.HOLD,
            at=now,
            expires_at=now + timedelta(hours=1),
            by="test",
        )
        add_command(
            session,
            GRACE,
            CommandKind.HOLD,
            at=now - timedelta(hours=3),
            expires_at=now - timedelta(hours=2),
            by="test",
        )

    async with open_station(tmp_path, world) as station:
        await station.foundation.store.write(write)
    world.commands.clear()
    async with open_station(tmp_path, world) as station:
        assert world.commands == [(MINI, CommandKind.HOLD, 1)]
        records = await station.foundation.store.query(list_commands)
        expired = next(record for record in records if record.robot == GRACE)
        assert expired.level == "expired"
