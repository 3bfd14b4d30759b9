"""Missions by a satellite that loses, doubles and reorders, between ends that restart at any time.

Nothing here is a socket: the station's and the robot's ends of the product run against a queue of
messages, a thousand times, each time with other losses, and are saved and rebuilt in between. What
the station claims is held against what the robot really has after every step.
"""

import json
import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from statistics import median

from benchmarks.link.satellite_mission import usual_mission, worst_mission
from onboard.satellite.receiver import Complete, MemoryStore, Receiver
from robot_link.messages import RobotId, SystemId
from robot_link.mission import Mission
from robot_link.satellite.blob import Blob
from robot_link.satellite.chunk import cut, sizes
from robot_link.satellite.cost import quote
from robot_link.satellite.record import (
    MobileOriginatedContent,
    compose,
    read_mobile_originated,
)
from robot_link.station.ground import GroundState, GroundTransfer, PartLevel, next_counter

TRANSFERS = 1000
SIZED = 50
LOSS, DUPLICATION, RESTARTS = 0.4, 0.1, 0.15
MESSAGES_BAR, CREDITS_BAR, MEDIAN_BAR = 2, 10, 5
KEY, SYSTEM, ROBOT = bytes(range(32)), SystemId(7), RobotId("lake-1")
BEGAN = datetime(2026, 6, 1, 6, 0, tzinfo=UTC)
SURFACING, SESSION, SESSIONS_MAX = timedelta(minutes=30), timedelta(seconds=40), 8
EXPIRY = timedelta(hours=96)


def measure() -> list[dict[str, object]]:
    """Measure what missions cost and how a thousand transfers fare; about half a minute."""
    rows = [
        *_fares(f"20 items, largest of {SIZED}", usual_mission, has_bar=True),
        *_fares(f"worst believable, largest of {SIZED}", worst_mission, has_bar=False),
    ]
    runs = [run(seed) for seed in range(TRANSFERS)]
    under = f"of {TRANSFERS}, loss {LOSS:g} both ways, both ends restarting"
    once = sum(one.applied == 1 and one.is_identical and one.is_shown for one in runs)
    rows.append(_row(f"Applied exactly once, {under}", once, "transfers", TRANSFERS, at_least=True))
    rows.append(_row("Wrong levels shown", sum(one.wrong_levels for one in runs), "levels", 0))
    sent = [one.sends for one in runs if one.chunks == MESSAGES_BAR]
    name = f"MT messages per two-chunk mission, median of {len(sent)}"
    rows.append(_row(name, median(sent), "messages", MEDIAN_BAR))
    rows.append(_row("Restarts in between", sum(one.restarts for one in runs), "restarts", None))
    return rows


def _fares(
    name: str, mission_of: Callable[[int], Mission], *, has_bar: bool
) -> list[dict[str, object]]:
    """Return messages, credits and bytes of the largest of some missions."""
    missions = [mission_of(seed) for seed in range(SIZED)]
    blob, mission = max(
        ((Blob.of(one), one) for one in missions), key=lambda pair: len(pair[0].packed)
    )
    fare = quote(sizes(blob))
    bars = (MESSAGES_BAR, CREDITS_BAR) if has_bar else (None, None)
    canonical = len(mission.canonical_bytes())
    return [
        _row(f"MT messages, {name}", fare.messages, "messages", bars[0]),
        _row(f"Credits, {name}", fare.credits, "credits", bars[1]),
        _row(f"Blob, {name} ({canonical} B canonical)", len(blob.packed), "B", None),
    ]


@dataclass
class Run:
    """What became of one transfer."""

    chunks: int = 0
    sends: int = 0
    applied: int = 0
    is_identical: bool = False
    is_shown: bool = False
    """Whether the station came to show it as applied."""
    wrong_levels: int = 0
    restarts: int = 0


@dataclass
class Shore:
    """Gateway and station."""

    transfer: GroundTransfer
    messages: tuple[bytes, ...]
    queue: list[tuple[int, bytes]] = field(default_factory=list)
    """MTMSN and bytes of what waits for the robot."""
    late: list[tuple[bytes, int | None, datetime]] = field(default_factory=list)
    """Records that arrive out of order."""
    heard: set[int] = field(default_factory=set)
    """Counters of the records that arrived."""
    mtmsn: int = 100


def run(seed: int) -> Run:
    """Carry one mission, with a mission before it whose messages come again."""
    rng = random.Random(seed)
    old, wanted = usual_mission(2 * seed + 1), usual_mission(2 * seed + 2)
    result = Run()
    robot = _Robot(rng, wanted, result)
    before = next_counter(0, BEGAN - timedelta(days=1))
    noise = _noise(rng, old, before)
    for message in cut(Blob.of(old), KEY, SYSTEM, before, start=False, ack_seen=False):
        robot.take(message, BEGAN)
    result.applied = 0
    blob = Blob.of(wanted)
    counter = next_counter(before, BEGAN)
    shore = Shore(
        GroundTransfer.begin(blob, counter, BEGAN, BEGAN + EXPIRY, start=True),
        cut(blob, KEY, SYSTEM, counter, start=True, ack_seen=True),
    )
    result.chunks = len(shore.messages)
    reports_mtmsn = rng.random() < 0.5
    now = BEGAN
    while not shore.transfer.is_over:
        _send(shore, rng, now, result)
        now += SURFACING * rng.uniform(0.7, 1.3)
        for _ in range(SESSIONS_MAX):
            now += SESSION
            _session(shore, robot, rng, now, next(noise), reports_mtmsn=reports_mtmsn)
            _check(shore, robot, result)
            if rng.random() < RESTARTS:
                shore.transfer = _restarted(shore.transfer)
                result.restarts += 1
            _send(shore, rng, now, result)
            if not shore.queue:
                break
        shore.transfer = shore.transfer.expired(now)
    result.sends = shore.transfer.sends
    result.is_shown = shore.transfer.state is GroundState.APPLIED
    return result


