"""Signed frames: what is let in, and what a restart must not forget."""

import random
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from robot_link.clock import SystemClock
from robot_link.mavlink.codec import ROBOT_COMPONENT, STATION_COMPONENT, STATION_SYSTEM, Codec
from robot_link.mavlink.signing import (
    FileSigningMemory,
    MemorySigningMemory,
    Signing,
    SigningMarks,
    Verdict,
)
from robot_link.mavlink.wire import grace
from robot_link.messages import (
    CommandKind,
    CommandLevel,
    CommandNumber,
    CommandReport,
    LinkState,
    OnboardPlanState,
    RawFrame,
    RobotId,
)
from tests.robot_link.rig import CALM, MINI, ROUGH, SYSTEMS, mission, rig, soon, until

KEY = bytes(range(32))
OTHER = bytes(reversed(range(32)))
NOON = datetime(2026, 6, 1, 12, tzinfo=UTC)


@dataclass
class SetClock:
    at: datetime = NOON
    speed: float = 1.0

    def now(self) -> datetime:
        return self.at


def signing(key: bytes = KEY, memory=None, clock: SetClock | None = None) -> Signing:
    return Signing(key, memory or MemorySigningMemory(), clock or SetClock())


def robot(signed: Signing | None) -> Codec:
    return Codec(SYSTEMS[MINI], ROBOT_COMPONENT, signed)


def heartbeat():
    return grace.MAVLink_heartbeat_message(12, 0, 1, 4, 4, 3)


def test_a_signed_frame_is_good_once_and_13_bytes_longer():
    sender, receiver = robot(signing()), signing()
    frame = sender.pack(heartbeat())
    assert len(frame) == len(robot(None).pack(heartbeat())) + 13
    assert [receiver.check(frame) for _ in range(2)] == [Verdict.GOOD, Verdict.REPLAYED]
    assert receiver.check(robot(None).pack(heartbeat())) is Verdict.UNSIGNED
    assert receiver.check(robot(signing(OTHER)).pack(heartbeat())) is Verdict.FORGED
    assert receiver.counts == {
        Verdict.GOOD: 1,
        Verdict.REPLAYED: 1,
        Verdict.UNSIGNED: 1,
        Verdict.FORGED: 1,
    }


def test_pymavlink_itself_takes_our_signature_and_we_take_its():
    peer = grace.MAVLink(None, srcSystem=9, srcComponent=1)
    peer.robust_parsing = True
    peer.signing.secret_key = KEY
    peer.signing.sign_outgoing = True
    peer.signing.timestamp = signing().next_stamp()
    (heard,) = peer.parse_buffer(robot(signing()).pack(heartbeat()))
    assert heard.get_type() == "HEARTBEAT"
    assert signing().check(heartbeat().pack(peer)) is Verdict.GOOD


