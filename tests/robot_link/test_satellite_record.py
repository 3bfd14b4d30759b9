"""The robot's records: what fits them, how exact it is, and that no other bytes pass for one."""

import math
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_link.messages import (
    SURFACED_BY_COMMAND,
    CommandNumber,
    LogId,
    OnboardPlanState,
    RobotMode,
)
from robot_link.robot_program import CommandOutcome
from robot_link.satellite.blob import TransferId
from robot_link.satellite.frame import MAC_BYTES, WireError, sealed_down, sealed_up
from robot_link.satellite.record import (
    BEST_SIZES,
    CommandAnswer,
    MobileOriginatedContent,
    Reason,
    ShortPlanReport,
    TransferAck,
    TransferState,
    compose,
    read_mobile_originated,
    sample_room,
)
from tests.robot_link.satellite_case import (
    KEY,
    NOW,
    OTHER_KEY,
    OTHER_SYSTEM,
    ROBOT,
    SYSTEM,
    sample,
    state,
)

PLAN = ShortPlanReport("0123456789abcdef", OnboardPlanState.RUNNING, 11, 20, 12.345)
ACK = TransferAck(TransferId(0xDEADBEEF), 2, frozenset({1}), TransferState.RECEIVING)
ANSWERS = tuple(
    CommandAnswer(CommandNumber(number), outcome)
    for number, outcome in enumerate(
        (
            CommandOutcome.DONE,
            CommandOutcome.NOT_NOW,
            CommandOutcome.WRONG_PLAN,
            CommandOutcome.UNSUPPORTED,
        ),
        start=2**24 - 4,
    )
)
SAMPLES = tuple(sample(3 * number) for number in range(40))
FULL = MobileOriginatedContent(7, state(), PLAN, (ACK,), ANSWERS, SAMPLES)
ARRIVED = NOW + timedelta(minutes=5)


def read(data: bytes) -> MobileOriginatedContent:
    return read_mobile_originated(data, KEY, SYSTEM, ROBOT, ARRIVED)


def told(content: MobileOriginatedContent, size: int = 340) -> MobileOriginatedContent:
    return read(compose(content, KEY, SYSTEM, size))


LAST_WORD = TransferAck(
    TransferId(0xDEADBEEF), 2, frozenset({0, 1}), TransferState.APPLIED, sending=7
)


@pytest.mark.parametrize("ack", [ACK, LAST_WORD])
def test_state_plan_and_the_ack_of_a_mission_fill_one_segment(ack):
    content = MobileOriginatedContent(7, state(), PLAN, (ack,))
    record = compose(content, KEY, SYSTEM, 70)
    assert len(record) == 70
    found = read(record)
    assert (found.counter, found.plan, found.acks, found.answers) == (7, PLAN, (ack,), ())
    assert found.state is not None


@pytest.mark.parametrize("size", [*BEST_SIZES, 71, 100, 150, 339])
def test_record_says_what_proves_levels_first_and_never_exceeds_its_size(size):
    record = compose(FULL, KEY, SYSTEM, size)
    assert len(record) <= size
    found = read(record)
    assert (found.acks, found.answers) == (FULL.acks, FULL.answers)
    assert (found.state is not None) == (size >= 14 + 1 + 7 + 16 + 33)
    assert bool(found.samples) == (size >= 150)
    if size >= 205:
        room = sample_room(FULL, size)
        assert size - 16 <= 340 - sample_room(FULL, 340) + room <= size + 14
        assert len(record) > size - 16, "one more sample would have fitted"


def test_state_arrives_within_its_resolution():
    said, found = state(), told(FULL).state
    assert found is not None
    assert found.position_ned == pytest.approx(said.position_ned, abs=5e-4)
    assert found.position_std_m == pytest.approx(said.position_std_m, abs=5e-4)
    assert found.velocity_ned == pytest.approx(said.velocity_ned, abs=5.1e-3)
    for name in ("roll_rad", "pitch_rad", "heading_rad", "tail_rad"):
        assert getattr(found, name) == pytest.approx(getattr(said, name), abs=math.pi / 256 + 1e-9)
    assert found.net_buoyancy_kg == pytest.approx(said.net_buoyancy_kg, abs=5.1e-5)
    assert found.mass_position_m == pytest.approx(said.mass_position_m, abs=5.1e-5)
    assert found.battery_fraction == pytest.approx(said.battery_fraction, abs=0.5 / 255)
    assert found.battery_v == pytest.approx(said.battery_v, abs=0.11)
    assert (found.mode, found.has_fix, found.robot) == (said.mode, said.has_fix, ROBOT)
    assert (found.measured_at, found.received_at) == (NOW, ARRIVED)
    assert found.energy_used == PLAN.energy_used


