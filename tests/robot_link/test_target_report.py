"""What a robot says of its target: by radio, in a satellite record, and what is refused of it."""

import itertools
import math
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from autonomy.tracking.phase import SpeedClass, TargetPhase
from robot_link.clock import SystemClock
from robot_link.mavlink.codec import ROBOT_COMPONENT, Codec
from robot_link.mavlink.decode import decoded
from robot_link.mavlink.target import TARGET_FRAME_BYTES, can_travel, target_message, target_report
from robot_link.mavlink.wire import grace
from robot_link.messages import (
    CommandKind,
    CommandLevel,
    CommandNumber,
    CommandReport,
    LinkState,
    OnboardPlanState,
    SystemId,
)
from robot_link.report import TargetEstimate, TargetReport
from robot_link.satellite.frame import WireError, sealed_down, sealed_up
from robot_link.satellite.order import pack_order, read_order
from robot_link.satellite.record import (
    MobileOriginatedContent,
    Reason,
    ShortPlanReport,
    compose,
    read_mobile_originated,
    sample_room,
)
from simulator.xbee_network import AirConditions
from tests.robot_link import satellite_case
from tests.robot_link.rig import MINI, ROUGH, rig, until
from tests.robot_link.target_case import NOW, track, tracking_mission

ROBOT = Codec(SystemId(1), ROBOT_COMPONENT)
ANSWERED = timedelta(hours=1)
VIRTUAL = track(true_ne_m=(1.5, 0.75), is_quiet=True, is_feasible=True)
SWIMS = track(is_too_fast=True, speed_class=SpeedClass.FAST, delay_s=1.5)
WAITING = track(phase=TargetPhase.WAITING, hypotheses=(), range_m=None, range_age_s=0.0)


def over_the_air(report: TargetReport) -> TargetReport:
    (message,), bad = ROBOT.unpack(ROBOT.pack(target_message(report)))
    assert bad == 0
    return decoded(message, report.robot, report.received_at)


# ---- by radio ----------------------------------------------------------------------------------


@pytest.mark.parametrize("report", [track(), VIRTUAL, WAITING, SWIMS, track(hypotheses=())])
def test_report_arrives_as_it_was(report):
    assert over_the_air(report) == report


@given(st.sampled_from(TargetPhase), st.booleans(), st.booleans(), st.integers(0, 2**32 - 1))
def test_every_phase_switch_and_count_arrives(phase, first, second, heard):
    report = track(
        phase=phase, is_barrier_on=first, is_feasible=second, is_quiet=first, ranges_heard=heard
    )
    report = replace(report, ranges_rejected=min(heard, 12))
    assert over_the_air(report) == report


def test_bytes_of_a_report_stay_what_they_are():
    payload = target_message(track()).pack(grace.MAVLink(None))[10:-2]
    assert payload.hex() == (
        "009015ef2f530600"
        "0000a03f000000bf"  # time; x, y
        "0000e03f0000003f"
        "0000203f0000c0bf"  # target x, y
        "0000003d00000000"
        "000080bc0000003c"  # target vx, vy
        "0000803e0000003f"
        "000080bd0000003e"
        "0000003f0000003e"  # covariance xx, xy, yy
        "0000403f0000803e"  # weight
        "0000903f0000003f"
        "000080bd000000bd0000c03e"  # range, age; determinant, barrier, condition
        "000000bf0000003c"
        "0000403f000000bc"
        "0000000000000000"  # nominal; command; truth
        "70110100"
        "0c000000"
        "010203"  # heard, rejected; phase, hypotheses, flags
    )
    assert len(payload) + 12 == TARGET_FRAME_BYTES - 5 == 147
    swims = target_message(SWIMS).pack(grace.MAVLink(None))[10:-2]
    assert swims[:135].hex() == payload.hex()[:-2] + "23"
    assert swims[135:].hex() == "0000c03f03"  # behind what older robots say: delay, speed class


def test_age_of_no_range_does_not_travel():
    report = replace(WAITING, range_age_s=math.inf)
    assert can_travel(report)
    assert over_the_air(report) == WAITING


@pytest.mark.parametrize("age_s", [math.nan, math.inf, -1.0])
def test_age_that_came_without_a_range_is_not_kept(age_s):
    message = target_message(WAITING)
    message.range_age = age_s
    (received,), _ = ROBOT.unpack(ROBOT.pack(message))
    assert target_report(received, MINI, NOW).range_age_s == 0.0


