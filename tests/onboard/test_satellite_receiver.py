"""The robot's end: every mission and order acts once, whatever comes in which order."""

import json
from datetime import timedelta

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.satellite.receiver import (
    Complete,
    FileStore,
    MemoryStore,
    Nothing,
    OrderReceived,
    Receiver,
)
from robot_link.messages import CommandKind, CommandNumber, PlanHash
from robot_link.mission import Mission
from robot_link.robot_program import CommandOutcome
from robot_link.satellite.blob import Blob, BlobCodec, transfer_id_of
from robot_link.satellite.chunk import cut
from robot_link.satellite.content import Reason, TransferState
from robot_link.satellite.order import pack_order
from robot_link.satellite.withdrawal import pack_withdrawal
from tests.robot_link.satellite_case import (
    KEY,
    NOW,
    OTHER_SYSTEM,
    SURVEY,
    SYSTEM,
    short_mission,
)

LATER = NOW + timedelta(hours=2)


def chunks(
    mission: Mission = SURVEY, counter: int = 5, *, start: bool = False, ack_seen: bool = False
) -> tuple[bytes, ...]:
    return cut(Blob.of(mission), KEY, SYSTEM, counter, start=start, ack_seen=ack_seen)


def order(
    kind: CommandKind, counter: int, *, number: int | None = None, ack_seen: bool = False
) -> bytes:
    plan = SURVEY.sha256() if kind is CommandKind.START else None
    name = CommandNumber(counter if number is None else number)
    return pack_order(kind, name, LATER, plan, KEY, SYSTEM, counter, ack_seen=ack_seen)


class Robot:
    """A receiver with a memory that a restart leaves alone."""

    def __init__(self) -> None:
        self.store = MemoryStore()
        self.restart()

    def restart(self) -> None:
        self.receiver = Receiver(self.store, KEY, SYSTEM)

    def take(self, *messages: bytes, now=NOW):
        for message in messages[:-1]:
            self.receiver.take(message, now)
        return self.receiver.take(messages[-1], now)

    def apply(self, *messages: bytes) -> Complete:
        taken = self.take(*messages)
        assert isinstance(taken, Complete)
        self.receiver.applied(taken.transfer_id)
        return taken

    def obey(self, message: bytes, now=NOW) -> bool:
        """Take an order; tell whether it is to be acted on."""
        taken = self.take(message, now=now)
        if isinstance(taken, OrderReceived):
            self.receiver.answered(taken.command, CommandOutcome.DONE)
            return True
        return False

    @property
    def words(self):
        return [(ack.transfer_id, ack.state) for ack in self.receiver.acks()]

    @property
    def outcomes(self):
        return {one.number: one.outcome for one in self.receiver.answers()}


@pytest.fixture
def robot() -> Robot:
    return Robot()


SURVEY_ID = Blob.of(SURVEY).transfer_id


@pytest.mark.parametrize("turn", [1, -1])
def test_chunks_in_any_order_become_the_mission(robot, turn):
    first, second = chunks(start=True)[::turn]
    assert isinstance(robot.take(first), Nothing)
    (ack,) = robot.receiver.acks()
    assert (ack.state, len(ack.received), ack.count) == (TransferState.RECEIVING, 1, 2)
    taken = robot.take(first, first, second)
    assert isinstance(taken, Complete)
    assert (taken.mission, taken.start, taken.transfer_id) == (SURVEY, True, SURVEY_ID)


def test_mission_is_applied_only_when_the_robot_says_so(robot):
    robot.take(*chunks())
    assert robot.words == [(SURVEY_ID, TransferState.RECEIVING)]
    robot.receiver.applied(SURVEY_ID)
    assert robot.words == [(SURVEY_ID, TransferState.APPLIED)]


def test_same_mission_again_is_acknowledged_again_and_not_applied(robot):
    robot.apply(*chunks())
    for again in (chunks(), chunks(counter=9, start=True)):
        for message in again:
            assert isinstance(robot.take(message), Nothing)
    robot.take(order(CommandKind.HOLD, 20, ack_seen=True))
    assert robot.words == []
    assert isinstance(robot.take(chunks(counter=9)[0]), Nothing)
    assert robot.words == [(SURVEY_ID, TransferState.APPLIED)]