def test_no_single_changed_bit_passes():
    sender, receiver = robot(signing()), signing()
    frame = bytearray(sender.pack(heartbeat()))
    for bit in range(8 * len(frame)):
        frame[bit // 8] ^= 1 << bit % 8
        assert receiver.check(bytes(frame)) is not Verdict.GOOD
        frame[bit // 8] ^= 1 << bit % 8
    assert receiver.check(bytes(frame)) is Verdict.GOOD


def test_a_forged_stamp_of_the_far_future_silences_nobody():
    sender, receiver = robot(signing()), signing()
    forged = bytearray(sender.pack(heartbeat()))
    forged[-12:-6] = b"\xff" * 6
    assert receiver.check(bytes(forged)) is Verdict.FORGED
    assert receiver.check(sender.pack(heartbeat())) is Verdict.GOOD


def test_frames_that_overtake_each_other_are_all_taken_once():
    sender, receiver = robot(signing()), signing()
    frames = [sender.pack(heartbeat()) for _ in range(200)]
    rng = random.Random(3)
    shuffled = [frames[i] for i in sorted(range(200), key=lambda i: i + rng.uniform(0, 20))]
    assert shuffled != frames
    assert {receiver.check(frame) for frame in shuffled} == {Verdict.GOOD}
    assert {receiver.check(frame) for frame in frames} == {Verdict.REPLAYED}


@pytest.mark.parametrize("crashes_after", [1, 50, 199])
def test_nothing_is_taken_or_stamped_twice_over_a_restart(tmp_path: Path, crashes_after: int):
    clock = SetClock()
    sender = robot(signing(clock=clock))
    path = tmp_path / "marks.json"
    receiver = signing(memory=FileSigningMemory(path), clock=clock)
    taken, stamps = [], []
    for _ in range(crashes_after):
        clock.at += timedelta(seconds=0.11)
        frame = sender.pack(heartbeat())
        taken.append(frame)
        assert receiver.check(frame) is Verdict.GOOD
        stamps.append(receiver.next_stamp())
    clock.at -= timedelta(days=400)  # the clock lost its battery with the restart
    again = signing(memory=FileSigningMemory(path), clock=clock)
    assert {again.check(frame) for frame in taken} == {Verdict.REPLAYED}
    assert again.next_stamp() > max(stamps)
    assert path.stat().st_mode & 0o777 == 0o600


def test_after_an_end_in_order_the_next_frame_is_taken_and_none_twice(tmp_path: Path):
    clock = SetClock()
    sender = robot(signing(clock=clock))
    memory = FileSigningMemory(tmp_path / "marks.json")
    taken: list[bytes] = []
    for _ in range(3):
        receiver = signing(memory=memory, clock=clock)
        assert {receiver.check(frame) for frame in taken} <= {Verdict.REPLAYED}
        for _ in range(20):
            clock.at += timedelta(seconds=0.1)
            taken.append(sender.pack(heartbeat()))
            assert receiver.check(taken[-1]) is Verdict.GOOD
        receiver.settle()


def test_a_fast_demo_marks_no_oftener_than_life_does(tmp_path: Path):
    class Counted(MemorySigningMemory):
        saved = 0

        def save(self, marks: SigningMarks) -> None:
            self.saved += 1
            super().save(marks)

    clock, memory = SetClock(speed=20.0), Counted()
    sender, receiver = robot(signing(clock=clock)), signing(memory=memory, clock=clock)
    taken = []
    for _ in range(100):  # ten seconds of the wall
        clock.at += timedelta(seconds=2.0)
        taken.append(sender.pack(heartbeat()))
        assert receiver.check(taken[-1]) is Verdict.GOOD
    assert 5 <= memory.saved <= 12
    slow = SetClock(clock.at)
    again = signing(memory=memory, clock=slow)
    assert {again.check(frame) for frame in taken} == {Verdict.REPLAYED}


def test_a_robot_whose_clock_is_years_behind_is_heard_once_it_has_heard_the_station():
    late = SetClock(NOON - timedelta(days=3000))
    on_board, ashore = signing(clock=late), signing()
    station = Codec(STATION_SYSTEM, STATION_COMPONENT, ashore)
    sender = robot(on_board)
    assert ashore.check(sender.pack(heartbeat())) is Verdict.REPLAYED
    assert on_board.check(station.pack(heartbeat())) is Verdict.GOOD
    assert ashore.check(sender.pack(heartbeat())) is Verdict.GOOD


@pytest.mark.parametrize("content", ["", "[]", "{", '{"stamp": "x", "streams": []}'])
def test_a_broken_file_of_marks_is_set_aside_and_lets_in_the_last_minute_at_most(
    tmp_path: Path, caplog, content: str
):
    path = tmp_path / "marks.json"
    path.write_text(content)
    clock = SetClock()
    sender = robot(signing(clock=clock))
    old = sender.pack(heartbeat())
    clock.at += timedelta(seconds=61)
    receiver = signing(memory=FileSigningMemory(path), clock=clock)
    assert receiver.check(old) is Verdict.REPLAYED
    assert receiver.check(sender.pack(heartbeat())) is Verdict.GOOD
    assert (tmp_path / "marks.json.damaged").read_text() == content
    assert "held no marks of signed links" in caplog.text
    assert FileSigningMemory(path).load().streams, "the next marks are kept in its place"


def test_a_full_disk_silences_no_signed_link(tmp_path: Path, caplog):
    class FullDisk(MemorySigningMemory):
        def save(self, marks: SigningMarks) -> None:
            raise OSError(28, "No space left on device")

    sender, receiver = robot(signing(memory=FullDisk())), signing(memory=FullDisk())
    frames = [sender.pack(heartbeat()) for _ in range(5)]
    assert [receiver.check(frame) for frame in frames] == [Verdict.GOOD] * 5
    assert receiver.check(frames[0]) is Verdict.REPLAYED
    assert "No space left" in caplog.text


def test_a_secret_of_another_length_is_refused():
    with pytest.raises(ValueError, match="32 bytes, not 5"):
        signing(b"short")


async def test_a_signed_link_uploads_and_obeys_over_a_bad_radio(tmp_path: Path):
    on_board = Signing(KEY, MemorySigningMemory(), SystemClock())
    ashore = Signing(KEY, MemorySigningMemory(), SystemClock())
    async with (
        rig(tmp_path, ROUGH, signing=on_board) as it,
        it.station(signing=lambda _robot: ashore) as (station, heard),
    ):
        report = await station.upload(MINI, mission())
        assert report.state is OnboardPlanState.ON_BOARD
        station.send_command(MINI, CommandKind.START, CommandNumber(4), soon(), mission().sha256())
        await until(lambda: CommandLevel.APPLIED in [r.level for r in heard.of(CommandReport)])
        assert len(it.robots[MINI].program.obeyed) == 1
        assert on_board.counts[Verdict.UNSIGNED] == on_board.counts[Verdict.FORGED] == 0


@pytest.mark.parametrize("key", [None, OTHER], ids=["no key", "another key"])
async def test_a_station_without_the_key_is_neither_heard_nor_bound(
    tmp_path: Path, key: bytes | None
):
    on_board = Signing(KEY, MemorySigningMemory(), SystemClock())
    right = Signing(KEY, MemorySigningMemory(), SystemClock())

    def wrong(_robot: RobotId) -> Signing | None:
        return None if key is None else Signing(key, MemorySigningMemory(), SystemClock())

    async with rig(tmp_path, CALM, signing=on_board) as it:
        async with it.station(signing=wrong) as (station, _):
            station.send_command(MINI, CommandKind.SURFACE, CommandNumber(1), soon())
            bad = Verdict.UNSIGNED if key is None else Verdict.FORGED
            await until(lambda: on_board.counts[bad] > 3)
            assert it.robots[MINI].program.obeyed == []
            assert it.robots[MINI].link.last_heard_station_s == float("inf")
            if key is not None:
                assert station.link_report(MINI).state is LinkState.NEVER_HEARD
        async with it.station(signing=lambda _robot: right) as (station, _):
            await until(lambda: station.link_report(MINI).state is LinkState.LIVE)
            assert station.link_report(MINI).is_signed


async def test_a_link_without_a_key_says_that_it_is_not_signed(tmp_path: Path):
    async with rig(tmp_path, CALM) as it, it.station() as (station, _):
        await until(lambda: station.link_report(MINI).state is LinkState.LIVE)
        assert not station.link_report(MINI).is_signed


async def test_refused_packets_are_journaled_as_nobodys(tmp_path: Path):
    """Whoever reads the journal again must not take for the robot's what was not believed."""
    ashore = Signing(KEY, MemorySigningMemory(), SystemClock())
    async with (
        rig(tmp_path, CALM) as it,
        it.station(bind=True, signing=lambda _robot: ashore) as (station, heard),
    ):
        await until(lambda: station.link_report(MINI).frames_bad > 2)
        incoming = [one for one in heard.of(RawFrame) if not one.outgoing]
        assert incoming
        assert {one.robot for one in incoming} == {None}
