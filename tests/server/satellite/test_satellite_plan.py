"""Plans by satellite: no level before it is proved, one plan on board, never twice."""

import asyncio

import pytest

from db.query.satellite.outbox import outbox_of_transfer
from db.query.station.events import newest_events
from robot_link.messages import CommandKind, OnboardPlanState
from robot_link.station.gateway.gateway import GatewayFault, GatewayRefusal, GatewayUnreachableError
from tests.server.conftest import until
from tests.server.far import (
    draft,
    far_station,
    hear_radio,
    in_state,
    lose_radio,
    queued,
    settled,
    transfer_of,
)


async def row_of(station, path):
    store, transfer = station.foundation.store, path.rsplit("/", 1)[1]
    return await store.query(lambda session: outbox_of_transfer(session, transfer))


async def test_far_plan_climbs_level_by_level_as_each_is_proved(far, sky, robot):
    station, client = far
    plan = await draft(client)
    path, found = await queued(station, client, sky, plan)
    assert {part["level"] for part in found["parts"]} == {"queued"}
    assert found["carrier"] == "rockblock"
    assert found["sha256"] == plan["sha256"]
    await robot.call(len(found["parts"]))
    await settled(station)
    assert (await client.get(f"/api/plans/{plan['id']}")).json()["state"] == "sent"
    await robot.call()
    done = await in_state(client, path, "on_board")
    assert done["level"] == "applied"
    assert {part["level"] for part in done["parts"]} == {"radio"}
    found = await in_state(client, f"/api/plans/{plan['id']}", "on_board")
    assert found["transfer"]["id"] == done["id"]
    assert [mission.sha256() for mission, _ in robot.applied] == [plan["sha256"]]


async def test_number_that_the_network_gives_proves_the_radio_and_no_more(far, sky, robot):
    station, client = far
    sky.tells_mtmsn = True
    path, found = await queued(station, client, sky, await draft(client))
    assert all(part["mtmsn"] for part in found["parts"])
    for _ in found["parts"]:
        said = robot.message(data=b"", mtmsn=sky.queues[robot.imei].pop(0).mtmsn)
        await sky.deliver(said)
    fetched = (await client.get(path)).json()
    assert fetched["level"] == "radio"
    assert all(part["radio_at"] for part in fetched["parts"])
    assert fetched["state"] == "sending"
    assert robot.applied == []
    sent = (await client.get("/api/robots/grace-1/satellite")).json()["outgoing"]
    assert {one["state"] for one in sent} == {"radio"}


async def test_plan_that_is_started_by_satellite_needs_no_order(far, sky, robot, world):
    station, client = far
    path, found = await queued(station, client, sky, await draft(client), start=True)
    await robot.call(len(found["parts"]) + 1)
    await in_state(client, path, "running")
    assert robot.applied[0][1] is True
    assert robot.commands == []
    assert not [kind for _, kind, _ in world.commands if kind is CommandKind.START]

    async def ended():
        return (await client.get(path)).json()["ended_at"] is not None

    await until(ended)


@pytest.mark.parametrize("seed", range(4))
async def test_lossy_sky_and_restarts_bring_the_plan_once_and_whole(
    seed, tmp_path, world, sky, robot, monkeypatch
):
    sky.rng.seed(seed)
    plan = path = None
    for _ in range(60):
        async with far_station(tmp_path, world, sky, monkeypatch) as (station, client):
            if plan is None:
                await robot.call()
                await settled(station)
                plan = await draft(client)
                path = await transfer_of(client, plan)
                sky.loss = 0.4
            await until(lambda: station.transfers.is_under_way("grace-1"))
            await settled(station)
            await robot.call(2)
            await settled(station)
            seen = (await client.get(path)).json()
            if seen["level"] == "applied":
                assert robot.applied
            if seen["level"] == "radio":
                assert robot.fetched >= len(seen["parts"])
            row = await row_of(station, path)
            if row is not None and row.state == "applied":
                await in_state(client, path, "on_board")
                break
        robot.restart()
    assert [mission.sha256() for mission, _ in robot.applied] == [plan["sha256"]]
    assert len(sky.calls) < 25


async def test_same_bytes_and_number_go_out_until_the_gateway_is_reached(far, sky):
    station, client = far
    sky.refusals = [GatewayUnreachableError("no answer"), None]
    path = await transfer_of(client, await draft(client))
    await until(lambda: sky.calls)
    await settled(station)
    assert "no answer" in (await client.get(path)).json()["text"]
    before = list(sky.calls)
    sky.clock.advance(minutes=11)
    await settled(station)
    assert sky.calls.count(before[0]) == 2
    assert (await client.get(path)).json()["level"] == "queued"


