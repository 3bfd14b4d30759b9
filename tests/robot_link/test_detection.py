"""Heard tags on the wires: radio, satellite, and the robot's own memory."""

import math
from dataclasses import replace
from datetime import timedelta

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.link.sample_file import FileSampleLog
from robot_link.mavlink.codec import Codec
from robot_link.mavlink.decode import decoded
from robot_link.mavlink.detection import detection_of, entry_message, receiver_message
from robot_link.messages import LogId
from robot_link.report import Detection, ReceiverReport
from robot_link.sample_log import HeardTag, SampleKey
from robot_link.satellite.detection_code import packed_detections, unpacked_detections
from robot_link.satellite.frame import WireError
from robot_link.satellite.octets import OctetReader
from robot_link.satellite.record import (
    MobileOriginatedContent,
    compose,
    read_mobile_originated,
)
from tests.robot_link.satellite_case import KEY, NOW, ROBOT, SYSTEM

HEARD = HeardTag(480123, "A69-1601-179", None, (12.25, -340.5, 4.5), 8.0, NOW)
LOG = LogId(1_780_000_000)


def over_radio(message) -> object:
    frames = Codec(SYSTEM, 1).unpack(Codec(SYSTEM, 1).pack(message))
    return decoded(frames.messages[0], ROBOT, NOW)


def over_satellite(detections) -> tuple[Detection, ...]:
    return unpacked_detections(OctetReader(packed_detections(detections)), ROBOT, NOW)


def told(heard: HeardTag = HEARD, sequence: int = 7) -> Detection:
    return replace(detection_of(heard, ROBOT, LOG, sequence), received_at=NOW)


@pytest.mark.parametrize("sensor", [None, 0, 87])
def test_a_heard_tag_crosses_the_radio(sensor):
    heard = replace(HEARD, sensor=sensor)
    assert over_radio(entry_message(LOG, 7, heard)) == told(heard)
    assert told(heard).code_space == "A69-1601"


@pytest.mark.parametrize(
    "changes",
    [{"tag": "fish"}, {"position_std_m": math.nan}, {"position_std_m": -1.0}, {"sensor": 65_535}],
)
def test_what_cannot_be_is_not_kept(changes):
    with pytest.raises(ValueError, match="detection"):
        entry_message(LOG, 0, replace(HEARD, **changes))


@pytest.mark.parametrize("offset", [None, -75.5])
def test_how_a_receiver_fares_crosses_the_radio(offset):
    report = ReceiverReport(ROBOT, NOW, NOW, 480123, 12, 3, 2, 1, offset)
    assert over_radio(receiver_message(report)) == report


def test_a_detection_takes_twelve_bytes_by_satellite():
    tags = ("A69-1601-179", "A69-1601-204", "A69-9002-4711")
    heard = [
        told(
            replace(
                HEARD,
                tag=tags[n % 3],
                sensor=87 if n % 3 == 2 else None,
                position_ned=(3.0 * n, -2.0 * n, n % 9),
                measured_at=NOW + timedelta(seconds=47 * n),
            ),
            12 * n,
        )
        for n in range(20)
    ]
    assert len(packed_detections(heard)) <= 12 * len(heard)
    back = over_satellite(heard)
    assert [(one.tag, one.sensor, one.sequence) for one in back] == [
        (one.tag, one.sensor, one.sequence) for one in heard
    ]
    assert [one.measured_at for one in back] == [one.measured_at for one in heard]


_detections = st.builds(
    lambda tag, sensor, sequence, place, std, late: told(
        HeardTag(480123, f"A69-1601-{tag}", sensor, place, std, NOW + timedelta(seconds=late)),
        sequence,
    ),
    st.integers(1, 65_535),
    st.none() | st.integers(0, 65_534),
    st.integers(0, 2**32 - 1),
    st.tuples(*(st.floats(-20_000.0, 20_000.0),) * 3),
    st.floats(0.0, 1000.0),
    st.integers(-86_400, 86_400),
)


@given(st.lists(_detections, max_size=12, unique_by=lambda one: one.sequence))
def test_detections_cross_the_satellite_to_the_metre(detections):
    back = over_satellite(detections)
    assert len(back) == len(detections)
    for one, other in zip(sorted(detections, key=lambda one: one.sequence), back, strict=True):
        assert (one.tag, one.sensor, one.sequence) == (other.tag, other.sensor, other.sequence)
        assert abs(one.measured_at - other.measured_at) <= timedelta(seconds=0.5)
        assert math.dist(one.position_ned, other.position_ned) <= 1.0


@given(st.binary(max_size=60))
def test_garbage_is_no_block_of_detections(data):
    try:
        unpacked_detections(OctetReader(data), ROBOT, NOW)
    except WireError:
        return


def test_a_record_carries_detections_beside_what_else_it_says():
    content = MobileOriginatedContent(counter=3, detections=(told(), told(sequence=9)))
    record = compose(content, KEY, SYSTEM, 205)
    back = read_mobile_originated(record, KEY, SYSTEM, ROBOT, NOW)
    assert [one.sequence for one in back.detections] == [7, 9]
    assert back.samples == ()


def test_a_heard_tag_outlives_the_program(tmp_path):
    path = tmp_path / "samples"
    key = FileSampleLog(path, LOG).append(replace(HEARD, sensor=3))
    kept = FileSampleLog(path, LogId(LOG + 1))
    assert kept.get(key) == replace(HEARD, sensor=3)
    kept.forget([key])
    assert FileSampleLog(path, LogId(LOG + 2)).get(SampleKey(*key)) is None