def test_old_mission_said_again_never_replaces_a_newer_one(robot):
    newer = short_mission()
    robot.apply(*chunks(counter=5))
    robot.apply(*chunks(newer, counter=6))
    for message in chunks(counter=5, start=True):
        assert isinstance(robot.take(message), Nothing)
    never_heard = chunks(short_mission(9.0), counter=5, start=True)
    taken = robot.take(*never_heard)
    assert isinstance(taken, Nothing)
    assert "older than the mission on board" in taken.reason


def test_mission_that_was_replaced_can_be_wished_for_anew(robot):
    robot.apply(*chunks(counter=5))
    robot.apply(*chunks(short_mission(), counter=6))
    assert robot.apply(*chunks(counter=7)).mission == SURVEY


def test_newer_transfer_takes_the_place_of_one_that_is_coming_in(robot):
    robot.take(chunks(counter=5)[0])
    robot.take(*chunks(short_mission(), counter=6))
    taken = robot.take(chunks(counter=5)[1])
    assert isinstance(taken, Nothing)
    assert "a newer transfer" in taken.reason


def test_transfer_goes_on_under_a_newer_counter_and_wish(robot):
    robot.take(chunks(counter=5)[0])
    taken = robot.take(chunks(counter=6, start=True)[1])
    assert isinstance(taken, Complete)
    assert taken.start


def test_chunk_of_another_robot_or_key_is_counted_and_nothing_else(robot):
    foreign = cut(Blob.of(SURVEY), KEY, OTHER_SYSTEM, 5, start=True, ack_seen=False)
    taken = robot.take(*foreign)
    assert isinstance(taken, Nothing)
    assert taken.is_bad
    assert robot.receiver.acks() == ()
    assert robot.store.data is None


@pytest.mark.parametrize("is_on_board", [True, False])
def test_robot_that_stops_between_complete_and_applied_applies_once(robot, is_on_board):
    robot.take(*chunks(start=True))
    robot.restart()
    on_board = SURVEY.sha256() if is_on_board else PlanHash("00" * 32)
    pending = robot.receiver.pending(on_board)
    if is_on_board:
        assert pending is None
    else:
        assert pending is not None
        assert (pending.mission, pending.start) == (SURVEY, True)
        robot.receiver.applied(pending.transfer_id)
    robot.restart()
    assert robot.receiver.pending(on_board) is None
    assert robot.words == [(SURVEY_ID, TransferState.APPLIED)]


def test_nothing_is_pending_before_everything_is_there(robot):
    assert robot.receiver.pending(None) is None
    robot.take(chunks()[0])
    assert robot.receiver.pending(None) is None


def test_refused_mission_says_why_and_may_be_sent_again(robot):
    robot.take(*chunks(counter=5))
    robot.receiver.refused(SURVEY_ID, "a mission is running: wait for its end, or surface it")
    (ack,) = robot.receiver.acks()
    assert (ack.state, ack.reason) == (TransferState.REFUSED, Reason.MISSION_RUNS)
    assert isinstance(robot.take(chunks(counter=5)[0]), Nothing), "the same attempt"
    assert robot.apply(*chunks(counter=6)).mission == SURVEY
    assert robot.words == [(SURVEY_ID, TransferState.APPLIED)]


def test_chunks_that_are_together_something_else_end_the_transfer(robot):
    blob = Blob.of(SURVEY)
    other = Blob(blob.packed[:-1] + b"x", blob.codec, "", blob.transfer_id, blob.plan)
    taken = robot.take(*cut(other, KEY, SYSTEM, 5, start=True, ack_seen=False))
    assert isinstance(taken, Nothing)
    assert robot.words == [(SURVEY_ID, TransferState.BAD_HASH)]
    nonsense = bytes(300)
    made = Blob(nonsense, BlobCodec.PLAIN, "", transfer_id_of(nonsense), blob.plan)
    assert isinstance(robot.take(*cut(made, KEY, SYSTEM, 6, start=True, ack_seen=False)), Nothing)
    assert (made.transfer_id, TransferState.BAD_SCHEMA) in robot.words


