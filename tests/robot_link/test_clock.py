"""A robot's clock against the station's, by questions and by the stamps of its states."""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

import pytest

from robot_link.mavlink.codec import WireMessage
from robot_link.mavlink.wire import grace
from robot_link.service.clock_sync import ClockOffset, ClockSource, ClockWatch, time_answer, time_ns
from robot_link.station.error import NoAnswerError
from tests.robot_link.service_pair import HASTY, Wire

NOON = datetime(2026, 6, 1, 12, tzinfo=UTC)


@dataclass
class SetClock:
    at: datetime = NOON
    speed: float = 1.0

    def now(self) -> datetime:
        return self.at


def pair(robot: SetClock, station: SetClock, way_s: float = 0.0) -> tuple[ClockWatch, Wire]:
    """A robot that is ``way_s`` of the station's clock away, each way."""

    def answer(message: WireMessage) -> list[WireMessage]:
        assert isinstance(message, grace.MAVLink_timesync_message)
        station.at += timedelta(seconds=way_s)
        robot.at += timedelta(seconds=way_s)
        said = time_answer(message, robot)
        station.at += timedelta(seconds=way_s)
        robot.at += timedelta(seconds=way_s)
        return [] if said is None else [said]

    wire = Wire(answer)
    watch = ClockWatch(wire, station, patience=HASTY)
    wire.client = watch.hear
    return watch, wire


@pytest.mark.parametrize("offset_s", [0.0, -0.25, 7200.0, -3e8])
async def test_the_offset_is_found_whatever_the_way_takes(offset_s: float):
    robot = SetClock(NOON + timedelta(seconds=offset_s))
    watch, _ = pair(robot, SetClock(), way_s=0.4)
    assert watch.offset is None
    offset = await watch.measure()
    assert offset == watch.offset
    assert offset.offset_s == pytest.approx(offset_s, abs=1e-3)
    assert offset.uncertainty_s == pytest.approx(0.4)
    assert offset.source is ClockSource.TIMESYNC
    assert offset.is_wrong == (abs(offset_s) > 3600.0)


async def test_lost_and_doubled_answers_do_not_matter():
    watch, wire = pair(SetClock(NOON + timedelta(hours=3)), SetClock())
    wire.loss, wire.duplication = 0.5, 0.5
    assert (await watch.measure()).offset_s == pytest.approx(3 * 3600.0)


async def test_a_vehicle_that_does_not_answer_is_judged_by_its_stamps():
    watch, wire = pair(SetClock(), SetClock())
    wire.is_cut = True
    with pytest.raises(NoAnswerError, match="did not tell its time"):
        await watch.measure()
    for late_s in (0.5, 0.2, 3.0):
        received = NOON + timedelta(seconds=late_s)
        watch.note_frame(NOON - timedelta(days=4000), received)
    offset = watch.offset
    assert offset is not None
    assert offset.source is ClockSource.FRAMES
    assert offset.offset_s == pytest.approx(-4000 * 86400.0 - 0.2)
    assert offset.is_wrong
    assert offset.sentence.startswith("its clock is 11 years behind")


async def test_a_clock_that_jumps_after_it_was_measured_is_noticed_at_once():
    watch, _ = pair(SetClock(), SetClock())
    await watch.measure()
    watch.note_frame(NOON, NOON + timedelta(seconds=1))
    assert watch.offset is not None
    assert watch.offset.source is ClockSource.TIMESYNC
    received = NOON + timedelta(seconds=60)
    watch.note_frame(NOON - timedelta(days=400), received)
    assert watch.offset.is_wrong
    watch.note_frame(received, received)
    assert not watch.offset.is_wrong


@pytest.mark.parametrize(
    ("offset_s", "says"),
    [
        (0.0, ""),
        (3700.0, "its clock is 62 minutes ahead"),
        (-10 * 3600.0, "its clock is 10 hours behind"),
        (5 * 86400.0, "its clock is 5 days ahead"),
        (-3.2e8, "its clock is 10 years behind"),
    ],
)
def test_the_operator_is_told_how_far_it_is_off(offset_s: float, says: str):
    offset = ClockOffset(offset_s, 1.0, ClockSource.TIMESYNC, NOON)
    assert offset.sentence.startswith(says)
    assert bool(offset.sentence) == bool(says)


def test_an_uncertain_measurement_accuses_nobody():
    assert not ClockOffset(5000.0, 2000.0, ClockSource.TIMESYNC, NOON).is_wrong


def test_answers_are_not_answered():
    clock = SetClock()
    assert time_answer(grace.MAVLink_timesync_message(tc1=5, ts1=6), clock) is None
    said = time_answer(grace.MAVLink_timesync_message(tc1=0, ts1=6), clock)
    assert said is not None
    assert (said.tc1, said.ts1) == (time_ns(NOON), 6)