def test_third_hypothesis_stays_on_board():
    three = (*track().hypotheses, track().hypotheses[0])
    assert over_the_air(track(hypotheses=three)) == track()


@pytest.mark.parametrize(
    ("field", "value", "sentence"),
    [
        ("x", math.nan, "not finite"),
        ("target_y", [0.0, math.inf], "not finite"),
        ("barrier", -math.inf, "not finite"),
        ("true_x", math.nan, "not finite"),
        ("weight", [1.5, 0.0], "probability"),
        ("weight", [-0.5, 0.0], "probability"),
        ("covariance_xx", [-1.0, 1.0], "covariance"),
        ("covariance_xy", [2.0, 0.0], "covariance"),
        ("range", -1.0, "a range of -1 m"),
        ("range_age", -1.0, "-1 s old"),
        ("inverse_condition", 1.5, "inverse condition"),
        ("ranges_rejected", 70_001, "not believed"),
        ("phase", 5, "phase 5"),
        ("hypotheses", 3, "hypotheses or flags"),
        ("flags", 64, "hypotheses or flags"),
        ("speed_class", 4, "speed class"),
        ("time_utc_us", 2**64 - 1, "time is impossible"),
    ],
)
def test_impossible_report_is_refused_with_a_sentence(field, value, sentence):
    message = target_message(track())
    setattr(message, field, value)
    (received,), _ = ROBOT.unpack(ROBOT.pack(message))
    with pytest.raises(ValueError, match=sentence):
        target_report(received, MINI, NOW)


@pytest.mark.parametrize(
    "impossible",
    [
        track(determinant_m2_s=math.nan),
        track(barrier=1e39),
        track(ranges_heard=2**32, ranges_rejected=0),
        track(ranges_heard=-1),
        track(hypotheses=(TargetEstimate((0.0, 0.0), (0.0, 0.0), (math.inf, 0.0, 1.0), 1.0),)),
        track(hypotheses=(TargetEstimate((0.0, 0.0), (0.0, 0.0), (1.0, 2.0, 1.0), 1.0),)),
    ],
)
async def test_report_that_cannot_be_is_dropped_on_board_and_the_next_arrives(
    tmp_path: Path, impossible
):
    assert not can_travel(impossible)
    async with rig(tmp_path) as it, it.station() as (station, heard):
        await until(lambda: station.link_report(MINI).state is LinkState.LIVE)
        it.robots[MINI].link.report_target(impossible)
        it.robots[MINI].link.report_target(track())
        await until(lambda: heard.of(TargetReport))
        (arrived,) = heard.of(TargetReport)
        assert replace(arrived, received_at=NOW) == track()
        assert station.link_report(MINI).frames_bad == 0


async def test_newer_report_replaces_those_that_a_busy_radio_did_not_take(tmp_path: Path):
    async with rig(tmp_path, AirConditions(delay_s=0.05)) as it, it.station() as (station, heard):
        await until(lambda: station.link_report(MINI).state is LinkState.LIVE)
        for number in range(20):
            it.robots[MINI].link.report_target(track(ranges_heard=100 + number))
        await until(lambda: [one.ranges_heard for one in heard.of(TargetReport)][-1:] == [119])
        assert len(heard.of(TargetReport)) < 5


async def test_reports_get_through_rough_air_unharmed(tmp_path: Path):
    async with rig(tmp_path, ROUGH) as it, it.station() as (_, heard):
        numbers = itertools.count(100)

        def enough() -> bool:
            it.robots[MINI].link.report_target(track(ranges_heard=next(numbers)))
            return len(heard.of(TargetReport)) > 5

        await until(enough)
        for one in heard.of(TargetReport):
            assert replace(one, received_at=NOW) == track(ranges_heard=one.ranges_heard)


async def test_order_to_follow_goes_on_board_under_its_hash(tmp_path: Path):
    plan = tracking_mission()
    async with rig(tmp_path, ROUGH) as it, it.station() as (station, _):
        await until(lambda: station.link_report(MINI).state is LinkState.LIVE)
        report = await station.upload(MINI, plan)
        assert (report.state, report.sha256) == (OnboardPlanState.ON_BOARD, plan.sha256())
        (taken,) = it.robots[MINI].program.taken
        assert taken == plan


