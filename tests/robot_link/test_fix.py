"""GRACE_FIX and VISION_POSITION_ESTIMATE byte by byte, and what no robot may take."""

import math
from dataclasses import replace
from datetime import timedelta

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_link.mavlink.codec import STATION_COMPONENT, STATION_SYSTEM, Codec
from robot_link.mavlink.fix import FIX_FRAME_BYTES, fix_message, received_fix
from robot_link.mavlink.telemetry import microseconds
from robot_link.mavlink.wire import grace
from robot_link.messages import SystemId
from tests.robot_link.fix_case import AT, FIX

SYSTEM = SystemId(7)
PLACE = st.floats(-100.0, 100.0, width=32)
VARIANCE = st.floats(2.0**-26, 0.25, width=32)


def over_the_wire(message):
    codec = Codec(STATION_SYSTEM, STATION_COMPONENT)
    (heard,) = codec.unpack(codec.pack(message)).messages
    return heard


def motion_capture(**changes):
    """What another laboratory sends, of a place known to a millimetre and a turn to a degree."""
    covariance = [0.0] * 21
    for place, variance in ((0, 1e-6), (6, 1e-6), (11, 1e-6), (15, 3e-4), (18, 3e-4), (20, 3e-4)):
        covariance[place] = variance
    told = {"usec": microseconds(AT), "x": 1.4, "y": 0.7, "z": 0.5}
    told |= {"roll": 0.0, "pitch": -0.3, "yaw": 0.8}
    return grace.MAVLink_vision_position_estimate_message(
        **{**told, "covariance": covariance, **changes}
    )


@given(PLACE, PLACE, PLACE, VARIANCE, VARIANCE, st.floats(-0.9, 0.9), st.floats(-4.0, 7.0))
def test_fix_arrives_as_it_was_found(north, east, down, xx, yy, correlation, heading):
    xy = correlation * math.sqrt(xx * yy)
    sent = replace(
        FIX, ned_m=(north, east, down), covariance_m2=(xx, xy, 0, yy, 0, xx), heading_rad=heading
    )
    told = received_fix(over_the_wire(fix_message(sent, SYSTEM, 0.0)))
    assert told.ned_m == pytest.approx(sent.ned_m, abs=1e-5)
    assert told.covariance_ne_m2 == pytest.approx((xx, xy, yy), rel=1e-5)
    assert told.depth_variance_m2 == pytest.approx(xx)
    assert told.heading_rad is not None
    assert math.remainder(told.heading_rad - heading, math.tau) == pytest.approx(0.0, abs=1e-4)
    assert (told.roll_rad, told.pitch_rad, told.tilt_std_rad) == pytest.approx((0.03, -0.35, 0.011))
    assert (told.rms, told.cameras, told.tags) == (pytest.approx(1.2), 2, 2)


@given(st.floats(-1e6, 1e6))
def test_time_of_the_pictures_is_told_by_the_clock_of_the_robot(offset_s):
    told = received_fix(over_the_wire(fix_message(FIX, SYSTEM, offset_s)))
    assert told.measured_at == AT + timedelta(seconds=offset_s)


def test_frame_takes_64_bytes_and_names_its_robot():
    frame = Codec(STATION_SYSTEM, STATION_COMPONENT).pack(fix_message(FIX, SYSTEM, 0.0))
    assert len(frame) == FIX_FRAME_BYTES == 64
    assert frame[-3] == SYSTEM  # the last byte of the payload, before the checksum


def test_what_is_not_sure_is_not_told():
    place = replace(FIX, heading_rad=None, roll_rad=None, pitch_rad=None, quality="position_only")
    told = received_fix(over_the_wire(fix_message(place, SYSTEM, 0.0)))
    assert (told.heading_rad, told.roll_rad, told.pitch_rad) == (None, None, None)


@pytest.mark.parametrize(
    "change",
    [
        {"quality": "refused", "reason": "rms 5.4"},
        {"ned_m": (math.nan, 0.0, 0.0)},
        {"ned_m": (0.0, math.inf, 0.0)},
        {"covariance_m2": (math.nan, 0.0, 0.0, 1e-6, 0.0, 1e-6)},
        {"covariance_m2": (1e-6, 1e-6, 0.0, 1e-6, 0.0, 1e-6)},
        {"covariance_m2": (0.0, 0.0, 0.0, 1e-6, 0.0, 1e-6)},
        {"covariance_m2": (1.1, 0.0, 0.0, 1e-6, 0.0, 1e-6)},
        {"covariance_m2": (1e-6, 0.0, 0.0, 1e-6, 0.0, -1e-6)},
        {"heading_rad": math.nan},
        {"heading_std_rad": -0.1},
        {"rms": math.nan},
    ],
)
def test_fix_that_cannot_be_is_not_sent(change):
    with pytest.raises(ValueError, match="fix"):
        fix_message(replace(FIX, **change), SYSTEM, 0.0)


@given(st.binary(min_size=52, max_size=52))
def test_any_bytes_are_a_finite_fix_of_a_known_place_or_refused(payload):
    fields = grace.MAVLink_grace_fix_message.unpacker.unpack(payload)
    order = grace.MAVLink_grace_fix_message.orders
    message = grace.MAVLink_grace_fix_message(*(fields[place] for place in order))
    try:
        told = received_fix(message)
    except ValueError:
        return
    assert all(map(math.isfinite, (*told.ned_m, *told.covariance_ne_m2)))
    assert 0.0 < told.variance_m2 <= 1.0


def test_motion_capture_of_another_laboratory_is_the_same_kind_of_fix():
    told = received_fix(over_the_wire(motion_capture(yaw=4.0)))
    assert told.measured_at == AT
    assert told.ned_m == pytest.approx((1.4, 0.7, 0.5))
    assert told.variance_m2 == pytest.approx(1e-6)
    assert told.heading_rad == pytest.approx(4.0 - math.tau)
    assert told.pitch_rad == pytest.approx(-0.3)
    assert told.tilt_std_rad == pytest.approx(math.sqrt(3e-4))


@pytest.mark.parametrize(
    "change",
    [
        {"covariance": [math.nan] + [0.0] * 20},  # as the standard says "unknown"
        {"covariance": [0.0] * 21},
        {"x": math.nan},
        {"z": math.inf},
        {"usec": 2**64 - 1},
    ],
)
def test_motion_capture_that_says_no_place_is_refused(change):
    with pytest.raises(ValueError, match=r"fix|time"):
        received_fix(over_the_wire(motion_capture(**change)))
