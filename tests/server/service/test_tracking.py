"""What a robot says of its target: live, kept, listed, exported, told, and drawn."""

import csv
import io
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest

from autonomy.tracking.phase import TrackPhase
from db.query.events import events_after
from db.query.tracking import newest_track_report
from robot_link.messages import CommandKind, OnboardPlanState, RobotMode, TargetEstimate
from server.service.live_feed import LiveFeed
from tests.db.track import track_report
from tests.server.service.conftest import MINI, open_station, until
from tests.server.service.fake_link import state_report
from tests.server.service.test_tracking_plan import draft, plan_in, upload


def now_report(age_s=0.0, phase=TrackPhase.TRACKING, **changes):
    at = datetime.now(UTC) - timedelta(seconds=age_s)
    return track_report(0, phase, measured_at=at, received_at=at, **changes)


async def tracking(client, **asked):
    answer = await client.get("/api/robots/mini-1/tracking", params=asked)
    assert answer.status_code == 200, answer.text
    return answer.json()


async def events_of(client, kind):
    found = (await client.get("/api/events", params={"limit": 500})).json()
    events = found if isinstance(found, list) else found["events"]
    return [event for event in events if event["kind"] == kind]


async def kept(client, count):
    async def there():
        found = await tracking(client)
        return found if len(found["reports"]) == count else None

    return await until(there)


async def test_live_robot_shows_the_newest_report(client, station, world):
    assert (await client.get("/api/robots/mini-1/state")).json()["tracking"] is None
    world.tell(now_report(2.0))
    world.tell(now_report(range_m=0.61))
    world.tell(now_report(1.0))
    shown = (await client.get("/api/robots/mini-1/state")).json()["tracking"]
    assert shown["range_m"] == 0.61
    assert shown["phase"] == "tracking"
    assert station.fleet.live_view(MINI).tracking.range_m == 0.61
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
    monkeypatch.setattr(LiveFeed, "put", lambda _feed, *part: told.append(part))
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


async def test_every_report_is_kept_and_listed_the_oldest_first(client, world):
    reports = [now_report(age_s) for age_s in (3.0, 2.0, 1.0)]
    for report in reports:
        world.tell(report)
    found = await kept(client, 3)
    assert found["robot"] == "mini-1"
    assert found["plan_id"] is None
    moments = [datetime.fromisoformat(one["measured_at"]) for one in found["reports"]]
    assert moments == [one.measured_at for one in reports]
    newest = await tracking(client, limit=1)
    assert newest["reports"] == found["reports"][2:]
    rest = await tracking(client, after=found["reports"][0]["measured_at"], limit=1)
    assert rest["reports"] == found["reports"][1:2]


async def test_reports_of_one_plan_are_listed_and_exported_alone(client, world):
    world.tell(now_report(5.0, range_m=0.1))
    await kept(client, 1)
    world.robots[MINI].may_end.clear()
    plan = (await draft(client))["id"]
    await upload(client, plan, start=True)
    await plan_in(client, plan, "running")
    world.tell(now_report(range_m=0.2))
    everything = await kept(client, 2)
    assert everything["plan_id"] == plan
    mine = await tracking(client, plan=plan)
    assert [one["range_m"] for one in mine["reports"]] == [0.2]
    answer = await client.get("/api/robots/mini-1/tracking.csv", params={"plan": plan})
    assert len(answer.text.strip().splitlines()) == 4, "marks, columns, one report"


async def test_a_plan_that_never_began_has_no_reports(client, world):
    world.tell(now_report())
    await kept(client, 1)
    plan = (await draft(client))["id"]
    assert (await tracking(client, plan=plan))["reports"] == []
    assert (await tracking(client))["plan_id"] is None


async def test_bad_questions_are_answered_in_words(client):
    for asked, status, where in (
        ({"limit": 0}, 422, "limit"),
        ({"limit": 5001}, 422, "limit"),
        ({"after": "yesterday"}, 422, "after"),
    ):
        answer = await client.get("/api/robots/mini-1/tracking", params=asked)
        assert answer.status_code == status
        assert where in answer.json()["errors"][0]["loc"]
    for url in ("/api/robots/nobody/tracking", "/api/robots/nobody/tracking.csv"):
        assert (await client.get(url)).status_code == 404
    assert (
        await client.get("/api/robots/mini-1/tracking", params={"plan": "plan-99"})
    ).status_code == 404


