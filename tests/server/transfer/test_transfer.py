"""What is written of transfers and plans, and when: never before it is true, never left open."""

import asyncio
import sqlite3
from contextlib import contextmanager
from dataclasses import replace
from datetime import datetime, timedelta

import cbor2
import pytest

from autonomy.control.config import BACKSTEPPING_PRESETS
from autonomy.site import TANK
from db.query.station.events import newest_events
from robot_link.clock import SystemClock
from robot_link.messages import (
    CommandKind,
    CommandLevel,
    CommandNumber,
    CommandReport,
    OnboardPlanState,
    PlanReport,
)
from server.base import retry_queue as turn
from server.base.problem import Problem
from server.base.secret import SecretStore
from server.link.radios import Radios
from server.link.signing import RobotSigning
from server.plan.document import mission_of
from server.plan.drafting import ages_at
from server.plan.state import PlanChanged
from tests.server.conftest import MINI, robot_record, until
from tests.server.fake_link import World, state_report
from tests.server.transfer.test_upload import DIVE, draft, plan_in, transfer_in, upload


@pytest.fixture(autouse=True)
def _hasty(monkeypatch):
    monkeypatch.setattr(turn, "RETRY_S", 0.05)


@contextmanager
def locked(tmp_path):
    """Let another program hold the database."""
    other = sqlite3.connect(tmp_path / "station.sqlite3", timeout=60, isolation_level=None)
    other.execute("BEGIN EXCLUSIVE")
    try:
        yield
    finally:
        other.execute("ROLLBACK")
        other.close()


async def texts(station) -> list[tuple[str, str]]:
    events = await station.foundation.store.query(newest_events)
    return [(event.kind, event.text) for event in events]


async def test_plan_is_not_sent_before_the_radio_took_a_byte(client, world):
    world.radio_takes = False
    world.may_upload.clear()
    plan = await draft(client)
    transfer = (await upload(client, plan)).json()["id"]
    await until(lambda: world.uploads)
    await asyncio.sleep(0.1)
    assert (await client.get(f"/api/transfers/{transfer}")).json()["state"] == "waiting"
    assert (await client.get(f"/api/plans/{plan}")).json()["state"] == "draft"
    world.radio_takes = True
    world.refuse_upload = OnboardPlanState.FAILED
    world.may_upload.set()
    world.may_upload.clear()  # the next attempt waits
    await plan_in(client, plan, "sent")
    assert (await client.get(f"/api/transfers/{transfer}")).json()["state"] == "sending"


async def test_transfer_counts_the_items_that_the_wire_counts(client, world):
    world.may_upload.clear()
    circle = {"kind": "spiral", "end_ned": [0, 0, 0], "radius_m": 0.4, "turn_rad": 1.0}
    body = {"kind": "primitives", "legs": [{"kind": "dive", "end_ned": [0, 0, 0.5]}, circle]}
    transfer = (await upload(client, await draft(client, body))).json()["id"]
    found = (await client.get(f"/api/transfers/{transfer}")).json()
    assert found["items"] == 10, "settings, trim, five of tuning, two legs, one circle"


async def test_upload_that_meets_failing_storage_ends_once_storage_works(client, world, tmp_path):
    world.may_upload.clear()
    plan = await draft(client)
    transfer = (await upload(client, plan, start=True)).json()["id"]
    await plan_in(client, plan, "sent")
    with locked(tmp_path):
        world.may_upload.set()
        await until(lambda: world.robots[MINI].plan is not None)
        await asyncio.sleep(0.5)
    ended = await transfer_in(client, transfer, "running")
    await plan_in(client, plan, "done")
    assert ended["level"] == "applied"
    assert len(world.uploads) == 1


