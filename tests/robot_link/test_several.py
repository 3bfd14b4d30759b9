"""Several channels in one frame: samples of one place, and what a robot reads of itself."""

import math
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from autonomy.channel import CHANNELS
from robot_link.clock import SystemClock
from robot_link.mavlink.codec import ROBOT_COMPONENT, Codec
from robot_link.mavlink.decode import decoded
from robot_link.mavlink.several import AT_ONCE, at_once, health_message, samples_message
from robot_link.messages import LinkState, LogId, RawFrame, Sample, SystemId
from robot_link.report import Reading
from robot_link.sample_log import Measurement
from tests.robot_link.rig import HASTE, MINI, rig, until
from tests.robot_link.target_case import NOW

ROBOT = Codec(SystemId(1), ROBOT_COMPONENT)
TOLD = [channel.key for channel in CHANNELS.values() if channel.wire_number]
PLACE = (1.5, -2.25, 3.0)


def measurements(values):
    keys = (TOLD * 2)[: len(values)]
    return [
        Measurement(key, value, PLACE, 0.25, NOW) for key, value in zip(keys, values, strict=True)
    ]


def over_the_air(message):
    (read,), bad = ROBOT.unpack(ROBOT.pack(message))
    assert bad == 0
    return decoded(read, MINI, NOW)


@given(
    st.lists(st.floats(width=32, allow_nan=False, allow_infinity=False), min_size=1, max_size=36)
)
def test_samples_of_one_place_arrive_each_under_its_own_number(values):
    taken = measurements(values)
    told = over_the_air(samples_message(LogId(7), 40, taken))
    assert [(one.variable, one.value) for one in told] == [(m.variable, m.value) for m in taken]
    assert [one.sequence for one in told] == list(range(40, 40 + len(values)))
    assert {(one.log, one.position_ned, one.position_std_m) for one in told} == {(7, PLACE, 0.25)}


def test_thirty_channels_take_less_than_four_frames_of_one():
    thirty = ROBOT.pack(samples_message(LogId(7), 0, measurements([math.pi] * 30)))
    one = ROBOT.pack(samples_message(LogId(7), 0, measurements([math.pi])))
    assert len(thirty) < 4 * len(one)
    assert len(thirty) - len(one) == 5 * 29


@pytest.mark.parametrize("count", [0, AT_ONCE + 1])
def test_a_count_that_cannot_be_is_refused(count):
    message = samples_message(LogId(7), 0, measurements([1.0]))
    message.count = count
    with pytest.raises(ValueError, match=f"carry {count}"):
        over_the_air(message)


def test_what_is_no_number_or_no_channel_is_refused():
    with pytest.raises(ValueError, match="not finite"):
        samples_message(LogId(7), 0, measurements([1.0, math.nan]))
    with pytest.raises(KeyError):
        samples_message(LogId(7), 0, [replace(measurements([1.0])[0], variable="wine")])
    message = samples_message(LogId(7), 0, measurements([1.0]))
    message.values = bytes([240, *message.values[1:]])
    with pytest.raises(ValueError, match="channel 240"):
        over_the_air(message)


def test_readings_arrive_and_what_is_not_known_is_left_out():
    told = over_the_air(health_message({"leak": 0.0, "humidity": math.nan, "gps_hdop": 1.5}, NOW))
    assert told == (
        Reading(MINI, "leak", 0.0, NOW, NOW),
        Reading(MINI, "gps_hdop", 1.5, NOW, NOW),
    )


def test_a_small_packet_takes_fewer_values():
    for payload in range(60, 260, 7):
        most = at_once(payload)
        assert most <= AT_ONCE
        if most:
            frame = ROBOT.pack(samples_message(LogId(2**32 - 1), 0, measurements([-1.1] * most)))
            assert len(frame) <= payload
    assert at_once(40) == 0


def kinds(data):
    return [message.get_type() for message in ROBOT.unpack(data).messages]


async def test_channels_of_one_moment_come_in_few_frames_and_are_acknowledged(tmp_path):
    patient = replace(HASTE, resend_s=60.0)  # nothing is lost, and nothing is to come twice
    async with rig(tmp_path, timing=patient) as it, it.station() as (station, heard):
        await until(lambda: station.link_report(MINI).state is LinkState.LIVE)
        robot = it.robots[MINI].link
        at = SystemClock().now()
        for number, key in enumerate(TOLD[:12]):
            robot.record_sample(key, float(number), PLACE, 0.25, at)
        robot.report_health({"leak": 1.0}, at)
        await until(lambda: not robot.unacknowledged_samples)
        await until(lambda: heard.of(Reading))
        sent = {one.sequence: one for one in heard.of(Sample)}
        assert [sent[number].variable for number in range(12)] == TOLD[:12]
        assert all(b.sequence == a.sequence + 1 for a, b in pairwise(sent.values()))
        assert [(one.channel, one.value) for one in heard.of(Reading)] == [("leak", 1.0)]
        frames = [one for one in heard.of(RawFrame) if not one.outgoing]
        (samples,) = [one for one in frames if "GRACE_SAMPLES" in kinds(one.data)]
        assert len(samples.data) < 150