@pytest.mark.parametrize("mode", RobotMode)
@pytest.mark.parametrize("has_fix", [True, False])
def test_every_mode_arrives(mode, has_fix):
    found = told(MobileOriginatedContent(1, state(mode=mode, has_fix=has_fix))).state
    assert found is not None
    assert (found.mode, found.has_fix) == (mode, has_fix)


@pytest.mark.parametrize("year", [1980, 2019, 2106, 2317])
def test_record_of_a_robot_whose_clock_is_wrong_by_years_keeps_both_times(year):
    wrong = datetime(year, 2, 3, 4, 5, 6, tzinfo=UTC)
    content = MobileOriginatedContent(
        1, state(measured_at=wrong), samples=(sample(5, measured_at=wrong),)
    )
    found = told(content)
    assert found.state is not None
    for value in (found.state, *found.samples):
        assert (value.measured_at, value.received_at) == (wrong, ARRIVED)


def test_clock_before_1970_is_held_at_its_end():
    found = told(MobileOriginatedContent(1, state(measured_at=datetime(1900, 1, 1, tzinfo=UTC))))
    assert found.state is not None
    assert found.state.measured_at == datetime(1970, 1, 1, tzinfo=UTC)


def test_what_exceeds_its_field_is_shown_as_the_end_of_the_field():
    content = MobileOriginatedContent(
        1, state(position_std_m=1e6, velocity_ned=(5.0, -5.0, 0.0), battery_fraction=1.5)
    )
    found = told(content).state
    assert found is not None
    assert found.position_std_m == pytest.approx(16777.215)
    assert found.velocity_ned == (1.27, -1.27, 0.0)
    assert found.battery_fraction == 1.0


@pytest.mark.parametrize("state_", TransferState)
@pytest.mark.parametrize("count", [1, 8, 9, 40])
def test_word_on_a_transfer_arrives(state_, count):
    is_coming = state_ is TransferState.RECEIVING
    received = frozenset(range(0, count, 2)) if is_coming else frozenset(range(count))
    reason = Reason.NONE if is_coming else Reason.MISSION_RUNS
    sending = None if is_coming else 200
    ack = TransferAck(TransferId(5), count, received, state_, reason, sending)
    assert told(MobileOriginatedContent(1, acks=(ack,))).acks == (ack,)


def test_last_word_that_names_no_sending_does_not_travel():
    ack = replace(ACK, state=TransferState.APPLIED)
    with pytest.raises(ValueError, match="names the sending"):
        told(MobileOriginatedContent(1, acks=(ack,)))


def test_words_that_do_not_fit_wait_for_the_next_record():
    acks = tuple(replace(ACK, transfer_id=TransferId(number)) for number in range(20))
    found = told(MobileOriginatedContent(1, acks=acks, answers=ANSWERS), 70)
    assert found.acks == acks[: len(found.acks)]
    assert len(found.acks) == 7


@pytest.mark.parametrize("reason", [one for one in Reason if one is not Reason.OTHER])
def test_reason_survives_being_said_in_words(reason):
    assert Reason.of(reason.sentence) is reason


def test_reasons_of_the_robot_are_recognized_with_their_numbers():
    assert Reason.of("the mission took longer than 3600 s") is Reason.TIMEOUT
    assert Reason.of("leg 3 leaves the water of lake") is Reason.LEAVES_WATER
    assert Reason.of("something else") is Reason.OTHER
    assert Reason.SURFACED_BY_COMMAND.sentence == SURFACED_BY_COMMAND
    assert all(one.sentence for one in Reason if one is not Reason.NONE)


def test_plan_with_more_legs_or_energy_than_fit_stays_a_plan():
    plan = ShortPlanReport("", OnboardPlanState.FAILED, 5000, 6000, 1e9, Reason.BATTERY)
    found = told(MobileOriginatedContent(1, plan=plan)).plan
    assert found == ShortPlanReport(
        "", OnboardPlanState.FAILED, 4095, 4095, 16777.215, Reason.BATTERY
    )
    with pytest.raises(ValueError, match="16 digits, not 12"):
        told(MobileOriginatedContent(1, plan=replace(PLAN, digits="0" * 12)))