@pytest.mark.parametrize(
    "fault",
    [
        GatewayFault.LOGIN,
        GatewayFault.UNKNOWN_IMEI,
        GatewayFault.NO_CREDIT,
        GatewayFault.RING_DISABLED,
    ],
)
async def test_refusal_for_good_ends_the_transfer_with_its_sentence(far, sky, fault):
    station, client = far
    plan = await draft(client)
    sky.refusals = [GatewayRefusal(fault, f"the gateway says {fault.value}.", "never")] * 9
    path = await transfer_of(client, plan)
    failed = await in_state(client, path, "failed")
    assert f"the gateway says {fault.value}" in failed["reason"]
    assert failed["level"] == "created"
    assert failed["credits"] == 0
    again = await in_state(client, f"/api/plans/{plan['id']}", "draft")
    assert again["message"] == failed["reason"]
    calls = len(sky.calls)
    sky.clock.advance(hours=2)
    await settled(station)
    assert len(sky.calls) == calls, "it is not tried again"
    await station.satellite.refresh()
    assert fault.value in station.fleet.status("grace-1").satellite.fault


async def test_full_queue_is_waited_for(far, sky, robot):
    station, client = far
    full = GatewayRefusal(GatewayFault.QUEUE_FULL, "the queue is full.", "later")
    sky.refusals = [full, full, full]
    path = await transfer_of(client, await draft(client))
    await until(lambda: sky.calls)
    for _ in range(6):
        await settled(station)
        sky.clock.advance(minutes=11)
    await settled(station)
    assert (await client.get(path)).json()["level"] == "queued"
    assert {call[2] for call in sky.calls} == {1, 2}, "every try of a message has one number"


async def test_robots_refusal_is_said_and_the_plan_is_a_draft_again(far, sky, robot):
    station, client = far
    robot.refuses = "a mission is running"
    plan = await draft(client)
    path, found = await queued(station, client, sky, plan)
    await robot.call(len(found["parts"]) + 1)
    failed = await in_state(client, path, "failed")
    assert failed["reason"].startswith("grace-1 refused it")
    assert (await in_state(client, f"/api/plans/{plan['id']}", "draft"))["transfer"] == failed


async def test_withdrawn_plan_is_not_sent_any_more(far, sky, robot):
    station, client = far
    sky.refusals = [GatewayUnreachableError("no answer")] * 50
    plan = await draft(client)
    path = await transfer_of(client, plan)
    await until(lambda: sky.calls)
    await settled(station)
    assert (await client.get(path)).json()["can_withdraw"] is True
    withdrawn = (await client.post(f"{path}/withdraw")).json()
    assert (withdrawn["state"], withdrawn["can_withdraw"]) == ("withdrawn", False)
    calls = {call[1] for call in sky.calls if len(call[1]) > 50}
    tries = len([call for call in sky.calls if call[1] in calls])
    sky.clock.advance(hours=1)
    await settled(station)
    assert len([call for call in sky.calls if call[1] in calls]) == tries
    assert {len(call[1]) <= 50 for call in sky.calls if call[1] not in calls} <= {True}
    assert (await client.post(f"{path}/withdraw")).status_code == 409
    await in_state(client, f"/api/plans/{plan['id']}", "draft")
    events = await station.foundation.store.query(newest_events)
    [told] = [one.text for one in events if one.kind == "plan.withdrawn"]
    assert told.endswith(f"withdrew {plan['id']}.")


async def test_robot_refuses_what_is_left_of_a_plan_that_was_withdrawn(far, sky, robot):
    station, client = far
    path, found = await queued(station, client, sky, await draft(client))
    left = list(sky.queues[robot.imei])
    await client.post(f"{path}/withdraw")
    await until(lambda: len(sky.calls) > len(found["parts"]))
    await settled(station)
    _, data, _, flush = sky.calls[-1]
    assert flush
    assert len(data) <= 50, "one credit"
    robot.hear(data)
    for message in left:
        robot.hear(message.data)
    assert robot.applied == []
    await robot.call()
    await settled(station)
    assert (await client.get(path)).json()["state"] == "withdrawn"


async def test_surface_order_withdraws_a_plan_without_emptying_the_queue_it_waits_in(
    far, sky, robot, world
):
    station, client = far
    world.in_reach = False
    path, found = await queued(station, client, sky, await draft(client))
    await station.commands.send("grace-1", CommandKind.SURFACE, by="test")
    await until(lambda: len(sky.calls) > len(found["parts"]))
    await settled(station)
    assert (await client.get(path)).json()["state"] == "withdrawn"
    assert [call[3] for call in sky.calls] == [False] * (len(found["parts"]) + 1)
    await robot.call(4)
    await settled(station)
    assert len(sky.calls) == len(found["parts"]) + 1, "the order itself calls the plan back"
    assert robot.applied == [], "the order came first, and what is older is refused"
    assert [one.kind for one in robot.commands] == [CommandKind.SURFACE]


