"""The dialect without any link: frames, values, mission items, and the receiving end of uploads."""

import dataclasses
import math
import random
from datetime import UTC, datetime, timedelta

import cbor2
import pytest
from hypothesis import given
from hypothesis import strategies as st

from autonomy.planner.plan import Leg, PrimitiveKind
from onboard.link.mission_receiver import Complete, MissionReceiver, Refused, Request
from onboard.link.sample_queue import SampleQueue
from robot_link.mavlink import build, telemetry
from robot_link.mavlink.codec import ROBOT_COMPONENT, STATION_SYSTEM, Codec, packets
from robot_link.mavlink.mission_item import mission_from_items, mission_items
from robot_link.mavlink.wire import grace
from robot_link.messages import (
    LogId,
    OnboardPlanState,
    PlanHash,
    RobotId,
    RobotMode,
    SystemId,
)
from robot_link.mission import Mission, MissionSettings
from robot_link.sample_log import Measurement, SampleKey
from robot_link.station.sample_gate import SequenceSet
from tests.robot_link.rig import mission, state

ROBOT = SystemId(7)
NAME = RobotId("mini-1")
NOW = datetime(2026, 11, 21, 4, 23, 48, 123456, tzinfo=UTC)

whole = st.integers(-(2**24) + 1, 2**24 - 1)
finite = st.floats(-1e6, 1e6, width=32)
moments = st.integers(0, 7 * 10**15).map(
    lambda microseconds: datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=microseconds)
)
legs_of_integers = st.tuples(st.integers(0, 3), *[whole] * 9)
missions = st.builds(
    Mission.from_integers,
    st.one_of(st.tuples(*[whole] * 5), st.tuples(*[whole] * 7)),
    st.lists(legs_of_integers, max_size=8).map(tuple),
)


def codec(system: int = ROBOT) -> Codec:
    return Codec(SystemId(system), ROBOT_COMPONENT)


def over_the_wire(message):
    (again,), bad = codec(STATION_SYSTEM).unpack(codec().pack(message))
    assert bad == 0
    return again


def heartbeat():
    return grace.MAVLink_heartbeat_message(12, 0, 1, 4, 4, 3)