def test_word_is_repeated_until_the_station_has_seen_that_very_word(robot):
    robot.apply(*chunks(counter=5))
    robot.take(order(CommandKind.HOLD, 5, number=1, ack_seen=True))
    assert robot.words, "said before the transfer, or with it"
    coming = Blob.of(short_mission()).transfer_id
    robot.take(chunks(short_mission(), counter=6, ack_seen=True)[0])
    assert robot.words == [(coming, TransferState.RECEIVING)]


def test_order_acts_once_and_its_answer_is_repeated(robot):
    assert robot.obey(order(CommandKind.SURFACE, 7))
    assert not robot.obey(order(CommandKind.SURFACE, 7))
    robot.restart()
    assert not robot.obey(order(CommandKind.SURFACE, 7))
    assert robot.outcomes == {7: CommandOutcome.DONE}
    robot.take(order(CommandKind.HOLD, 8, ack_seen=True))
    assert robot.outcomes == {}


def test_order_that_was_not_answered_before_a_restart_is_given_again(robot):
    assert isinstance(robot.take(order(CommandKind.SURFACE, 7)), OrderReceived)
    robot.restart()
    assert robot.obey(order(CommandKind.SURFACE, 7))


def test_order_overtaken_by_a_newer_one_is_answered_and_not_obeyed(robot):
    assert robot.obey(order(CommandKind.SURFACE, 8))
    assert not robot.obey(order(CommandKind.RESUME, 7))
    assert robot.outcomes == {8: CommandOutcome.DONE, 7: CommandOutcome.NOT_NOW}


def test_order_to_surface_overtaken_by_another_was_obeyed_with_it(robot):
    """An emergency leaves before the order that is written down, and with a higher number."""
    assert robot.obey(order(CommandKind.SURFACE, 8))
    assert not robot.obey(order(CommandKind.SURFACE, 7))
    assert robot.outcomes == {8: CommandOutcome.DONE, 7: CommandOutcome.DONE}


@pytest.mark.parametrize("kind", [CommandKind.HOLD, CommandKind.QUIET, CommandKind.PING])
def test_order_to_surface_that_was_lost_is_obeyed_after_a_later_one_to_no_place(robot, kind):
    assert robot.obey(order(kind, 8))
    assert robot.obey(order(CommandKind.SURFACE, 7))
    assert robot.outcomes == {8: CommandOutcome.DONE, 7: CommandOutcome.DONE}


def test_order_to_surface_does_not_stop_a_robot_that_was_sent_on_since(robot):
    assert robot.obey(order(CommandKind.RESUME, 8))
    assert not robot.obey(order(CommandKind.SURFACE, 7))
    assert robot.outcomes == {8: CommandOutcome.DONE, 7: CommandOutcome.NOT_NOW}


def test_order_to_fly_expires_by_the_robots_clock_and_one_to_stay_up_never(robot):
    late = LATER + timedelta(days=800)
    assert not robot.obey(order(CommandKind.START, 7), now=late)
    assert robot.outcomes == {7: CommandOutcome.NOT_NOW}
    assert robot.obey(order(CommandKind.SURFACE, 8), now=late)


def test_mission_from_before_an_order_to_hold_does_not_start(robot):
    first, second = chunks(counter=5, start=True)
    robot.take(first)
    assert robot.obey(order(CommandKind.HOLD, 6))
    taken = robot.take(second)
    assert isinstance(taken, Complete)
    assert not taken.start


@pytest.mark.parametrize("end", [order(CommandKind.SURFACE, 6), pack_withdrawal(6, KEY, SYSTEM)])
@pytest.mark.parametrize("heard", [0, 1])
def test_mission_from_before_a_withdrawal_or_an_order_to_surface_is_refused(robot, end, heard):
    older, newer = chunks(counter=5, start=True), chunks(counter=7, start=True)
    if heard:
        robot.take(*older[:heard])
    robot.take(end)
    robot.restart()
    for message in older:
        assert isinstance(robot.take(message), Nothing)
    (ack,) = robot.receiver.acks()
    assert (ack.state, ack.reason) == (TransferState.REFUSED, Reason.WITHDRAWN)
    assert robot.apply(*newer).start
    assert robot.words == [(SURVEY_ID, TransferState.APPLIED)]