async def test_failed_upload_is_closed_once_storage_works(client, world, tmp_path):
    world.refuse_upload = OnboardPlanState.REFUSED
    world.may_upload.clear()
    plan = await draft(client)
    transfer = (await upload(client, plan)).json()["id"]
    await plan_in(client, plan, "sent")
    with locked(tmp_path):
        world.may_upload.set()
        await asyncio.sleep(0.5)
    ended = await transfer_in(client, transfer, "failed")
    assert ended["ended_at"] is not None
    assert (await plan_in(client, plan, "draft"))["message"].startswith("Not confirmed on board")


async def test_surface_order_ends_an_upload_that_waits_for_storage(client, world, tmp_path):
    world.may_upload.clear()
    plan = await draft(client)
    transfer = (await upload(client, plan, start=True)).json()["id"]
    await plan_in(client, plan, "sent")
    with locked(tmp_path):
        world.may_upload.set()
        await until(lambda: world.robots[MINI].plan is not None)
        await client.post("/api/robots/mini-1/commands", json={"kind": "surface"})
    await transfer_in(client, transfer, "withdrawn")
    await asyncio.sleep(0.3)
    assert CommandKind.START not in {kind for _, kind, _ in world.commands}


async def test_draft_that_storage_did_not_take_is_closed_once_it_works(
    client, station, monkeypatch, tmp_path
):
    ledger = station.plans
    add = ledger.add
    other = sqlite3.connect(tmp_path / "station.sqlite3", timeout=60, isolation_level=None)

    async def add_then_fail(*args, **kwargs):
        plan = await add(*args, **kwargs)
        other.execute("BEGIN EXCLUSIVE")
        return plan

    monkeypatch.setattr(ledger, "add", add_then_fail)
    body = {"kind": "primitives", "legs": [{"kind": "dive", "end_ned": [0, 0, 0.5]}]}
    refused = await client.post("/api/robots/mini-1/plans", json=body)
    assert refused.status_code == 503
    other.execute("ROLLBACK")
    other.close()
    failed = await plan_in(client, "plan-1", "failed")
    assert "storage failed" in failed["message"]


async def test_plan_that_becomes_a_draft_again_leaves_an_event(client, world, station):
    world.refuse_upload = OnboardPlanState.REFUSED
    plan = await draft(client)
    transfer = (await upload(client, plan)).json()["id"]
    await transfer_in(client, transfer, "failed")
    again = "plan-1 is a draft again. Not confirmed on board: mini-1 refused plan-1"
    found = [text for kind, text in await texts(station) if kind == "plan.draft"]
    assert any(text.startswith(again) for text in found)


def report(plan, state: OnboardPlanState, at: datetime, reason: str = "") -> PlanReport:
    return PlanReport(MINI, plan.sha256, state, 2, 2, 2.0, reason, at, at)


async def test_draft_that_the_robot_flew_unseen_is_done(client, station, world):
    plan = await station.plans.get(await draft(client))
    later = plan.created_at + timedelta(seconds=30.0)
    world.tell(report(plan, OnboardPlanState.DONE, later))
    await plan_in(client, plan.id, "done")


async def test_same_legs_laid_out_again_are_a_plan_of_their_own(client, station, world):
    world.robots[MINI].may_fly.clear()
    first = await draft(client)
    await upload(client, first, start=True)
    await plan_in(client, first, "running")
    second = await plan_in(client, await draft(client), "draft")
    assert second["sha256"] != (await station.plans.get(first)).sha256
    world.robots[MINI].say()
    world.robots[MINI].may_fly.set()
    await plan_in(client, first, "done")
    world.robots[MINI].say()
    assert (await station.plans.get(second["id"])).state == "draft"
    await upload(client, second["id"], start=True)
    await plan_in(client, second["id"], "done")
    assert [plan for _, plan in world.uploads] == [
        (await station.plans.get(one)).sha256 for one in (first, second["id"])
    ]