@given(st.integers(1, 6), st.data())
def test_a_datagram_cut_anywhere_loses_the_cut_frame_alone(count: int, data: st.DataObject):
    sender = codec()
    frames = [sender.pack(heartbeat()) for _ in range(count)]
    cut = data.draw(st.integers(0, sum(map(len, frames))))
    messages, bad = codec().unpack(b"".join(frames)[:cut])
    assert [message.get_seq() for message in messages] == list(range(cut // len(frames[0])))
    assert (bad > 0) == (cut % len(frames[0]) > 0)


@given(st.binary(max_size=300))
def test_garbage_never_raises_and_is_counted(garbage: bytes):
    messages, bad = codec().unpack(garbage)
    assert messages == []
    assert (bad > 0) == (len(garbage) > 0)


@given(st.binary(max_size=30), st.integers(0, 20), st.integers(1, 255))
def test_a_corrupt_frame_does_not_hide_its_neighbours(garbage: bytes, at: int, flip: int):
    sender = codec()
    first, second, third = (sender.pack(heartbeat()) for _ in range(3))
    corrupt = bytearray(second)
    corrupt[at] ^= flip
    messages, bad = codec().unpack(first + garbage + bytes(corrupt) + third)
    assert [message.get_seq() for message in messages] == [0, 2]
    assert bad >= 1


def test_frames_of_one_sender_are_numbered_modulo_256():
    sender = codec()
    numbers = [codec().unpack(sender.pack(heartbeat())).messages[0].get_seq() for _ in range(257)]
    assert numbers == [*range(256), 0]


def test_messages_of_other_dialects_are_counted_as_bad():
    frame = bytearray(codec().pack(heartbeat()))
    frame[7:10] = (60000).to_bytes(3, "little")
    assert codec().unpack(bytes(frame)).messages == []
    assert codec().unpack(bytes(frame)).bad >= 1


@given(st.lists(st.binary(min_size=1, max_size=300), max_size=12), st.integers(50, 256))
def test_packets_keep_frames_whole_and_in_order(frames: list[bytes], limit: int):
    joined = packets(frames, limit)
    assert b"".join(joined) == b"".join(frames)
    borders = {0}
    for frame in frames:
        borders.add(max(borders) + len(frame))
    at = 0
    for packet in joined:
        assert at in borders
        assert len(packet) <= limit or packet in frames
        at += len(packet)


@given(moments, st.sampled_from(RobotMode), st.tuples(finite, finite, finite))
def test_a_state_survives_the_wire(at: datetime, mode: RobotMode, position):
    sent = state(at, mode)
    object.__setattr__(sent, "position_ned", position)
    message = over_the_wire(telemetry.state_message(sent))
    again = telemetry.state_report(message, sent.robot, sent.received_at)
    assert again == sent


def test_numbers_beyond_a_state_field_stop_at_its_border():
    sent = state(NOW)
    object.__setattr__(sent, "velocity_ned", (1e9, -1e9, 0.0))
    object.__setattr__(sent, "battery_v", -1.0)
    message = over_the_wire(telemetry.state_message(sent))
    again = telemetry.state_report(message, NAME, NOW)
    assert again.velocity_ned == (32.767, -32.768, 0.0)
    assert again.battery_v == 0.0


@pytest.mark.parametrize("field", ["x", "y", "z", "position_std", "net_buoyancy", "energy_used"])
@pytest.mark.parametrize("number", [math.nan, math.inf])
def test_a_state_that_is_not_finite_is_refused(field: str, number: float):
    message = telemetry.state_message(state(NOW))
    setattr(message, field, number)
    with pytest.raises(ValueError, match="not finite"):
        telemetry.state_report(over_the_wire(message), NAME, NOW)


def test_an_impossible_time_or_mode_or_variable_is_refused():
    message = telemetry.state_message(state(NOW))
    message.mode = 200
    with pytest.raises(ValueError, match="200"):
        telemetry.state_report(message, NAME, NOW)
    message.mode, message.time_utc_us = 0, 2**64 - 1
    with pytest.raises(ValueError, match="time"):
        telemetry.state_report(message, NAME, NOW)
    measurement = Measurement("blue_light", 1.0, (0.0, 0.0, 0.0), 0.1, NOW)
    sample = telemetry.sample_message(LogId(1), 2, measurement)
    sample.variable = 240
    with pytest.raises(ValueError, match="variable 240"):
        telemetry.sample(sample, NAME, NOW)


@given(st.integers(0, 2**32 - 1), st.integers(0, 2**32 - 1), finite, moments)
def test_a_sample_survives_the_wire(log: int, sequence: int, value: float, at: datetime):
    measurement = Measurement("chlorophyll", value, (1.5, -2.5, 3.0), 0.25, at)
    frame = codec().pack(telemetry.sample_message(LogId(log), sequence, measurement))
    assert len(frame) == telemetry.SAMPLE_FRAME_BYTES
    (message,), _ = codec().unpack(frame)
    sample = telemetry.sample(message, NAME, NOW)
    assert (sample.log, sample.sequence, sample.variable) == (log, sequence, "chlorophyll")
    assert (sample.value, sample.measured_at) == (value, at)
    assert (sample.position_ned, sample.position_std_m) == ((1.5, -2.5, 3.0), 0.25)


@given(st.sets(st.integers(0, 5000), max_size=400))
def test_acknowledgements_speak_of_exactly_the_given_samples(sequences: set[int]):
    spoken: list[int] = []
    for message in telemetry.acknowledgements(ROBOT, LogId(3), sequences):
        spoken += telemetry.acknowledged_sequences(over_the_wire(message))
    assert spoken == sorted(sequences)


def test_a_long_reason_is_cut_and_a_foreign_letter_replaced():
    message = telemetry.plan_report_message(
        measured_at=NOW,
        sha256=PlanHash("ab" * 32),
        state=OnboardPlanState.FAILED,
        reason="é" + "x" * 200,
    )
    report = telemetry.plan_report(over_the_wire(message), NAME, NOW)
    assert report.reason == "?" + "x" * 99
    assert report.sha256 == "ab" * 32


@given(missions)
def test_a_mission_survives_its_items(plan: Mission):
    again = mission_from_items([over_the_wire(item) for item in mission_items(plan, ROBOT)])
    assert again == plan
    assert again.sha256() == plan.sha256()


@given(missions)
def test_two_missions_share_a_hash_only_if_they_are_equal(plan: Mission):
    other = mission()
    assert (plan.sha256() == other.sha256()) == (plan == other)


def test_items_that_are_no_mission_are_refused_with_the_first_that_does_not_fit():
    items = list(mission_items(mission(dives=1), ROBOT))
    with pytest.raises(ValueError, match="item 0"):
        mission_from_items(items[1:])
    with pytest.raises(ValueError, match="item 0"):
        mission_from_items([])
    with pytest.raises(ValueError, match="item 8"):
        mission_from_items([*items, items[0]])
    with pytest.raises(ValueError, match="item 1"):
        mission_from_items([items[0], items[4]])
    with pytest.raises(ValueError, match="item 2"):
        mission_from_items([*items[:2], *items[1:]])
    items[2].param1 = 0.5
    with pytest.raises(ValueError, match="item 2 holds a number that is not whole"):
        mission_from_items(items)


def glide(start, end, **changes) -> Leg:
    numbers = {"speed_m_s": 0.03, "duration_s": 10.0, "energy": 1.5} | changes
    return Leg(PrimitiveKind.GLIDE, start, end, **numbers)


@pytest.mark.parametrize(
    ("settings", "leg", "complaint"),
    [
        ({"timeout_s": math.inf}, {}, "timeout of the settings"),
        ({"max_uncertainty_m": 17000.0}, {}, "uncertainty of the settings"),
        ({}, {"speed_m_s": math.nan}, "speed of a glide leg"),
        ({}, {"duration_s": 2.0**24}, "duration of a glide leg"),
        ({"start_x_m": 1.0}, {}, "leg 1 does not begin"),
        ({"net_buoyancy_offset_kg": 17.0}, {}, "net buoyancy offset of the settings"),
        ({"mass_position_offset_m": -math.inf}, {}, "mass position offset of the settings"),
    ],
)
def test_a_plan_that_does_not_fit_the_wire_is_refused_by_name(settings, leg, complaint: str):
    numbers = {
        "sample_period_s": 1.0,
        "max_uncertainty_m": 0.5,
        "timeout_s": 600.0,
        "start_x_m": 0.0,
        "start_y_m": 0.0,
    }
    with pytest.raises(ValueError, match=complaint):
        Mission.from_legs(
            MissionSettings(**numbers | settings), (glide((0, 0, 0), (1, 0, 0.5), **leg),)
        )


def test_wrong_counts_of_integers_are_refused():
    with pytest.raises(ValueError, match="no format of missions has 2 numbers of settings"):
        Mission.from_integers((1, 2), ())
    with pytest.raises(ValueError, match="a leg has 10"):
        Mission.from_integers((1, 2, 3, 4, 5), ((1, 2),))
    with pytest.raises(ValueError, match="kind 9"):
        Mission.from_integers((1, 2, 3, 4, 5), ((9, *[0] * 9),))


def test_the_trim_travels_in_milligrams_and_micrometres_and_the_hash_covers_it():
    plain = mission(dives=1)
    trimmed = Mission.from_legs(
        dataclasses.replace(
            plain.settings, net_buoyancy_offset_kg=-0.0021234, mass_position_offset_m=0.0015
        ),
        plain.legs,
    )
    assert trimmed.settings_integers()[-2:] == (-2123, 1500)
    assert trimmed.sha256() != plain.sha256()
    again = mission_from_items([over_the_wire(item) for item in mission_items(trimmed, ROBOT)])
    assert again.settings.net_buoyancy_offset_kg == -0.002123
    assert again.settings.mass_position_offset_m == 0.0015


def test_a_mission_of_the_format_without_trim_keeps_its_name_and_has_none():
    legs = (glide((0, 0, 0), (1, 0, 0.5)),)
    old = Mission.from_legs(MissionSettings(1.0, 0.5, 600.0, 0.0, 0.0), legs, 1)
    content = [1, [1000, 500, 600, 0, 0], [[0, 1000, 0, 500, 30, 100, 1500, 0, 0, 0]]]
    assert old.canonical_bytes() == cbor2.dumps(content, canonical=True)
    again = mission_from_items(mission_items(old, ROBOT))
    assert (again, again.sha256()) == (old, old.sha256())
    assert again.settings.net_buoyancy_offset_kg == again.settings.mass_position_offset_m == 0.0


def test_a_format_that_cannot_carry_a_mission_is_refused_by_its_number():
    settings = MissionSettings(1.0, 0.5, 600.0, 0.0, 0.0, 0.001)
    with pytest.raises(ValueError, match="format 1 of missions carries no trim"):
        Mission.from_legs(settings, (), 1)
    with pytest.raises(ValueError, match="only format 3 of missions carries onboard settings"):
        Mission.from_legs(settings, (), 3)
    with pytest.raises(ValueError, match="format 6 of missions is unknown"):
        Mission.from_legs(settings, (), 6)


def receive(receiver: MissionReceiver, items, rng: random.Random):
    """Bring items in any order, some twice, until the receiver asks for nothing."""
    now_s, step = 0.0, receiver.count(len(items), 0.0)
    while isinstance(step, Request):
        wanted = items[step.sequence]
        disturbance = rng.choices(items, k=rng.randrange(4))
        for item in disturbance:
            if item.seq != wanted.seq:
                assert receiver.item(item, now_s) is None
        step = receiver.item(wanted, now_s)
    return step


@given(st.randoms(use_true_random=False))
def test_items_out_of_turn_change_nothing(rng: random.Random):
    plan = mission(dives=2)
    receiver = MissionReceiver(1.5, 30.0)
    receiver.offer(plan.sha256(), 14, 0.0)
    assert receive(receiver, mission_items(plan, ROBOT), rng) == Complete(plan.sha256(), plan)


def test_an_item_that_stays_away_is_asked_for_again_until_the_sender_is_silent_too_long():
    plan = mission(dives=1)
    items = mission_items(plan, ROBOT)
    receiver = MissionReceiver(1.5, 30.0)
    assert receiver.tick(0.0) is None
    receiver.offer(plan.sha256(), len(items), 0.0)
    assert receiver.count(len(items), 0.0) == Request(0)
    assert receiver.item(items[0], 0.1) == Request(1)
    assert receiver.tick(1.0) is None
    assert receiver.tick(1.7) == Request(1)
    assert receiver.tick(2.0) is None
    assert receiver.tick(40.0) is None
    assert receiver.item(items[1], 40.1) is None, "forgotten"


def test_a_count_that_was_not_offered_is_ignored():
    receiver = MissionReceiver(1.5, 30.0)
    assert receiver.count(3, 0.0) is None
    receiver.offer(mission().sha256(), 5, 0.0)
    assert receiver.count(3, 0.0) is None


def test_another_offer_replaces_an_unfinished_one():
    first, second = mission(dives=1), mission(dives=2)
    receiver = MissionReceiver(1.5, 30.0)
    receiver.offer(first.sha256(), 7, 0.0)
    receiver.count(7, 0.0)
    receiver.item(mission_items(first, ROBOT)[0], 0.0)
    receiver.offer(second.sha256(), 13, 1.0)
    assert receiver.count(13, 1.0) == Request(0)


@given(st.integers(0, 7), st.integers(0, 3), st.floats(width=32))
def test_any_changed_number_makes_the_hash_refuse(number: int, field: int, value: float):
    plan = mission(dives=1)
    items = mission_items(plan, ROBOT)
    name = f"param{field + 1}"
    is_changed = getattr(items[number], name) != value
    setattr(items[number], name, value)
    receiver = MissionReceiver(1.5, 30.0)
    receiver.offer(plan.sha256(), len(items), 0.0)
    step = receiver.count(len(items), 0.0)
    for item in items:
        step = receiver.item(item, 0.0)
    # Parameters that an item does not use are not part of the mission.
    is_unused = (items[number].command, field) in (
        (grace.MAV_CMD_GRACE_SETTINGS, 3),
        (grace.MAV_CMD_GRACE_TRIM, 2),
        (grace.MAV_CMD_GRACE_TRIM, 3),
        (grace.MAV_CMD_GRACE_CIRCLE, 2),
        (grace.MAV_CMD_GRACE_CIRCLE, 3),
    )
    if is_changed and not is_unused:
        assert isinstance(step, Refused)
    elif not is_changed:
        assert isinstance(step, Complete)


@given(st.lists(st.integers(0, 60)))
def test_a_sequence_set_is_a_set(numbers: list[int]):
    ours, theirs = SequenceSet(), set()
    for number in numbers:
        ours.add(number)
        theirs.add(number)
    assert [number in ours for number in range(70)] == [number in theirs for number in range(70)]
    assert len(ours) == sum(number - 1 not in theirs for number in theirs), "one run for each gap"


def test_samples_are_due_in_order_then_after_growing_waits_then_never():
    a, b, c = (SampleKey(LogId(7), number) for number in range(3))
    queue = SampleQueue((a, b, c), first_wait_s=1.0, longest_wait_s=4.0)
    assert queue.take(2, 10.0) == [a, b]
    assert queue.take(9, 10.0) == [c]
    assert queue.next_due_s() == 11.0
    assert queue.take(9, 10.9) == []
    assert queue.take(9, 11.0) == [a, b, c]
    assert queue.next_due_s() == 13.0
    for now_s, next_s in ((13.0, 17.0), (17.0, 21.0)):
        assert queue.take(9, now_s) == [a, b, c]
        assert queue.next_due_s() == next_s
    queue.hurry([c, SampleKey(LogId(8), 2)])
    assert queue.take(9, 17.0) == [c]
    for key in (a, b, c):
        queue.discard(key)
    assert queue.next_due_s() is None
    assert len(queue) == 0


def test_a_definition_that_the_generator_refuses_is_told(tmp_path, monkeypatch):
    broken = (build.HERE / "grace.xml").read_text().replace("uint64_t", "uint65_t")
    (tmp_path / "grace.xml").write_text(broken)
    monkeypatch.setattr(build, "HERE", tmp_path)
    with pytest.raises(RuntimeError, match=r"refused grace\.xml"):
        build.build(tmp_path / "dialect" / "grace.py")
    assert not (tmp_path / "dialect" / "grace.py").exists()


def test_the_dialect_is_generated_whole_and_compiled(tmp_path):
    target = tmp_path / "dialect" / "grace.py"
    build.build(target)
    assert target.read_text() == (build.HERE / "dialect" / "grace.py").read_text()
    assert list((tmp_path / "dialect" / "__pycache__").glob("grace.*.pyc"))