class _Robot:
    """The robot's end, which may stop at any moment, and what it truly did."""

    def __init__(self, rng: random.Random, wanted: Mission, result: Run) -> None:
        self._rng = rng
        self._wanted = wanted
        self._result = result
        self._store = MemoryStore()
        self.on_board: str | None = None
        self.fetched: set[bytes] = set()
        self._receiver = Receiver(self._store, KEY, SYSTEM)

    def take(self, data: bytes, now: datetime) -> None:
        self.fetched.add(data)
        taken = self._receiver.take(data, now)
        self._maybe_restart()
        if isinstance(taken, Complete):
            self._apply(taken)
        self._maybe_restart()

    def record(self) -> bytes:
        content = MobileOriginatedContent(self._receiver.next_counter(), acks=self._receiver.acks())
        return compose(content, KEY, SYSTEM, 70)

    def _apply(self, taken: Complete) -> None:
        name = taken.mission.sha256()
        if name != self.on_board:
            self.on_board = name
            self._result.applied += 1
            expected = self._wanted.canonical_bytes()
            self._result.is_identical = taken.mission.canonical_bytes() == expected
        self._maybe_restart()
        self._receiver.applied(taken.transfer_id)

    def _maybe_restart(self) -> None:
        if self._rng.random() >= RESTARTS:
            return
        self._result.restarts += 1
        self._receiver = Receiver(MemoryStore(self._store.data), KEY, SYSTEM)
        self._store = self._receiver._store  # noqa: SLF001 - the memory that survived
        pending = self._receiver.pending(self.on_board)
        if pending is not None:
            self._apply(pending)


def _send(shore: Shore, rng: random.Random, now: datetime, result: Run) -> None:
    for index in shore.transfer.due(now):
        shore.mtmsn += 1
        copies = 2 if rng.random() < DUPLICATION else 1
        shore.queue += [(shore.mtmsn, shore.messages[index])] * copies
        shore.transfer = shore.transfer.sent(index, now, str(shore.mtmsn), shore.mtmsn)


def _session(
    shore: Shore,
    robot: _Robot,
    rng: random.Random,
    now: datetime,
    noise: bytes | None,
    *,
    reports_mtmsn: bool,
) -> None:
    """Let the robot send its record and fetch one message, each of which may be lost."""
    record = robot.record()
    fetched = None
    if shore.queue:
        number, message = shore.queue.pop(rng.randrange(min(2, len(shore.queue))))
        if rng.random() >= LOSS:
            fetched = number
            robot.take(message, now)
    if noise is not None:
        robot.take(noise, now)
    if rng.random() >= LOSS:
        shore.late += [(record, fetched if reports_mtmsn else None, now)]
        shore.late += shore.late[-1:] if rng.random() < DUPLICATION else []
    rng.shuffle(shore.late)
    while shore.late and rng.random() < 0.8:
        data, mtmsn, session_at = shore.late.pop()
        content = read_mobile_originated(data, KEY, SYSTEM, ROBOT, now)
        if content.counter in shore.heard:  # as the inbox refuses what came before
            continue
        shore.heard.add(content.counter)
        transfer = shore.transfer.surfaced(session_at)
        for ack in content.acks:
            transfer = transfer.heard(ack, session_at)
        shore.transfer = transfer if mtmsn is None else transfer.taken(mtmsn, session_at)


def _check(shore: Shore, robot: _Robot, result: Run) -> None:
    """Count what the station claims and the robot has not done."""
    transfer = shore.transfer
    for part in transfer.parts:
        is_proved = shore.messages[part.index] in robot.fetched
        result.wrong_levels += part.level is PartLevel.RADIO and not is_proved
        result.wrong_levels += part.level is PartLevel.QUEUED and not part.sends
    is_flown = robot.on_board == transfer.plan
    result.wrong_levels += transfer.state is GroundState.APPLIED and not is_flown
    result.wrong_levels += transfer.state in (GroundState.REFUSED, GroundState.EXPIRED)


def _noise(rng: random.Random, old: Mission, counter: int) -> Iterator[bytes | None]:
    """Say again what was said long ago, what another robot was told, and what the air damaged."""
    replayed = cut(Blob.of(old), KEY, SYSTEM, counter, start=True, ack_seen=False)
    foreign = cut(Blob.of(old), KEY, SystemId(8), counter + 10**9, start=True, ack_seen=False)
    while True:
        kind = rng.choices(("none", "replayed", "foreign", "damaged"), (5, 2, 1, 1))[0]
        message = rng.choice(foreign if kind == "foreign" else replayed)
        if kind == "damaged":
            flipped = bytearray(message)
            flipped[rng.randrange(len(flipped))] ^= 1 << rng.randrange(8)
            message = bytes(flipped)
        yield None if kind == "none" else message


def _restarted(transfer: GroundTransfer) -> GroundTransfer:
    return GroundTransfer.from_document(json.loads(json.dumps(transfer.to_document())))


def _row(
    name: str, value: float, unit: str, bar: float | None, *, at_least: bool = False
) -> dict[str, object]:
    met = None if bar is None else (value >= bar if at_least else value <= bar)
    return {"area": "satellite", "name": name, "value": value, "unit": unit, "bar": bar, "met": met}