def test_mission_sent_again_after_a_withdrawal_is_not_taken_for_the_one_withdrawn(robot):
    old, new = chunks(counter=5), chunks(counter=7, start=True)
    robot.take(old[0], pack_withdrawal(6, KEY, SYSTEM), old[1])
    (word,) = robot.receiver.acks()
    assert (word.state, word.sending) == (TransferState.REFUSED, 5)
    robot.take(new[0])
    assert [ack.state for ack in robot.receiver.acks()] == [TransferState.RECEIVING]
    complete = robot.apply(old[1])
    assert complete.start, "the bytes are the same, and the newest wish holds"
    (word,) = robot.receiver.acks()
    assert (word.state, word.sending) == (TransferState.APPLIED, 7)


def test_surface_that_a_newer_order_overtook_still_ends_what_was_sent_before_it(robot):
    assert robot.obey(order(CommandKind.RESUME, 9))
    assert not robot.obey(order(CommandKind.SURFACE, 8))
    assert isinstance(robot.take(*chunks(counter=7)), Nothing)
    assert isinstance(robot.take(*chunks(short_mission(), counter=10)), Complete)


def test_withdrawal_leaves_the_mission_on_board_alone(robot):
    robot.apply(*chunks(counter=5))
    robot.take(pack_withdrawal(6, KEY, SYSTEM, ack_seen=True))
    assert robot.words == []
    robot.take(chunks(counter=5)[0])
    assert robot.words == [(SURVEY_ID, TransferState.APPLIED)]


def test_very_old_orders_are_not_answered_anew(robot):
    for counter in range(10, 40):
        assert robot.obey(order(CommandKind.HOLD, counter))
    before = robot.store.data
    assert not robot.obey(order(CommandKind.RESUME, 10))
    assert robot.store.data == before
    assert len(before) < 4000


def test_record_counters_are_never_used_twice(robot):
    counters = [robot.receiver.next_counter() for _ in range(3)]
    robot.restart()
    counters.append(robot.receiver.next_counter())
    assert counters == sorted(set(counters))


def test_memory_that_cannot_be_read_begins_anew_and_says_so(robot):
    robot.apply(*chunks())
    for damage in (b"", b"{}", b"[1]", b'{"assembly": 3}', robot.store.data[:-9]):
        robot.store.save(damage)
        robot.restart()
        assert robot.receiver.memory_was_lost
    assert robot.apply(*chunks()).mission == SURVEY


def test_file_holds_the_memory_over_a_restart(tmp_path):
    path = tmp_path / "satellite" / "memory.json"
    assert FileStore(path).load() is None
    Receiver(FileStore(path), KEY, SYSTEM).take(chunks()[0], NOW)
    again = Receiver(FileStore(path), KEY, SYSTEM)
    assert isinstance(again.take(chunks()[1], NOW), Complete)
    assert json.loads(path.read_bytes())["assembly"]["count"] == 2
    assert [one.name for one in path.parent.iterdir()] == ["memory.json"]


@settings(max_examples=100, deadline=None)
@given(st.data())
def test_any_sequence_of_messages_applies_nothing_older_and_stays_small(data):
    robot = Robot()
    depths = {counter: 4.0 + counter for counter in range(1, 6)}
    messages = [
        (counter, message)
        for counter, depth in depths.items()
        for message in chunks(short_mission(depth), counter=counter)
    ]
    applied: list[int] = []
    for counter, message in data.draw(st.lists(st.sampled_from(messages), max_size=30)):
        if data.draw(st.booleans()):
            robot.restart()
        taken = robot.take(message)
        if isinstance(taken, Complete):
            robot.receiver.applied(taken.transfer_id)
            applied.append(counter)
    assert applied == sorted(set(applied))
    assert len(robot.store.data or b"") < 4000


@settings(max_examples=200)
@given(st.binary(max_size=300))
def test_garbage_changes_nothing(data):
    robot = Robot()
    robot.take(chunks()[0])
    before = robot.store.data
    taken = robot.take(data)
    assert isinstance(taken, Nothing)
    assert taken.is_bad
    assert robot.store.data == before
