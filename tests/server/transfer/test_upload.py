import asyncio

import pytest

from autonomy.planner.plan import PrimitiveKind
from autonomy.planner.preset import MINIGLIDER
from robot_link.messages import CommandKind, LinkState, OnboardPlanState
from server.plan import ledger
from server.plan.document import mission_of
from server.plan.ledger import PlanLedger
from server.plan.primitive_legs import LegRequest
from server.plan.view import TransferView
from tests.server.conftest import MINI, open_station, until
from tests.server.fake_link import current_report, state_report

DIVE = {"kind": "primitives", "legs": [{"kind": "dive", "end_ned": [0, 0, d]} for d in (0.5, 0.0)]}
DEEP = {"kind": "primitives", "legs": [{"kind": "dive", "end_ned": [0, 0, 1.1]}]}


async def draft(client, body=DIVE):
    answer = await client.post("/api/robots/mini-1/plans", json=body)
    assert answer.status_code == 202, answer.text
    return answer.json()["id"]


async def upload(client, plan, start=False):
    return await client.post(f"/api/plans/{plan}/upload", json={"start": start})


async def plan_in(client, plan, *states):
    async def there():
        found = (await client.get(f"/api/plans/{plan}")).json()
        return found if found["state"] in states else None

    return await until(there)


async def transfer_in(client, transfer, *states):
    async def there():
        found = (await client.get(f"/api/transfers/{transfer}")).json()
        return found if found["state"] in states else None

    return await until(there)


async def test_draft_has_legs_account_and_the_hash_that_the_robot_will_echo(client):
    found = (await client.get(f"/api/plans/{await draft(client)}")).json()
    assert [leg["kind"] for leg in found["legs"]] == ["dive", "dive"]
    assert found["legs"][0]["start_ned"] == [1.2, 0.6, 0.0]
    assert found["account"]["energy"] == pytest.approx(
        sum(leg["energy"] for leg in found["legs"]) + MINIGLIDER.surfacing_energy, abs=0.01
    )
    assert found["account"]["bytes"] > 0
    assert len(found["sha256"]) == 64
    assert found["violations"] == []
    assert found["config_id"].startswith("config")


async def test_plan_is_on_board_only_after_the_robot_echoed_its_hash(client, world):
    world.may_upload.clear()
    plan = await draft(client)
    transfer = (await upload(client, plan)).json()["id"]
    await plan_in(client, plan, "sent")
    assert (await client.get(f"/api/transfers/{transfer}")).json()["state"] == "sending"
    world.may_upload.set()
    found = await plan_in(client, plan, "on_board")
    assert world.uploads == [(MINI, found["sha256"])]
    done = await transfer_in(client, transfer, "on_board")
    assert (done["level"], done["items_sent"]) == ("applied", 9), "settings, trim, tuning, two legs"
    ladder = found["ladder"]
    assert ladder["draft_at"] < ladder["sent_at"] < ladder["on_board_at"]
    assert ladder["running_at"] is None


async def test_started_plan_runs_and_is_done_when_the_robot_says_so(client, world):
    world.robots[MINI].may_fly.clear()
    plan = await draft(client)
    await upload(client, plan, start=True)
    running = await plan_in(client, plan, "running")
    flown = {"leg": 0, "legs": 2, "energy_used": 0.0, "overspent": 0.0}
    assert running["onboard"] == {**flown, "off_track_m": None, "off_track_rms_m": None}
    world.robots[MINI].may_fly.set()
    done = await plan_in(client, plan, "done")
    assert done["onboard"]["energy_used"] == pytest.approx(done["account"]["energy"], abs=0.01)
    assert [kind for _, kind, _ in world.commands] == [CommandKind.START]


async def test_same_upload_asked_for_twice_is_one_transfer(client, world):
    world.may_upload.clear()
    plan = await draft(client)
    first, second = await asyncio.gather(upload(client, plan), upload(client, plan))
    assert first.json() == second.json() == {"id": "transfer-1"}
    await until(lambda: world.uploads)
    assert (await upload(client, plan, start=True)).status_code == 409
    assert len(world.uploads) == 1


async def test_the_newest_transfers_alone_are_kept_for_the_live_stream(client, monkeypatch):
    monkeypatch.setattr(ledger, "PARTS_PER_SECTION", 2)
    plans = client.app.state.foundation.services.get(PlanLedger)
    records = [await plans.get(await draft(client)) for _ in range(3)]

    def send(place):
        plan = records[place]
        at = plan.created_at
        told = ("sending", 0, 1, 2, "created", at, None, "")
        plans.set_transfer(plan, TransferView(f"transfer-{place}", MINI, plan.id, *told))

    def kept():
        return [plans.live_view(plan).transfer is not None for plan in records]

    send(0)
    send(1)
    assert kept() == [True, True, False]
    send(2)
    assert kept() == [False, True, True]