async def test_flight_that_costs_more_than_planned_says_so(client, station, world):
    world.robots[MINI].overspends = 0.4
    plan = await draft(client)
    await upload(client, plan, start=True)
    done = await plan_in(client, plan, "done")
    assert done["onboard"]["overspent"] == pytest.approx(0.8, abs=0.01)
    found = [text for kind, text in await texts(station) if kind == "plan.done"]
    assert found[0].endswith("3.3 energy units, 0.8 more than planned.")


async def test_order_for_a_robot_without_a_link_expires(tmp_path):
    heard: list[object] = []
    world = World()
    clock = SystemClock()
    signing = RobotSigning(SecretStore(tmp_path), clock)
    way = Radios(clock, heard.append, world.make_link, signing)
    serving = asyncio.create_task(way.run())
    soon = clock.now() + timedelta(seconds=0.15)
    way.send_command(MINI, CommandKind.SURFACE, CommandNumber(7), soon)
    assert heard == []
    await until(lambda: heard)
    (found,) = heard
    assert isinstance(found, CommandReport)
    assert (found.robot, found.number, found.level) == (MINI, 7, CommandLevel.EXPIRED)
    assert found.at >= soon
    serving.cancel()
    await asyncio.gather(serving, return_exceptions=True)


async def test_order_that_waits_for_a_link_does_not_expire_once_there_is_one(tmp_path):
    heard: list[object] = []
    world = World()
    clock = SystemClock()
    signing = RobotSigning(SecretStore(tmp_path), clock)
    way = Radios(clock, heard.append, world.make_link, signing)
    serving = asyncio.create_task(way.run())
    soon = clock.now() + timedelta(seconds=1.0)
    way.send_command(MINI, CommandKind.HOLD, CommandNumber(8), soon)
    assert way.set_robots([robot_record(MINI, 1, "miniglider", TANK)])
    await asyncio.sleep(1.2)
    assert heard == [], "whoever sent it sends it again, by the link"
    serving.cancel()
    await asyncio.gather(serving, return_exceptions=True)


async def test_outdated_draft_is_flown_only_after_a_second_word(client, world):
    plan = await draft(client, {**DIVE, "config": {"mission": {"draft_distance_m": 1.0}}})
    assert (await client.post(f"/api/plans/{plan}/check")).json()["violations"] == []
    world.tell(state_report(MINI, (2.9, 0.6, 0.0)))
    (found,) = (await client.post(f"/api/plans/{plan}/check")).json()["violations"]
    assert found["field"] == "mission.draft_distance_m"
    refused = await upload(client, plan)
    assert refused.status_code == 409
    assert refused.json()["detail"].startswith(f"{plan} is outdated: The robot is 1.7 m from")
    assert [error["loc"] for error in refused.json()["errors"]] == [["mission.draft_distance_m"]]
    assert world.uploads == []
    confirmed = await client.post(f"/api/plans/{plan}/upload", json={"confirmed": True})
    assert confirmed.status_code == 202
    await plan_in(client, plan, "on_board")


async def test_confirmation_does_not_lift_a_limit(client):
    deep = {"kind": "primitives", "legs": [{"kind": "dive", "end_ned": [0, 0, 1.1]}]}
    answer = await client.post(
        f"/api/plans/{await draft(client, deep)}/upload", json={"confirmed": True}
    )
    assert answer.status_code == 409
    assert "limits" in answer.json()["detail"]


async def test_old_draft_is_outdated(client, station, monkeypatch):
    plan = await draft(client)
    clock = station.foundation.clock
    now = clock.now()
    monkeypatch.setattr(type(clock), "now", lambda self: now + timedelta(hours=2))
    (found,) = await station.planning.check(plan)
    assert found.message == "The plan was made 120 min ago; the limit is 60 min."
    with pytest.raises(Problem, match="plan-1 is outdated: The plan was made 120 min ago"):
        await station.transfers.send(plan, start=True)


