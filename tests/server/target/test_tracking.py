"""What a robot says of its target: live, drawn, and answered with orders."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest

from autonomy.tracking.phase import TargetPhase
from db.query.mission.target_reports import newest_target_report
from robot_link.messages import CommandKind, OnboardPlanState, RobotMode
from robot_link.report import TargetEstimate
from server.base.live_feed import LiveFeed
from tests.server.conftest import MINI, open_station, until
from tests.server.fake_link import state_report
from tests.server.target.test_tracking_plan import draft, plan_in, upload
from tests.server.target_reports import events_of, now_report


async def test_live_robot_shows_the_newest_report(client, station, world):
    assert (await client.get("/api/robots/mini-1/state")).json()["tracking"] is None
    world.tell(now_report(2.0))
    world.tell(now_report(range_m=0.61))
    world.tell(now_report(1.0))
    shown = (await client.get("/api/robots/mini-1/state")).json()["tracking"]
    assert shown["range_m"] == 0.61
    assert shown["phase"] == "tracking"
    assert station.views.live_view(MINI).tracking.range_m == 0.61
    first, second = shown["hypotheses"]
    assert first == {
        "position_ne_m": [1.4, 0.8],
        "velocity_ne_m_s": [0.01, -0.02],
        "covariance_m2": [0.04, 0.005, 0.01],
        "weight": 0.75,
    }
    assert second["weight"] == 0.25
    assert shown["error_m"] == pytest.approx(0.05)


async def test_live_stream_carries_it(station, world, monkeypatch):
    told = []
    monkeypatch.setattr(LiveFeed, "put", lambda _feed, *part, **_public: told.append(part))
    report = now_report()
    world.tell(report)
    section, key, value, robot = told[-1]
    assert (section, key, robot) == ("robots", MINI, MINI)
    assert value().tracking.measured_at == report.measured_at


async def test_without_a_known_truth_there_is_no_error(client, world):
    world.tell(now_report(true_ne_m=None))
    shown = (await client.get("/api/robots/mini-1/state")).json()["tracking"]
    assert shown["true_ne_m"] is None
    assert shown["error_m"] is None


async def test_an_estimate_that_diverged_is_shown(client, world):
    far = TargetEstimate((9e4, -3e4), (8.0, 0.0), (1e8, 0.0, 1e8), 1.0)
    world.tell(now_report(hypotheses=(far,), is_barrier_on=False))
    shown = (await client.get("/api/robots/mini-1/state")).json()["tracking"]
    assert shown["error_m"] > 9e4
    assert shown["text"].endswith(
        "Nothing keeps the target observable: the mission is for teaching."
    )


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"is_barrier_on": False}, "Following its target, teaching: barrier off"),
        ({"is_barrier_on": True}, "Following its target"),
        ({"is_barrier_on": False, "phase": TargetPhase.ENDED}, "Following its target"),
    ],
)
async def test_every_page_says_in_the_robots_own_line_that_it_teaches(
    client, world, still, changes, words
):
    world.tell(state_report(MINI, at=still, mode=RobotMode.TRACKING))
    world.tell(now_report(**changes))
    assert (await client.get("/api/robots/mini-1/state")).json()["activity"] == words
    assert (await client.get("/api/robots/mini-1")).json()["activity"] == words


async def test_a_robot_with_a_wrong_clock_is_shown_by_its_arrival(client, station, world):
    years_ago = datetime.now(UTC) - timedelta(days=3000)
    world.tell(state_report(MINI, at=years_ago, received_at=datetime.now(UTC)))
    report = replace(now_report(), measured_at=years_ago)
    world.tell(report)
    shown = station.fleet.status(MINI).target_report
    assert abs(shown.measured_at - report.received_at) < timedelta(minutes=1)


async def test_a_report_ends_with_the_flight_of_another_plan(client, station, world):
    world.tell(now_report())
    world.robots[MINI].may_fly.clear()
    body = {
        "kind": "primitives",
        "legs": [
            {"kind": "dive", "end_ned": [0, 0, 0.3]},
            {"kind": "dive", "end_ned": [0, 0, 0.0]},
        ],
    }
    plan = (await client.post("/api/robots/mini-1/plans", json=body)).json()["id"]
    await upload(client, plan, start=True)
    await plan_in(client, plan, "running")
    world.robots[MINI].say(OnboardPlanState.RUNNING)
    assert station.fleet.status(MINI).target_report is None
    assert (await client.get("/api/robots/mini-1/state")).json()["tracking"] is None


async def test_a_mission_that_ended_long_ago_concerns_nobody(client, station, world):

    async def shown():
        return (await client.get("/api/robots/mini-1/state")).json()["tracking"]

    world.tell(now_report(1000.0, TargetPhase.ENDED))
    assert await shown() is None
    assert station.scene_source(MINI).target() is None
    world.tell(now_report(900.0))
    assert (await shown())["phase"] == "tracking", "for all one knows it goes on"
    world.robots[MINI].say(OnboardPlanState.DONE)
    assert await shown() is None
    world.tell(now_report(30.0, TargetPhase.ENDED))
    assert (await shown())["phase"] == "ended"


async def test_scene_draws_what_the_robot_says_and_greys_what_is_old(station, world, client):
    source = station.scene_source(MINI)
    assert source.target() is None
    await draft(client, {"target": {"depth_m": 0.3}})
    report = now_report()
    world.tell(report)
    shown = source.target()
    assert source.target() is shown, "the same object as long as nothing changed"
    assert shown.hypotheses[0].position_ned == (1.4, 0.8, 0.3)
    assert shown.true_ned == (1.43, 0.76, 0.3)
    assert (shown.range_m, shown.is_old) == (0.52, False)
    world.tell(replace(now_report(), phase=TargetPhase.LOST))
    lost = source.target()
    assert (lost.range_m, lost.is_old) == (None, True)
    world.tell(now_report(phase=TargetPhase.ENDED))
    assert source.target().is_old


async def test_an_old_report_is_grey_in_the_scene(station, world):
    world.tell(now_report(30.0))
    shown = station.scene_source(MINI).target()
    assert (shown.range_m, shown.is_old) == (None, True)


@pytest.mark.parametrize(
    ("kind", "text", "event"),
    [
        ("quiet", "mini-1 obeys: it does not ping its target.", "to stop pinging its target."),
        ("ping", "mini-1 obeys: it pings its target again.", "to ping its target again."),
    ],
)
async def test_pinging_is_stopped_and_begun_by_command(client, world, kind, text, event):
    answer = await client.post("/api/robots/mini-1/commands", json={"kind": kind})
    assert answer.status_code == 202
    command = answer.json()["id"]

    async def applied():
        found = (await client.get(f"/api/commands/{command}")).json()
        return found if found["level"] == "applied" else None

    found = await until(applied)
    assert found["text"] == text
    expires = datetime.fromisoformat(found["expires_at"])
    assert expires - datetime.fromisoformat(found["created_at"]) == timedelta(hours=1)
    assert world.commands[-1][1] is CommandKind(kind)
    (told,) = await events_of(client, f"command.{kind}")
    assert told["text"].endswith(event)


async def test_what_was_shown_is_shown_again_after_a_restart(tmp_path, world):
    async with open_station(tmp_path, world) as station:
        report = now_report(1.0)
        world.tell(report)

        async def stored():
            return await station.foundation.store.query(
                lambda session: newest_target_report(session, MINI)
            )

        assert await until(stored) == report
    async with open_station(tmp_path, world) as station:
        assert station.fleet.status(MINI).target_report == report
        assert station.views.live_view(MINI).tracking.phase == "tracking"