async def test_export_has_a_column_for_every_number_and_says_that_it_is_simulated(client, world):
    report = now_report(1.0)
    world.tell(report)
    world.tell(now_report(range_m=None, true_ne_m=None, hypotheses=()))
    await kept(client, 2)
    answer = await client.get("/api/robots/mini-1/tracking.csv")
    assert answer.headers["content-type"].startswith("text/csv")
    assert "SIMULATION_mini-1" in answer.headers["content-disposition"]
    lines = answer.text.splitlines()
    assert lines[0] == "# SIMULATION: this robot does not exist"
    rows = list(csv.DictReader(io.StringIO("\n".join(lines[2:]))))
    first, second = rows
    assert float(first["time"]) == pytest.approx(report.measured_at.timestamp(), abs=1e-5)
    assert float(first["target2_weight"]) == 0.25
    assert float(first["determinant_m2_s"]) == report.determinant_m2_s
    assert (first["phase"], first["is_barrier_on"]) == ("tracking", "1")
    assert second["range_m"] == second["range_age_s"] == ""
    assert second["target1_north_m"] == second["true_north_m"] == ""
    assert len(first) == len(second) == len(lines[2].split(","))


async def test_a_deployment_brings_it_too(client, world):
    world.tell(state_report(MINI))
    world.tell(now_report())
    await kept(client, 1)
    deployments = (await client.get("/api/deployments")).json()["deployments"]
    live = [one["id"] for one in deployments if one["robot"] == "mini-1"]
    url = f"/api/deployments/{live[0]}/export"
    answer = await client.get(url, params={"format": "tracking"})
    assert answer.status_code == 200
    assert "tracking.csv" in answer.headers["content-disposition"]
    assert len(answer.text.strip().splitlines()) == 4, "marks, columns, one report"


async def test_loss_and_return_of_a_target_are_told_once_each(client, world):
    world.tell(now_report(60.0))
    first = now_report(40.0, TrackPhase.LOST)
    for report in (first, now_report(39.0, TrackPhase.LOST), now_report(30.0, TrackPhase.LOST)):
        world.tell(report)
    world.tell(now_report(28.0, TrackPhase.COASTING))
    await kept(client, 5)
    again = now_report(26.0)
    world.tell(again)
    world.tell(now_report(25.0))

    async def both():
        return await events_of(client, "track.found")

    await until(both)
    (lost,) = await events_of(client, "track.lost")
    assert lost["text"] == "mini-1 lost its target."
    assert lost["level"] == "watch"
    (found,) = await events_of(client, "track.found")
    lost_s = (again.measured_at - first.measured_at).total_seconds()
    assert found["text"] == f"mini-1 found its target again after {lost_s:.0f} s."
    assert found["data"]["lost_s"] == pytest.approx(lost_s)


async def test_a_silent_robot_says_why_it_lost_its_target(client, world):
    world.tell(now_report(phase=TrackPhase.LOST, is_quiet=True))

    async def told():
        return await events_of(client, "track.lost")

    (lost,) = await until(told)
    assert lost["text"] == "mini-1 lost its target; it was told not to ping."


async def test_a_mission_that_ends_without_its_target_says_so(client, world):
    world.tell(now_report(9.0, TrackPhase.LOST))
    world.tell(now_report(5.0, TrackPhase.ENDED))

    async def told():
        return await events_of(client, "track.ended")

    (ended,) = await until(told)
    assert ended["text"] == "mini-1 ended without finding its target again."
    world.tell(now_report(0.0))
    await kept(client, 3)
    assert await events_of(client, "track.found") == [], "that is another mission"


async def test_a_target_of_the_next_mission_is_not_the_lost_one_found_again(client, world):
    world.tell(now_report(9.0, TrackPhase.LOST))
    world.robots[MINI].say(OnboardPlanState.FAILED)
    world.tell(now_report(-1.0))

    async def told():
        return await events_of(client, "track.ended")

    await until(told)
    assert await events_of(client, "track.found") == []


async def test_a_held_mission_that_goes_on_has_not_ended(client, world):
    world.tell(now_report(9.0, TrackPhase.LOST))
    world.tell(now_report(5.0, TrackPhase.WAITING, hypotheses=(), range_m=None))

    async def told():
        return await events_of(client, "track.ended")

    (ended,) = await until(told)
    assert ended["text"] == (
        "mini-1 begins to listen for its target anew; it had not found it again."
    )


async def test_a_loss_that_a_killed_station_had_not_told_is_told_at_its_next_start(tmp_path, world):
    async with open_station(tmp_path, world) as station:
        # As after a kill between the row and its event.
        report = now_report(20.0, TrackPhase.LOST)
        station.foundation.store.append([report]).result(60)
        assert await told_of(station, "track.lost") == 0
    for _ in range(2):
        async with open_station(tmp_path, world) as station:

            async def told(station=station):
                return await told_of(station, "track.lost") == 1

            await until(told)
            world.tell(now_report(10.0, TrackPhase.LOST))
    async with open_station(tmp_path, world) as station:
        assert station.fleet.picture(MINI).track_report.phase is TrackPhase.LOST
        world.tell(now_report(0.0))

        async def found():
            return await told_of(station, "track.found") == 1

        await until(found)
        assert await told_of(station, "track.lost") == 1


