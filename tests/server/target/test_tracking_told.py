"""What people are told of a target that is lost, found, or given up: events and alarms."""

import pytest

from autonomy.tracking.phase import TargetPhase
from db.query.station.events import events_after
from robot_link.messages import OnboardPlanState
from robot_link.report import TargetEstimate
from tests.server.conftest import MINI, open_station, until
from tests.server.target_reports import events_of, kept, now_report


async def test_loss_and_return_of_a_target_are_told_once_each(client, world):
    world.tell(now_report(60.0))
    first = now_report(40.0, TargetPhase.LOST)
    for report in (first, now_report(39.0, TargetPhase.LOST), now_report(30.0, TargetPhase.LOST)):
        world.tell(report)
    world.tell(now_report(28.0, TargetPhase.COASTING))
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
    world.tell(now_report(phase=TargetPhase.LOST, is_quiet=True))

    async def told():
        return await events_of(client, "track.lost")

    (lost,) = await until(told)
    assert lost["text"] == "mini-1 lost its target; it was told not to ping."


async def test_a_mission_that_ends_without_its_target_says_so(client, world):
    world.tell(now_report(9.0, TargetPhase.LOST))
    world.tell(now_report(5.0, TargetPhase.ENDED))

    async def told():
        return await events_of(client, "track.ended")

    (ended,) = await until(told)
    assert ended["text"] == "mini-1 ended without finding its target again."
    world.tell(now_report(0.0))
    await kept(client, 3)
    assert await events_of(client, "track.found") == [], "that is another mission"


async def test_a_target_of_the_next_mission_is_not_the_lost_one_found_again(client, world):
    world.tell(now_report(9.0, TargetPhase.LOST))
    world.robots[MINI].say(OnboardPlanState.FAILED)
    world.tell(now_report(-1.0))

    async def told():
        return await events_of(client, "track.ended")

    await until(told)
    assert await events_of(client, "track.found") == []


async def test_a_held_mission_that_goes_on_has_not_ended(client, world):
    world.tell(now_report(9.0, TargetPhase.LOST))
    world.tell(now_report(5.0, TargetPhase.WAITING, hypotheses=(), range_m=None))

    async def told():
        return await events_of(client, "track.ended")

    (ended,) = await until(told)
    assert ended["text"] == (
        "mini-1 begins to listen for its target anew; it had not found it again."
    )


async def test_a_loss_that_a_killed_station_had_not_told_is_told_at_its_next_start(tmp_path, world):
    async with open_station(tmp_path, world) as station:
        # As after a kill between the row and its event.
        report = now_report(20.0, TargetPhase.LOST)
        station.foundation.store.append([report]).result(60)
        assert await told_of(station, "track.lost") == 0
    for _ in range(2):
        async with open_station(tmp_path, world) as station:

            async def told(station=station):
                return await told_of(station, "track.lost") == 1

            await until(told)
            world.tell(now_report(10.0, TargetPhase.LOST))
    async with open_station(tmp_path, world) as station:
        assert station.fleet.status(MINI).target_report.phase is TargetPhase.LOST
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
    world.tell(now_report(phase=TargetPhase.LOST))

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
    assert station.fleet.status(MINI).target_report is None
    world.tell(now_report())
    await kept(client, 1)