# ---- orders ------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [CommandKind.QUIET, CommandKind.PING])
async def test_order_to_be_quiet_or_to_ping_acts_once_however_often_it_is_sent(
    tmp_path: Path, kind
):
    number, expires = CommandNumber(7), SystemClock().now() + ANSWERED
    async with rig(tmp_path, ROUGH) as it, it.station() as (station, heard):
        await until(lambda: station.link_report(MINI).state is LinkState.LIVE)

        def applied() -> int:
            return sum(one.level is CommandLevel.APPLIED for one in heard.of(CommandReport))

        for times in (1, 2):
            station.send_command(MINI, kind, number, expires)
            await until(lambda: applied() >= times)  # noqa: B023 - awaited at once
        assert it.robots[MINI].program.obeyed == [(kind, "")]


@pytest.mark.parametrize(("kind", "code"), [(CommandKind.QUIET, 5), (CommandKind.PING, 6)])
def test_order_by_satellite_is_the_same_order(kind, code):
    number, system, key = CommandNumber(9), satellite_case.SYSTEM, satellite_case.KEY
    sealed = pack_order(kind, number, NOW, None, key, system, 3)
    assert sealed[6] == code
    assert len(sealed) == 28
    command = read_order(sealed[:-8]).command
    assert (command.kind, command.number, command.plan_digits) == (kind, number, "")
    named = sealed[:14] + bytes([1]) * 6
    assert sealed_down(named, key, system) != sealed
    with pytest.raises(WireError, match="names a plan"):
        read_order(named)


# ---- by satellite ------------------------------------------------------------------------------


def told(content: MobileOriginatedContent, size: int = 340) -> MobileOriginatedContent:
    key, system = satellite_case.KEY, satellite_case.SYSTEM
    record = compose(content, key, system, size)
    assert len(record) <= size
    return read_mobile_originated(record, key, system, satellite_case.ROBOT, NOW)


STATE = satellite_case.state()
PLAN = ShortPlanReport("0123456789abcdef", OnboardPlanState.RUNNING, 0, 0, 1.0)


@pytest.mark.parametrize("report", [track(), VIRTUAL, WAITING, SWIMS])
def test_record_tells_every_estimate_and_the_rest_of_the_report(report):
    found = told(MobileOriginatedContent(7, STATE, PLAN, target=report)).target
    assert found is not None
    assert (found.robot, found.measured_at) == (STATE.robot, STATE.measured_at)
    assert found.position_ne_m == pytest.approx(STATE.position_ned[:2], abs=5e-4)
    for got, said in zip(found.hypotheses, report.hypotheses, strict=True):
        assert got.position_ne_m == pytest.approx(said.position_ne_m, abs=5e-4)
        assert got.velocity_ne_m_s == pytest.approx(said.velocity_ne_m_s, abs=5e-4)
        assert got.covariance_m2 == pytest.approx(said.covariance_m2, rel=2**-16)
        assert got.weight == pytest.approx(said.weight, abs=0.5 / 255)
    same = ("phase", "range_m", "ranges_heard", "ranges_rejected", "nominal", "command", "barrier")
    flags = ("is_barrier_on", "is_feasible", "is_quiet", "true_ne_m", "determinant_m2_s")
    swims = ("is_too_fast", "speed_class", "delay_s")
    for name in (*same, *flags, *swims):
        assert getattr(found, name) == getattr(report, name), name
    assert found.range_age_s == pytest.approx(report.range_age_s, abs=0.05)
    assert found.inverse_condition == pytest.approx(report.inverse_condition, abs=0.5 / 255)


def test_track_gives_way_to_what_proves_levels_and_samples_fill_the_rest():
    samples = tuple(satellite_case.sample(3 * number) for number in range(40))
    content = MobileOriginatedContent(7, STATE, PLAN, samples=samples, target=track())
    assert told(content, 70).target is None
    small, large = told(content, 120), told(content, 340)
    assert small.target.hypotheses == large.target.hypotheses[:1], "both would not fit"
    assert len(large.target.hypotheses) == 2
    assert len(large.samples) > len(small.samples)
    without = replace(content, target=None)
    assert sample_room(without, 340) - sample_room(content, 340) == 27 + 22 + 22 + 5
    for size in range(70, 341):
        assert sample_room(content, size) >= 0
    assert told(replace(content, state=None)).target is None