@settings(deadline=None)
@given(
    st.lists(
        st.tuples(
            st.integers(0, 2**32 - 1),
            st.floats(-1e5, 1e5),
            st.floats(0.0, 200.0),
            st.floats(0.001, 500.0),
            st.floats(-1e30, 1e30),
            st.integers(0, 10**6),
        ),
        min_size=1,
        max_size=8,
        unique_by=lambda one: one[0],
    )
)
def test_samples_arrive_as_exact_as_they_are_certain(drawn):
    said = [
        sample(
            number,
            position_ned=(north, -north, depth),
            position_std_m=std,
            value=value,
            measured_at=NOW + timedelta(seconds=seconds),
        )
        for number, north, depth, std, value, seconds in drawn
    ]
    found = told(MobileOriginatedContent(1, samples=tuple(said))).samples
    said = sorted(said, key=lambda one: one.sequence)
    assert len(found) == len(said)
    finest = min(one.position_std_m for one in said)
    for one, other in zip(found, said, strict=True):
        assert (one.log, one.sequence, one.variable) == (other.log, other.sequence, other.variable)
        off_m = max(finest / 32.0, 5.1e-4)
        assert one.position_ned == pytest.approx(other.position_ned, abs=off_m)
        assert one.position_std_m == pytest.approx(other.position_std_m, abs=5.1e-4)
        assert one.value == pytest.approx(other.value, rel=2.0**-16, abs=1e-38)
        assert abs(one.measured_at - other.measured_at) <= timedelta(seconds=0.06)


def test_samples_of_several_logs_and_variables_go_together():
    said = (
        sample(9, log=LogId(4)),
        sample(1, variable="temperature"),
        sample(2),
        sample(0, log=LogId(4)),
    )
    found = told(MobileOriginatedContent(1, samples=said)).samples
    names = {(one.log, one.sequence, one.variable) for one in found}
    assert names == {(one.log, one.sequence, one.variable) for one in said}


@pytest.mark.parametrize(
    "changes", [{"value": math.nan}, {"position_std_m": -1.0}, {"value": 1e39}]
)
def test_sample_that_is_no_number_is_the_callers_mistake(changes):
    with pytest.raises(ValueError, match="of a sample"):
        told(MobileOriginatedContent(1, samples=(sample(1, **changes),)))


def test_size_that_is_none_of_a_record_is_refused():
    for size in (69, 341):
        with pytest.raises(ValueError, match="70 to 340 bytes, max_bytes"):
            compose(FULL, KEY, SYSTEM, size)


def test_every_single_flipped_bit_of_a_record_is_refused():
    record = compose(FULL, KEY, SYSTEM, 205)
    for bit in range(8 * len(record)):
        damaged = bytearray(record)
        damaged[bit // 8] ^= 1 << bit % 8
        with pytest.raises(WireError):
            read(bytes(damaged))


def test_record_is_of_one_robot_and_one_direction():
    record = compose(FULL, KEY, SYSTEM, 205)
    for key, system in ((KEY, OTHER_SYSTEM), (OTHER_KEY, SYSTEM)):
        with pytest.raises(WireError, match="the code is wrong"):
            read_mobile_originated(record, key, system, ROBOT, NOW)
    with pytest.raises(WireError, match="the code is wrong"):
        read(sealed_down(record[:-MAC_BYTES], KEY, SYSTEM))


@settings(max_examples=400)
@given(st.data())
def test_any_record_damaged_before_it_was_sealed_is_content_or_a_wire_error(data):
    body = bytearray(compose(FULL, KEY, SYSTEM, 205)[:-MAC_BYTES])
    for _ in range(data.draw(st.integers(1, 3))):
        body[data.draw(st.integers(1, len(body) - 1))] = data.draw(st.integers(0, 255))
    try:
        found = read(sealed_up(bytes(body), KEY, SYSTEM))
    except WireError:
        return
    assert all(math.isfinite(one.value) for one in found.samples)
    assert len(found.samples) <= 255


@settings(max_examples=200)
@given(st.binary(max_size=332))
def test_garbage_under_a_right_code_is_content_or_a_wire_error(body):
    for data in (body, sealed_up(b"\x13" + body[:331], KEY, SYSTEM)):
        try:
            read(data)
        except WireError:
            continue
