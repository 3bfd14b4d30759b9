"""The station's end: what is due, what is proved, and that it survives being written down."""

import json
from dataclasses import replace
from datetime import timedelta

import pytest

from benchmarks.link.satellite import run
from robot_link.satellite.blob import Blob, TransferId
from robot_link.satellite.config import SatelliteConfig
from robot_link.satellite.content import Reason, TransferAck, TransferState
from robot_link.station.ground import GroundState, GroundTransfer, PartLevel, next_counter
from tests.robot_link.satellite_case import NOW, SURVEY

BLOB = Blob.of(SURVEY)
MINUTE = timedelta(minutes=1)
EXPIRES = NOW + timedelta(hours=96)


def begun() -> GroundTransfer:
    return GroundTransfer.begin(BLOB, 5, NOW, EXPIRES, start=True)


def queued() -> GroundTransfer:
    """Both chunks are at the gateway."""
    return begun().sent(0, NOW, "a", 11).sent(1, NOW, "b", 12)


def word(*received: int, state: TransferState = TransferState.RECEIVING) -> TransferAck:
    return TransferAck(BLOB.transfer_id, 2, frozenset(received), state)


def applied() -> TransferAck:
    return word(0, 1, state=TransferState.APPLIED)


def levels(transfer: GroundTransfer) -> list[str]:
    return [part.level.value for part in transfer.parts]


def test_nothing_is_claimed_before_a_gateway_took_a_chunk():
    transfer = begun()
    assert (transfer.state, levels(transfer)) == (GroundState.DRAFT, ["waiting", "waiting"])
    assert transfer.due(NOW) == (0, 1)
    one = transfer.sent(0, NOW, "a")
    assert (one.state, levels(one)) == (GroundState.QUEUED, ["queued", "waiting"])
    assert one.due(NOW) == (1,)


def test_chunk_is_not_sent_again_while_it_may_wait_at_the_gateway():
    transfer = queued()
    assert transfer.due(NOW) == ()
    assert transfer.due(NOW + timedelta(days=2)) == (), "time alone proves nothing"
    first = transfer.surfaced(NOW + 30 * MINUTE).heard(word(), NOW + 30 * MINUTE)
    assert first.due(NOW + 30 * MINUTE) == (), "its message was composed before it fetched one"
    second = first.surfaced(NOW + 31 * MINUTE).heard(word(), NOW + 31 * MINUTE)
    assert second.due(NOW + 31 * MINUTE) == (0,), "fetched in the first session, and lost"
    third = second.surfaced(NOW + 32 * MINUTE).heard(word(), NOW + 32 * MINUTE)
    assert third.due(NOW + 32 * MINUTE) == (0, 1)


def test_session_that_may_have_missed_the_message_does_not_count():
    transfer = queued()
    for second in (-300, 0, 30, 59):
        transfer = transfer.surfaced(NOW + timedelta(seconds=second))
    assert [part.sessions for part in transfer.parts] == [0, 0]


def test_chunk_behind_others_in_the_queue_is_given_as_many_sessions():
    transfer = queued()
    assert [part.sessions_needed for part in transfer.parts] == [2, 3]
    again = transfer.heard(word(1), NOW + MINUTE).sent(0, NOW + MINUTE)
    assert again.parts[0].sessions_needed == 2, "the other one is no longer in the queue"


def test_only_what_the_robot_lacks_is_sent_again():
    transfer = queued()
    for number in range(4):
        at = NOW + (30 + number) * MINUTE
        transfer = transfer.surfaced(at).heard(word(1), at)
    assert (transfer.state, levels(transfer)) == (GroundState.PARTIAL, ["queued", "radio"])
    assert transfer.due(NOW + 40 * MINUTE) == (0,)
    assert transfer.parts[1].radio_at == NOW + 30 * MINUTE


def test_session_that_reports_the_message_proves_radio_and_the_next_word_decides():
    at = NOW + 30 * MINUTE
    transfer = queued().surfaced(at).heard(word(), at).taken(11, at)
    assert (transfer.state, levels(transfer)) == (GroundState.QUEUED, ["radio", "queued"])
    assert transfer.due(at) == ()
    after = at + MINUTE
    lost = transfer.surfaced(after).heard(word(), after)
    assert 0 in lost.due(after)
    resent = lost.sent(0, after, "c", 13)
    assert (levels(resent)[0], resent.parts[0].sends) == ("queued", 2)
    assert resent.taken(11, after) == resent, "a number from before proves nothing of this one"
    assert transfer.surfaced(after).heard(word(0), after).due(after) == ()


def test_applied_is_the_robots_own_word_alone():
    at = NOW + 30 * MINUTE
    everything = queued().heard(word(0, 1), at)
    assert (everything.state, levels(everything)) == (GroundState.PARTIAL, ["radio", "radio"])
    done = everything.heard(applied(), at + MINUTE)
    assert (done.state, done.is_over, done.is_told) == (GroundState.APPLIED, True, True)
    assert done.ended_at == at + MINUTE
    assert done.due(at) == ()


