"""Alarms by the limits of the catalogue: raised with value and limit in words, cleared."""

from datetime import UTC, datetime

import pytest

from autonomy.channel import CHANNELS
from robot_link.report import Reading
from server.base.event_bus import AlarmChanged
from tests.server.alarm.judge import crossings
from tests.server.busy_writer import busy_writer
from tests.server.conftest import MINI, until

pytestmark = pytest.mark.usefixtures("in_threads")
PLACE = (1.0, 0.5, 0.2)
NOW = datetime(2026, 11, 21, 12, 0, tzinfo=UTC)


def test_a_value_beyond_its_limit_says_value_limit_and_unit():
    values = {"internal_pressure": 1234.0, "free_disk": 12.0, "humidity": 40.0, "nobody": 1.0}
    found = crossings("mini-1", values, CHANNELS, NOW)
    assert {key: (one.level, one.text) for key, one in found.items()} == {
        "internal_pressure": (
            "warning",
            "mini-1: Internal pressure is 1234 hPa, above its limit of 1100 hPa.",
        ),
        "free_disk": ("warning", "mini-1: Free disk is 12 MB, below its limit of 100 MB."),
    }


def test_the_gravest_limit_is_told():
    told = [
        crossings("m", {"internal_temperature": one}, CHANNELS, NOW) for one in (59.0, 61.0, 76.0)
    ]
    levels = [one["internal_temperature"].level if one else None for one in told]
    assert levels == [None, "warning", "critical"]


def alarm(station, cause):
    """Return the open alarm of a cause, ``None`` without one."""
    return next((one for one in station.foundation.alarms.open if one.cause == cause), None)


def is_over(station, cause):
    found = alarm(station, cause)
    return found is None or found.cleared_at is not None


async def test_a_leak_is_critical_until_it_is_dry_again(station, world):
    robot = world.robots[MINI]
    robot.sample(PLACE, "leak", 1.0)
    found = await until(lambda: alarm(station, "channel leak"))
    assert (found.level, found.robot) == ("critical", MINI)
    assert found.text.endswith("Leak says LEAK.")
    robot.sample(PLACE, "leak", 0.0)
    await until(lambda: is_over(station, "channel leak"))


async def test_a_reading_of_the_robot_itself_is_judged_shown_and_listed(station, client, world):
    now = datetime.now(UTC)
    world.tell(Reading(MINI, "leak", 1.0, now, now))
    found = await until(lambda: alarm(station, "channel leak"))
    assert found.level == "critical"
    channels = (await client.get(f"/api/robots/{MINI}/state")).json()["channels"]
    assert (channels["leak"]["value"], channels["leak"]["is_derived"]) == (1.0, False)

    async def is_listed():
        told = (await client.get(f"/api/robots/{MINI}/channels")).json()
        return [one["samples"] for one in told if one["key"] == "leak"] == [1]

    await until(is_listed)


async def test_a_value_that_cannot_be_true_raises_nothing(station, world):
    world.robots[MINI].sample(PLACE, "internal_temperature", 5000.0)
    world.robots[MINI].sample(PLACE, "leak", 1.0)
    await until(lambda: alarm(station, "channel leak"))
    assert alarm(station, "channel internal_temperature") is None
    assert station.fleet.status(MINI).impossible == {"internal_temperature": 1}


async def test_limits_of_the_station_are_judged_at_once(station, client, world):
    robot = world.robots[MINI]
    robot.sample(PLACE, "dissolved_oxygen", 3.0)

    async def is_told():
        state = (await client.get(f"/api/robots/{MINI}/state")).json()
        return "dissolved_oxygen" in state["channels"]

    await until(is_told)
    limits = {"alarms": [{"level": "warning", "low": 5.0}]}
    assert (await client.patch("/api/channels/dissolved_oxygen", json=limits)).status_code == 200
    found = await until(lambda: alarm(station, "channel dissolved_oxygen"))
    assert "3.00 mg/L, below its limit of 5.00 mg/L" in found.text
    # The sentence stays as it began while values wander beyond the limit.
    robot.sample(PLACE, "dissolved_oxygen", 2.0)
    robot.sample(PLACE, "leak", 1.0)
    await until(lambda: alarm(station, "channel leak"))
    assert alarm(station, "channel dissolved_oxygen").text == found.text
    assert (
        await client.patch("/api/channels/dissolved_oxygen", json={"alarms": []})
    ).status_code == 200
    await until(lambda: is_over(station, "channel dissolved_oxygen"))


async def test_a_leak_is_told_to_the_page_while_something_long_is_written(station, client, world):
    """A large import holds the only writer; neither one alarm nor the next waits for it."""
    told = []
    foundation = station.foundation
    foundation.bus.subscribe(AlarmChanged, lambda event: told.append(event.alarm.cause))
    await until(lambda: foundation.store.waiting_rows == 0)
    async with busy_writer(foundation.store):
        now = datetime.now(UTC)
        world.tell(Reading(MINI, "leak", 1.0, now, now))
        await until(lambda: "channel leak" in told)
        world.robots[MINI].sample(PLACE, "internal_temperature", 80.0)
        await until(lambda: "channel internal_temperature" in told)
        shown = (await client.get("/api/alarms")).json()["alarms"]
        assert {one["text"] for one in shown} >= {f"{MINI}: Leak says LEAK."}
        assert foundation.store.waiting_rows > 0
    await until(lambda: foundation.store.waiting_rows == 0)