async def test_plan_brings_the_trim_of_its_robot_and_cites_the_version(client, station, world):
    plain = (await client.get(f"/api/plans/{await draft(client)}")).json()
    assert plain["trim_id"] is None
    patch = {"net_buoyancy_offset_kg": 0.0015, "mass_position_offset_m": -0.002}
    await station.foundation.configurations.patch("trim", MINI, patch, by="test")
    plan = await draft(client)
    found = (await client.get(f"/api/plans/{plan}")).json()
    holds = await station.foundation.configurations.current("trim", MINI)
    assert found["trim_id"] == holds.id
    assert found["sha256"] != plain["sha256"]
    await upload(client, plan)
    await plan_in(client, plan, "on_board")
    settings = world.robots[MINI].plan.settings
    assert (settings.net_buoyancy_offset_kg, settings.mass_position_offset_m) == (0.0015, -0.002)


async def test_plan_with_a_trim_that_the_robot_would_refuse_is_not_sent(client, station):
    patch = {"net_buoyancy_offset_kg": 0.02}
    await station.foundation.configurations.patch("trim", MINI, patch, by="test")
    plan = await draft(client)
    refused = await upload(client, plan)
    assert refused.status_code == 409
    assert refused.json()["errors"] == [
        {
            "loc": ["trim"],
            "msg": "The trim of the net buoyancy is beyond 30% of the actuator's travel.",
        }
    ]
    assert len((await client.post(f"/api/plans/{plan}/check")).json()["violations"]) == 1


async def test_plan_that_was_stored_before_there_was_trim_keeps_its_hash(client, station):
    record = await station.plans.get(await draft(client))
    offsets = ("net_buoyancy_offset_kg", "mass_position_offset_m")
    settings = {k: v for k, v in record.document["settings"].items() if k not in offsets}
    newer = ("format", "trim_id", "onboard_settings")
    document = {k: v for k, v in record.document.items() if k not in newer}
    mission = mission_of(replace(record, document=document | {"settings": settings}))
    assert mission.settings.net_buoyancy_offset_kg == mission.settings.mass_position_offset_m == 0.0
    version, numbers, _ = cbor2.loads(mission.canonical_bytes())
    assert (version, len(numbers)) == (1, 5)


async def test_plan_brings_its_controller_on_board_and_one_stored_before_keeps_its_hash(
    client, station
):
    record = await station.plans.get(await draft(client))
    mission = mission_of(record)
    assert mission.sha256() == record.sha256
    assert mission.onboard is not None
    assert mission.onboard.controller_config() == BACKSTEPPING_PRESETS["miniglider"].model_copy(
        update={"pitch_trade_rad": 0.3491}
    )
    older = {k: v for k, v in record.document.items() if k != "onboard_settings"}
    before = mission_of(replace(record, document=older | {"format": 2}))
    version, numbers, _ = cbor2.loads(before.canonical_bytes())
    assert (version, len(numbers), before.onboard) == (2, 7, None)


async def test_plan_that_another_transaction_moves_is_told_once(client, station, world):
    world.may_upload.clear()
    plan = await draft(client)
    await upload(client, plan)
    await until(lambda: station.fleet.status(MINI).plan.state == "sent")
    told = []
    station.foundation.bus.subscribe(PlanChanged, lambda event: told.append(event.plan))
    await station.commands.send(MINI, CommandKind.SURFACE, by="test")
    assert [(one.id, one.state) for one in told] == [(plan, "draft")]
    assert station.fleet.status(MINI).plan.state == "draft"


async def test_a_draft_that_only_grows_old_is_told(client, station):
    """No event of a robot says so: the time alone does."""
    body = {**DIVE, "config": {"mission": {"draft_age_s": 60.0}}}
    plan = await station.plans.get(await draft(client, body))
    now = plan.created_at
    assert ages_at(plan, now) == now + timedelta(seconds=60, microseconds=1)
    after = ages_at(plan, now + timedelta(seconds=61))
    assert after == now + timedelta(seconds=90, microseconds=1), "when it is 2 min old"
    assert ages_at(replace(plan, state="running"), now) is None