def test_word_on_another_transfer_is_not_heard():
    foreign = replace(applied(), transfer_id=TransferId(BLOB.transfer_id ^ 1))
    assert queued().heard(foreign, NOW) == queued()


def test_older_word_that_arrives_late_takes_nothing_back():
    transfer = queued().heard(word(0), NOW + 40 * MINUTE)
    assert transfer.heard(word(), NOW + 30 * MINUTE) == transfer
    both = transfer.heard(word(1), NOW + 30 * MINUTE)
    assert levels(both) == ["radio", "radio"]


def test_robot_that_lost_its_memory_gets_the_chunks_again():
    transfer = queued().heard(word(0), NOW + 40 * MINUTE).heard(word(1), NOW + 50 * MINUTE)
    assert levels(transfer) == ["waiting", "radio"]
    assert transfer.due(NOW + 51 * MINUTE) == (0,)


@pytest.mark.parametrize(
    ("state", "sentence"),
    [
        (TransferState.BAD_HASH, "together not the mission"),
        (TransferState.BAD_SCHEMA, "does not understand"),
        (TransferState.REFUSED, "a mission is running"),
    ],
)
def test_refusal_ends_the_transfer_with_a_sentence(state, sentence):
    ack = TransferAck(BLOB.transfer_id, 2, frozenset({0, 1}), state, Reason.MISSION_RUNS)
    refused = queued().heard(ack, NOW)
    assert (refused.state, refused.is_told) == (GroundState.REFUSED, True)
    assert sentence in refused.reason
    assert refused.heard(applied(), NOW) == refused


@pytest.mark.parametrize(
    "state", [one for one in TransferState if one is not TransferState.RECEIVING]
)
def test_last_word_on_another_sending_of_the_same_mission_proves_nothing(state):
    transfer = queued()
    before = replace(word(0, 1, state=state), sending=4)
    assert transfer.heard(before, NOW) == transfer
    mine = replace(word(0, 1, state=state), sending=5)
    assert transfer.heard(mine, NOW).is_told


def test_transfer_expires_but_the_robots_late_word_still_counts():
    gone = queued().expired(EXPIRES)
    assert (gone.state, gone.due(EXPIRES)) == (GroundState.EXPIRED, ())
    assert queued().expired(EXPIRES - MINUTE).state is GroundState.QUEUED
    assert begun().due(EXPIRES) == ()
    assert gone.heard(word(0), EXPIRES).state is GroundState.EXPIRED
    late = gone.heard(applied(), EXPIRES + MINUTE)
    assert late.state is GroundState.APPLIED


@pytest.mark.parametrize("end", ["superseded", "withdrawn"])
def test_transfer_that_is_given_up_sends_nothing_more(end):
    gone = getattr(queued(), end)(NOW)
    assert (gone.state.value, gone.is_over, gone.is_told) == (end, True, False)
    assert gone.due(NOW) == ()
    word_of_it = replace(applied(), state=TransferState.REFUSED, reason=Reason.WITHDRAWN)
    agreed = gone.heard(word_of_it, NOW)
    assert (agreed.state.value, agreed.is_told) == (end, True)
    done = queued().heard(applied(), NOW)
    assert getattr(done, end)(NOW) == done, "what the robot applied stays applied"


def test_document_is_the_transfer_whole():
    at = NOW + 30 * MINUTE
    for transfer in (
        begun(),
        queued().surfaced(at).heard(word(1), at).taken(11, at),
        queued().heard(applied(), at),
    ):
        document = json.loads(json.dumps(transfer.to_document()))
        assert GroundTransfer.from_document(document) == transfer


@pytest.mark.parametrize("key", ["counter", "parts", "state", "created_at"])
def test_document_that_lacks_something_is_refused(key):
    document = begun().to_document()
    del document[key]
    with pytest.raises(ValueError, match="no satellite transfer"):
        GroundTransfer.from_document(document)


def test_counters_grow_even_after_the_database_was_lost():
    assert next_counter(0, NOW) == int(NOW.timestamp())
    assert next_counter(int(NOW.timestamp()) + 3, NOW) == int(NOW.timestamp()) + 4


def test_levels_are_named_as_operators_read_them():
    assert [level.value for level in PartLevel] == ["waiting", "queued", "radio"]


def test_defaults_stay_within_what_gateways_keep():
    config = SatelliteConfig()
    assert config.expiry_h < 5 * 24
    assert config.contact_expiry_h < config.expiry_h


@pytest.mark.parametrize("block", range(4))
def test_transfers_through_a_bad_sky_are_applied_exactly_once(block):
    runs = [run(seed) for seed in range(40 * block, 40 * (block + 1))]
    assert all((one.applied, one.is_identical, one.is_shown) == (1, True, True) for one in runs)
    assert sum(one.wrong_levels for one in runs) == 0
    assert sum(one.restarts for one in runs) > 40
    assert sorted(one.sends for one in runs)[len(runs) // 2] <= 5
