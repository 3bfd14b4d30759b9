"""What was known of a robot at a moment: one answer, by either clock, and what lies beside it."""

from datetime import UTC, datetime, timedelta

from sqlalchemy import update

from db.query.fleet.robots import robot_key
from db.query.station.alarms import AlarmRecord, save_alarm
from db.query.station.events import add_event
from db.tables import Deployment, StateRow
from server.replay.replays import Replays
from tests.server.conftest import MINI, until
from tests.server.scene.test_replay import report

SECOND = timedelta(seconds=1)


async def moment(client, at, **query):
    answer = await client.get(f"/api/robots/{MINI}/moment", params={"at": at.isoformat(), **query})
    assert answer.status_code == 200, answer.text
    return answer.json()


async def test_every_value_is_the_latest_by_then_with_its_age(client, station):
    now = datetime.now(UTC)
    first, second = now - 100 * SECOND, now - 60 * SECOND

    def write(session):
        key = robot_key(session, MINI)
        common = {"robot_key": key, "position_std_m": 0.1, "has_fix": False, "mode": 1}
        place = {"north_m": 1.0, "east_m": 0.5, "depth_m": 0.2}
        session.add(StateRow(measured_at=first, received_at=first, battery_v=12.0,
                             velocity_north_m_s=3.0, velocity_east_m_s=4.0,
                             velocity_down_m_s=0.0, **place, **common))  # fmt: skip
        session.add(StateRow(measured_at=second, received_at=second,
                             **place | {"depth_m": 0.7}, **common))  # fmt: skip

    await station.foundation.store.write(write)
    then = (await moment(client, now - 50 * SECOND))["channels"]
    assert (then["depth_m"]["value"], then["depth_m"]["age_s"]) == (0.7, 10.0)
    assert (then["battery_v"]["value"], then["battery_v"]["age_s"]) == (12.0, 50.0)
    assert then["speed_m_s"]["value"] == 5.0, "the length of what was told in parts"
    assert then["depth_m"]["limit_s"] < 50.0 <= then["battery_v"]["limit_s"]
    nothing = await moment(client, now - 200 * SECOND)
    assert (nothing["channels"], nothing["mode"], nothing["position"]) == ({}, None, None)


async def test_what_was_told_later_counts_by_when_it_was_measured_and_not_by_what_was_heard(
    client, station
):
    now = datetime.now(UTC)
    await report(station, now - 60 * SECOND, now - 60 * SECOND, 0.1)
    await report(station, now - 50 * SECOND, now - 20 * SECOND, 0.9)
    at = now - 40 * SECOND
    assert (await moment(client, at))["channels"]["depth_m"]["value"] == 0.9
    heard = await moment(client, at, clock="received")
    assert (heard["channels"]["depth_m"]["value"], heard["clock"]) == (0.1, "received")
    drawn = (await client.get(f"/api/robots/{MINI}/samples?channel=depth_m")).json()
    heard_at = dict(
        zip(drawn["value"], map(datetime.fromisoformat, drawn["received_at"]), strict=True)
    )
    assert (heard_at[0.1], heard_at[0.9]) == (now - 60 * SECOND, now - 20 * SECOND)
    sampled = (await client.get(f"/api/robots/{MINI}/samples?channel=temperature")).json()
    assert sampled["received_at"] is None, "when samples arrived is not kept"
    wrong = await client.get(
        f"/api/robots/{MINI}/moment", params={"at": at.isoformat(), "clock": "mine"}
    )
    assert wrong.status_code == 422


async def test_what_lies_beside_a_moment_is_told_across_a_gap(client, station):
    now = datetime.now(UTC)
    times = [now - seconds * SECOND for seconds in (900, 899, 300)]
    for at in times:
        await report(station, at, at, 0.1)

    def write(session):
        add_event(session, times[1], "robot.dive_begun", "It dived.", robot=MINI)
        add_event(session, times[2], "robot.surfaced", "It surfaced.", robot=MINI)

    await station.foundation.store.write(write)
    found = (await moment(client, now - 600 * SECOND))["beside"]
    assert [
        datetime.fromisoformat(found[key])
        for key in ("sample_before", "sample_after", "event_before", "event_after")
    ] == [times[1], times[2], times[1], times[2]]
    # A page counts in milliseconds: what it has gone to is not beside it.
    there = times[1].replace(microsecond=times[1].microsecond // 1000 * 1000 + 999)
    assert (await moment(client, there))["channels"]["depth_m"]["value"] == 0.1
    found = (await moment(client, there))["beside"]
    assert datetime.fromisoformat(found["sample_before"]) == times[0]
    assert datetime.fromisoformat(found["sample_after"]) == times[2]
    assert found["event_before"] is None
    line = await client.get(
        f"/api/robots/{MINI}/timeline", params={"at": (now - SECOND).isoformat()}
    )
    told = line.json()
    assert told["lasts"]
    assert told["deployment"]["started_at"] == told["begins_at"]


async def test_an_alarm_stands_from_when_it_was_raised_until_it_was_normal_again(client, station):
    now = datetime.now(UTC)
    alarm = AlarmRecord(
        id="alarm-900", cause="test", robot=MINI, level="warning", text="It leaks.",
        state="closed", raised_at=now - 60 * SECOND, acknowledged_at=now - 40 * SECOND,
        cleared_at=now - 20 * SECOND,
    )  # fmt: skip
    await station.foundation.store.write(lambda session: save_alarm(session, alarm))

    async def told(seconds):
        found = (await moment(client, now - seconds * SECOND))["alarms"]
        return [one["is_acknowledged"] for one in found if one["id"] == "alarm-900"]

    assert await told(70) == []
    assert await told(50) == [False]
    assert await told(30) == [True]
    assert await told(10) == []


async def test_what_cannot_be_true_counts_as_little_as_it_did_live(client, station, world):
    """The newest value that can be true stays; what the robot told since is kept, and not used."""
    world.robots[MINI].sample((1.0, 0.5, 0.2), "internal_temperature", 21.0)
    world.robots[MINI].sample((1.0, 0.5, 0.2), "internal_temperature", 5000.0)

    async def stored():
        answer = await client.get(f"/api/robots/{MINI}/channels")
        return [one["samples"] for one in answer.json() if one["key"] == "internal_temperature"]

    async def both():
        return await stored() == [2]

    await until(both)
    live = (await client.get(f"/api/robots/{MINI}/state")).json()["channels"]
    then = (await moment(client, datetime.now(UTC)))["channels"]
    assert live["internal_temperature"]["value"] == 21.0
    assert then["internal_temperature"]["value"] == 21.0


async def test_corrected_times_of_a_deployment_have_what_it_told_counted_anew(station):
    replays, store = station.foundation.services.get(Replays), station.foundation.store
    at = datetime.now(UTC)
    begun, first, asked = at - 3000 * SECOND, at - 2000 * SECOND, at - 1000 * SECOND

    def write(session):
        key = robot_key(session, MINI)
        session.add(StateRow(robot_key=key, measured_at=begun, received_at=begun, battery_v=12.0,
                             position_std_m=0.1, has_fix=False, mode=1,
                             north_m=1.0, east_m=0.5, depth_m=0.2))  # fmt: skip
        return set_times(session, first)

    def set_times(session, started_at):
        session.execute(
            update(Deployment).values(started_at=started_at, ended_at=at - 500 * SECOND)
        )

    await store.write(write)
    assert "battery_v" not in await replays._ever_told(MINI, asked)
    await store.write(lambda session: set_times(session, begun - SECOND))
    assert "battery_v" in await replays._ever_told(MINI, asked)