async def test_newer_plan_takes_the_place_of_one_on_its_way_and_only_then_flushes(far, sky, robot):
    station, client = far
    first = await draft(client)
    path, _ = await queued(station, client, sky, first)
    assert not any(call[3] for call in sky.calls)
    second = await draft(client)
    calls = len(sky.calls)
    newer = await transfer_of(client, second)
    assert (await client.get(path)).json()["state"] == "superseded"
    await until(lambda: len(sky.calls) > calls)
    await settled(station)
    assert [call[3] for call in sky.calls[calls:]] == [True] + [False] * (
        len(sky.calls) - calls - 1
    )
    await robot.call(6)
    await in_state(client, newer, "on_board")
    assert [mission.sha256() for mission, _ in robot.applied] == [second["sha256"]]


async def test_plan_that_nobody_confirmed_expires_and_is_never_sent_late(far, sky, robot):
    station, client = far
    path, _ = await queued(station, client, sky, await draft(client))
    calls = len(sky.calls)
    sky.clock.advance(hours=97)
    await settled(station)
    failed = await in_state(client, path, "failed")
    assert "did not confirm it before it expired" in failed["reason"]
    assert len(sky.calls) == calls
    assert "has not left the station" in (await client.get(path)).json()["text"]
    await robot.call(1)
    await settled(station)
    later = sky.calls[calls:]
    assert [len(call[1]) <= 50 for call in later] == [True], "what is left of it is called back"
    await robot.call(2)
    await settled(station)
    assert robot.applied == []


async def test_robot_out_of_contact_gets_nothing_unless_the_operator_insists(far, sky):
    station, client = far
    plan = await draft(client)
    sky.clock.advance(hours=49)
    quote = (await client.get(f"/api/plans/{plan['id']}/satellite")).json()
    assert "more than 48 h ago" in quote["refusal"]
    assert quote["may_force"] is True
    url, body = f"/api/plans/{plan['id']}/upload", {"confirmed": True}
    refused = await client.post(url, json=body)
    assert refused.status_code == 409
    assert [error["loc"] for error in refused.json()["errors"]] == [["body", "force"]]
    assert sky.calls == []
    forced = await client.post(url, json={**body, "force": True})
    assert forced.status_code == 202
    await until(lambda: sky.calls)
    await settled(station)


async def test_plan_that_comes_by_radio_in_the_middle_is_on_board_once(far, sky, robot, world):
    station, client = far
    path, found = await queued(station, client, sky, await draft(client))
    hear_radio(world, sky)
    done = await in_state(client, path, "on_board")
    assert len(world.uploads) == 1
    assert done["carrier"] == "xbee"
    lose_radio(world)
    await until(lambda: len(sky.calls) > len(found["parts"]))
    await settled(station)
    await robot.call(4)
    await settled(station)
    later = sky.calls[len(found["parts"]) :]
    assert {len(call[1]) <= 50 for call in later} == {True}, "only the word that withdraws it"
    assert robot.applied == []


async def test_satellite_plan_found_on_board_by_radio_is_not_sent_again(far, sky, robot, world):
    station, client = far
    path, found = await queued(station, client, sky, await draft(client))
    sky.loss = 1.0
    for one in list(sky.queues[robot.imei]):
        robot.hear(one.data)
    assert len(robot.applied) == 1
    world.robots["grace-1"].plan = robot.plan
    world.robots["grace-1"].say(OnboardPlanState.ON_BOARD)
    done = await in_state(client, path, "on_board")
    assert world.uploads == []
    assert done["level"] == "applied"
    assert [call[3] for call in sky.calls[len(found["parts"]) :]] in ([], [True]), (
        "but the word that withdraws what may be left of it"
    )


async def test_transfer_by_radio_does_not_jump_to_satellite_when_the_station_restarts(
    tmp_path, world, sky, robot, monkeypatch
):
    world.may_upload.clear()
    async with far_station(tmp_path, world, sky, monkeypatch) as (station, client):
        await robot.call()
        await settled(station)
        hear_radio(world, sky)
        plan = await draft(client)
        path = await transfer_of(client, plan)
        await in_state(client, path, "sending")
    async with far_station(tmp_path, world, sky, monkeypatch) as (station, client):
        await asyncio.sleep(0.2)
        assert sky.calls == []
        world.may_upload.set()
        hear_radio(world, sky)
        await in_state(client, path, "on_board")
    assert sky.calls == []


async def test_events_trace_every_message(far, sky):
    station, client = far
    await queued(station, client, sky, await draft(client))
    events = await station.foundation.store.query(newest_events)
    texts = [event.text for event in events if event.kind == "satellite.queued"]
    assert any("RockBLOCK took part 1 of 2 of plan-1 for grace-1" in text for text in texts)
