"""Standard telemetry: who gets it, how often, and what it says."""

import asyncio
import math
from dataclasses import replace
from datetime import timedelta

import pytest

from autonomy.frames import convergence_rad
from onboard.link.standard_telemetry import (
    TelemetrySource,
    autopilot_version,
    telemetry_message,
)
from onboard.link.stream import DEFAULT_PERIODS_S, StreamBudget, Streams, frame_bytes
from onboard.link.waypoint_mission import WaypointRules
from robot_link.clock import SystemClock, monotonic_s
from robot_link.mavlink.wire import grace
from robot_link.messages import SystemId
from robot_link.service.pace import Pace
from tests.robot_link.rig import state
from tests.robot_link.service_pair import Wire

RULES = WaypointRules(origin_latitude_deg=43.0, origin_longitude_deg=-84.0)
ATTITUDE = grace.MAVLINK_MSG_ID_ATTITUDE
PLENTY = StreamBudget(math.inf)


def sent_bytes(streams: Streams, budget: StreamBudget, seconds: float) -> int:
    ticks = [0.02 * tick for tick in range(round(seconds / 0.02))]
    return sum(frame_bytes(one) for now_s in ticks for one in streams.due(now_s, budget))


@pytest.mark.parametrize("bytes_per_s", [20.0, 100.0, 300.0])
def test_streams_never_take_more_than_the_link_carries(bytes_per_s: float):
    streams = Streams()
    streams.begin_default()
    first = sum(frame_bytes(message) for message in DEFAULT_PERIODS_S)
    total = sent_bytes(streams, StreamBudget(bytes_per_s), 100.0)
    assert 0.7 * 100 * bytes_per_s < total <= 100 * bytes_per_s + first


def test_a_link_that_carries_everything_is_not_slowed():
    assert PLENTY.periods_s(DEFAULT_PERIODS_S) == dict(DEFAULT_PERIODS_S)
    slowed = StreamBudget(50.0).periods_s(DEFAULT_PERIODS_S)
    ratios = {slowed[message] / DEFAULT_PERIODS_S[message] for message in DEFAULT_PERIODS_S}
    assert max(ratios) - min(ratios) < 1e-9
    assert StreamBudget(0.0).periods_s({ATTITUDE: 1.0}) == {ATTITUDE: math.inf}


def test_a_ground_station_gets_nothing_before_it_asks_and_what_it_asks_for():
    streams = Streams()
    assert streams.due(0.0, PLENTY) == []
    assert not streams.is_wanted
    assert streams.set_interval(ATTITUDE, 100_000)
    assert streams.interval_us(ATTITUDE) == 100_000
    due = [streams.due(0.01 * tick, PLENTY) for tick in range(100)]
    assert 9 <= sum(map(len, due)) <= 10
    assert streams.set_interval(ATTITUDE, -1)
    assert streams.due(9.0, PLENTY) == []
    assert streams.interval_us(ATTITUDE) == -1
    assert streams.set_interval(ATTITUDE, 0)
    assert streams.interval_us(ATTITUDE) == round(DEFAULT_PERIODS_S[ATTITUDE] * 1e6)
    assert not streams.set_interval(grace.MAVLINK_MSG_ID_RAW_IMU, 1000)
    assert not streams.set_interval(ATTITUDE, -7)
    assert not streams.set_interval(ATTITUDE, math.nan)


def test_every_standard_message_says_what_the_robot_believes():
    at = SystemClock().now()
    source = TelemetrySource(state(at), at - timedelta(seconds=12), RULES)
    wire = Wire(lambda _: [])
    heard = {}
    for message_id in DEFAULT_PERIODS_S:
        message = telemetry_message(message_id, source)
        assert message is not None
        heard[message.get_type()] = wire.over_the_wire(message)
    assert heard["ATTITUDE"].pitch == pytest.approx(-0.4321)
    assert heard["ATTITUDE"].time_boot_ms == 12_000
    assert heard["GLOBAL_POSITION_INT"].relative_alt == -375
    assert heard["GLOBAL_POSITION_INT"].lat == pytest.approx(430_000_112, abs=3)
    assert heard["GLOBAL_POSITION_INT"].hdg == round(math.degrees(3.1) * 100)
    assert heard["LOCAL_POSITION_NED"].z == 0.375
    assert heard["SCALED_PRESSURE"].press_abs == pytest.approx(1013.25 + 98.0665 * 0.375)
    assert heard["BATTERY_STATUS"].voltages[0] == 7412
    assert heard["SYS_STATUS"].battery_remaining == 88
    # MAVProxy says "fence breach" where this bit is not set.
    assert heard["SYS_STATUS"].onboard_control_sensors_health & grace.MAV_SYS_STATUS_GEOFENCE
    present = heard["SYS_STATUS"].onboard_control_sensors_present
    assert present & grace.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
    assert heard["SYS_STATUS"].onboard_control_sensors_health & present == (
        heard["SYS_STATUS"].onboard_control_sensors_enabled
    )
    assert heard["GPS_RAW_INT"].fix_type == grace.GPS_FIX_TYPE_3D_FIX
    assert telemetry_message(grace.MAVLINK_MSG_ID_RAW_IMU, source) is None


def test_states_beyond_the_wires_ranges_are_clipped():
    at = SystemClock().now()
    wild = replace(
        state(at),
        position_ned=(0.0, 0.0, 1e9),
        velocity_ned=(1e6, -1e6, 1e6),
        battery_v=1e6,
        battery_fraction=7.0,
        heading_rad=-1.0,
    )
    wire = Wire(lambda _: [])
    for message_id in DEFAULT_PERIODS_S:
        message = telemetry_message(message_id, TelemetrySource(wild, at, RULES))
        assert message is not None
        wire.over_the_wire(message)


def test_the_version_says_what_the_robot_can_do():
    version = autopilot_version(SystemId(7))
    assert version.capabilities & grace.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
    assert version.capabilities & grace.MAV_PROTOCOL_CAPABILITY_FTP
    assert not version.capabilities & grace.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST


async def test_states_and_samples_together_keep_to_what_the_air_carries():
    pace = Pace(lambda: 20_000.0)
    began_s = monotonic_s()
    await asyncio.gather(*(spend_all(pace, size, 60) for size in (100, 1000)))
    took_s = monotonic_s() - began_s
    assert took_s >= (60 * 1100 - 2 * 20_000 - 1100) / 20_000


async def test_a_link_that_carries_everything_makes_nobody_wait():
    for rate in (math.inf, 0.0):
        pace = Pace(lambda rate=rate: rate)
        async with asyncio.timeout(60.0):
            await spend_all(pace, 10**9, 1000)


async def spend_all(pace: Pace, size: int, times: int) -> None:
    for _ in range(times):
        await pace.spend(size)


def test_a_heading_far_from_the_origin_is_told_from_true_north():
    at = SystemClock().now()
    far = replace(
        state(at), position_ned=(0.0, 50_000.0, 1.0), heading_rad=1.0, velocity_ned=(1.0, 0.0, 0.0)
    )
    source = TelemetrySource(far, at, RULES)
    message = telemetry_message(grace.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, source)
    told = Wire(lambda _: []).over_the_wire(message)
    lead_deg = math.degrees(float(convergence_rad(far.position_ned[:2], RULES.origin_latitude_deg)))
    assert lead_deg > 0.3
    assert told.hdg / 100 == pytest.approx(math.degrees(1.0) + lead_deg, abs=0.01)
    assert told.vy == round(100.0 * math.sin(math.radians(lead_deg)))