async def told_of(station, kind):
    events = await station.foundation.store.query(
        lambda session: events_after(session, 0, limit=500)
    )
    return sum(event.kind == kind for event in events)


async def test_a_lost_target_is_an_alarm_until_it_is_found(client, world):
    world.tell(now_report(phase=TrackPhase.LOST))

    async def alarm(standing):
        alarms = (await client.get("/api/alarms")).json()
        found = alarms if isinstance(alarms, list) else alarms["alarms"]
        mine = [one for one in found if "target" in one["text"] and one["cleared_at"] is None]
        return mine if bool(mine) == standing else None

    async def stands():
        return await alarm(True)

    (raised,) = await until(stands)
    assert raised["level"] == "warning"
    assert raised["text"] == "mini-1 lost its target; it circles to find it."
    world.tell(now_report())

    async def is_gone():
        return (await alarm(False)) is not None

    await until(is_gone)


@pytest.mark.parametrize(
    "changes",
    [
        {"determinant_m2_s": float("nan")},
        {"range_m": -0.5},
        {"position_ne_m": (4000.0, 0.0)},
        {"hypotheses": (TargetEstimate((1.0, 1.0), (0.0, 0.0), (0.01, 0.5, 0.01), 1.0),)},
        {"hypotheses": (TargetEstimate((1.0, 1.0), (0.0, 0.0), (0.1, 0.0, 0.1), 1.7),)},
        {"hypotheses": (TargetEstimate((float("inf"), 1.0), (0.0, 0.0), (0.1, 0.0, 0.1), 1.0),)},
    ],
    ids=["nan", "negative range", "far robot", "no covariance", "no probability", "infinite"],
)
async def test_what_no_robot_can_mean_is_kept_out_and_told_once(client, station, world, changes):
    for age_s in (1.0, 0.0):
        world.tell(now_report(age_s, **changes))

    async def refused():
        return await events_of(client, "track.refused")

    await until(refused)
    assert len(await events_of(client, "track.refused")) == 1
    assert station.fleet.picture(MINI).track_report is None
    world.tell(now_report())
    await kept(client, 1)


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
        ({"is_barrier_on": False, "phase": TrackPhase.ENDED}, "Following its target"),
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
    shown = station.fleet.picture(MINI).track_report
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
    assert station.fleet.picture(MINI).track_report is None
    assert (await client.get("/api/robots/mini-1/state")).json()["tracking"] is None


async def test_a_mission_that_ended_long_ago_concerns_nobody(client, station, world):

    async def shown():
        return (await client.get("/api/robots/mini-1/state")).json()["tracking"]

    world.tell(now_report(1000.0, TrackPhase.ENDED))
    assert await shown() is None
    assert station._scene_source(MINI).target() is None
    world.tell(now_report(900.0))
    assert (await shown())["phase"] == "tracking", "for all one knows it goes on"
    world.robots[MINI].say(OnboardPlanState.DONE)
    assert await shown() is None
    world.tell(now_report(30.0, TrackPhase.ENDED))
    assert (await shown())["phase"] == "ended"


async def test_scene_draws_what_the_robot_says_and_greys_what_is_old(station, world, client):
    source = station._scene_source(MINI)
    assert source.target() is None
    await draft(client, {"target": {"depth_m": 0.3}})
    report = now_report()
    world.tell(report)
    shown = source.target()
    assert source.target() is shown, "the same object as long as nothing changed"
    assert shown.hypotheses[0].position_ned == (1.4, 0.8, 0.3)
    assert shown.true_ned == (1.43, 0.76, 0.3)
    assert (shown.range_m, shown.is_old) == (0.52, False)
    world.tell(replace(now_report(), phase=TrackPhase.LOST))
    lost = source.target()
    assert (lost.range_m, lost.is_old) == (None, True)
    world.tell(now_report(phase=TrackPhase.ENDED))
    assert source.target().is_old


async def test_an_old_report_is_grey_in_the_scene(station, world):
    world.tell(now_report(30.0))
    shown = station._scene_source(MINI).target()
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
                lambda session: newest_track_report(session, MINI)
            )

        assert await until(stored) == report
    async with open_station(tmp_path, world) as station:
        assert station.fleet.picture(MINI).track_report == report
        assert station.fleet.live_view(MINI).tracking.phase == "tracking"