async def test_draft_that_breaks_a_limit_is_refused_with_each_violation(client, world):
    plan = await draft(client, DEEP)
    found = (await client.get(f"/api/plans/{plan}")).json()
    assert found["violations"]
    answer = await upload(client, plan)
    assert answer.status_code == 409
    assert len(answer.json()["errors"]) == len(found["violations"])
    # A survey that stops for it says this alone: words, and no paths of fields.
    assert found["violations"][0]["message"] in answer.json()["detail"]
    assert "legs." not in answer.json()["detail"]
    assert world.uploads == []


async def test_failed_upload_keeps_the_draft_and_says_why(client, world, station):
    world.refuse_upload = OnboardPlanState.REFUSED
    plan = await draft(client)
    transfer = (await upload(client, plan)).json()["id"]
    failed = await transfer_in(client, transfer, "failed")
    assert "the robot did not answer" in failed["reason"]
    found = await plan_in(client, plan, "draft")
    assert "Not confirmed on board" in found["message"]
    world.refuse_upload = None
    await upload(client, plan)
    await plan_in(client, plan, "on_board")


async def test_plan_whose_echo_was_lost_is_found_on_board_later(client, world):
    world.refuse_upload = OnboardPlanState.REFUSED
    plan = await draft(client)
    transfer = (await upload(client, plan)).json()["id"]
    await transfer_in(client, transfer, "failed")
    robot = world.robots[MINI]
    world.refuse_upload = None
    # The robot had it all along, and says so at the next contact.
    plans = client.app.state.foundation.services.get(PlanLedger)
    robot.take(mission_of(await plans.get(plan)))
    await plan_in(client, plan, "on_board")


async def test_new_plan_on_board_supersedes_the_old_one(client, world):
    first = await draft(client)
    await upload(client, first)
    await plan_in(client, first, "on_board")
    world.tell(state_report(MINI, (1.3, 0.7, 0.0)))
    second = await draft(client)
    await upload(client, second)
    await plan_in(client, second, "on_board")
    await plan_in(client, first, "superseded")


async def test_robot_that_ends_a_plan_early_makes_it_failed_with_its_reason(client, world):
    world.robots[MINI].may_fly.clear()
    plan = await draft(client)
    await upload(client, plan, start=True)
    await plan_in(client, plan, "running")
    world.robots[MINI].end_early("too deep")
    found = await plan_in(client, plan, "failed")
    assert found["message"] == "mini-1 ended plan-1 early: too deep"


async def test_cancelling_throws_a_draft_away_but_not_a_plan_on_board(client):
    plan = await draft(client)
    assert (await client.post(f"/api/plans/{plan}/cancel")).status_code == 202
    assert (await client.get(f"/api/plans/{plan}")).json()["state"] == "cancelled"
    other = await draft(client)
    await upload(client, other)
    await plan_in(client, other, "on_board")
    refused = await client.post(f"/api/plans/{other}/cancel")
    assert refused.status_code == 409
    assert "surface mini-1" in refused.json()["detail"]


async def test_transfer_waits_for_a_robot_under_water(client, world):
    world.hear(MINI, LinkState.SUBMERGED)
    plan = await draft(client)
    transfer = (await upload(client, plan)).json()["id"]
    await asyncio.sleep(0.4)
    assert (await client.get(f"/api/transfers/{transfer}")).json()["state"] == "waiting"
    assert (await client.get(f"/api/plans/{plan}")).json()["state"] == "draft"
    world.hear(MINI)
    await plan_in(client, plan, "on_board")


async def test_transfer_goes_on_after_a_restart_of_the_station(tmp_path, world):
    world.may_upload.clear()
    async with open_station(tmp_path, world) as station:
        world.hear(MINI)
        world.tell(state_report(MINI, (1.2, 0.6, 0.0)))
        world.tell(current_report(MINI))
        plan = await _draft(station)
        await station.transfers.send(plan, start=True)
        await until(lambda: world.uploads)
    world.may_upload.set()
    async with open_station(tmp_path, world) as station:
        world.hear(MINI)

        async def done():
            return (await station.plans.get(plan)).state == "done"

        await until(done)
        assert len(world.uploads) == 2


async def test_plan_that_was_flown_while_the_station_was_off_is_picked_up(tmp_path, world):
    world.robots.clear()
    async with open_station(tmp_path, world) as station:
        world.hear(MINI)
        world.tell(state_report(MINI, (1.2, 0.6, 0.0)))
        world.tell(current_report(MINI))
        world.robots[MINI].may_fly.clear()
        plan = await _draft(station)
        await station.transfers.send(plan, start=True)

        async def running():
            return (await station.plans.get(plan)).state == "running"

        await until(running)
    robot = world.robots[MINI]
    robot.tell = lambda event: None
    robot.may_fly.set()
    await until(lambda: robot.state is OnboardPlanState.DONE)
    async with open_station(tmp_path, world) as station:
        world.hear(MINI)
        robot.say()

        async def done():
            return (await station.plans.get(plan)).state == "done"

        await until(done)
        assert len(world.uploads) == 1


async def _draft(station):
    config_id, config = await station.planning.configure(MINI, {}, by="test")
    legs = [LegRequest(PrimitiveKind.DIVE, (0.0, 0.0, depth)) for depth in (0.5, 0.0)]
    plan = await station.planning.plan_primitives(MINI, config, config_id, legs, by="test")
    return plan.id