def test_numbers_beyond_a_field_of_the_record_stop_at_its_border():
    far = TargetEstimate((1e9, -1e9), (100.0, -100.0), (1.0, 0.0, 1.0), 1.0)
    report = track(hypotheses=(far,), range_m=1e6, range_age_s=1e6, ranges_heard=2**30)
    found = told(MobileOriginatedContent(7, STATE, target=report)).target
    assert found.hypotheses[0].velocity_ne_m_s == (32.767, -32.767)
    assert found.hypotheses[0].position_ne_m[0] == pytest.approx(2_147_483.647)
    assert (found.range_m, found.range_age_s) == (16_777.215, 6553.5)
    assert found.ranges_heard == 2**24 - 1


def record_with(track_bytes: bytes, *, has_state: bool = True) -> bytes:
    key, system = satellite_case.KEY, satellite_case.SYSTEM
    whole = compose(MobileOriginatedContent(7, STATE, target=WAITING), key, system, 340)[:-8]
    flags = 16 | 2 * has_state
    state = whole[6:39] if has_state else b""
    body = whole[:1] + bytes([flags]) + whole[2:6] + state + track_bytes
    return sealed_up(body, key, system)


GOOD = bytes([0, 0, 0]) + bytes(18) + bytes(6)


@pytest.mark.parametrize(
    ("track_bytes", "has_state", "sentence"),
    [
        (GOOD, False, "without a state"),
        (GOOD[:-1], True, "ends too early"),
        (bytes([5]) + GOOD[1:], True, "phase 5"),
        (bytes([0, 128]) + GOOD[2:] + b"\x08\x00", True, "motion 0x8"),
        (bytes([0, 128]) + GOOD[2:] + b"\x03\x00", True, "3 is not a valid SpeedClass"),
        (bytes([0, 64]) + GOOD[2:], True, "a second estimate and no first"),
        (GOOD[:3] + b"\x7f\x80\x00" + GOOD[6:], True, "a value is impossible"),
        (GOOD[:-1] + b"\x01", True, "not believed"),
        (GOOD + b"\0", True, "something follows"),
    ],
)
def test_record_with_an_impossible_track_is_refused(track_bytes, has_state, sentence):
    key, system = satellite_case.KEY, satellite_case.SYSTEM
    record = record_with(track_bytes, has_state=has_state)
    with pytest.raises(WireError, match=sentence):
        read_mobile_originated(record, key, system, satellite_case.ROBOT, NOW)


OLDER = (
    "010b60bd8000bd0000bf00003c00003f4000bc000001117000000c"
    "000006d600000271001ffff03e8000bd80003f0000bf0004650005"
)
"""A track of one estimate, as robots wrote it before there was a place for a second."""


def test_track_of_an_older_robot_is_read():
    key, system = satellite_case.KEY, satellite_case.SYSTEM
    record = record_with(bytes.fromhex(OLDER))
    found = read_mobile_originated(record, key, system, satellite_case.ROBOT, NOW).target
    (only,) = found.hypotheses
    assert only.position_ne_m == (1.75, 0.625)
    assert only.weight == pytest.approx(0.75, abs=0.5 / 255)
    assert (found.range_m, found.range_age_s) == (1.125, 0.5)


def test_least_track_is_taken():
    key, system = satellite_case.KEY, satellite_case.SYSTEM
    record = record_with(GOOD)
    found = read_mobile_originated(record, key, system, satellite_case.ROBOT, NOW).target
    assert (found.phase, found.hypotheses, found.range_m) == (TargetPhase.WAITING, (), None)


@settings(max_examples=300)
@given(st.binary(min_size=0, max_size=80))
def test_any_bytes_are_a_possible_track_or_refused(data):
    key, system = satellite_case.KEY, satellite_case.SYSTEM
    try:
        content = read_mobile_originated(record_with(data), key, system, satellite_case.ROBOT, NOW)
    except WireError:
        return
    assert can_travel(content.target)


@pytest.mark.parametrize(
    ("sentence", "reason"),
    [
        ("track lost for 120 s: the ranges contradict what was believed", Reason.TARGET_LOST),
        ("no range of the target was heard in 60 s", Reason.TARGET_SILENT),
        ("the target is faster than the robot", Reason.TARGET_FASTER),
        ("the robot left the water", Reason.LEFT_WATER),
    ],
)
def test_ends_of_a_pursuit_have_words_by_satellite(sentence, reason):
    plan = replace(PLAN, state=OnboardPlanState.FAILED, reason=Reason.of(sentence))
    found = told(MobileOriginatedContent(7, STATE, plan)).plan
    assert found.reason is reason
    assert Reason.of(found.reason.sentence) is reason
