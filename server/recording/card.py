"""Joins a recovered card with the telemetry of its robot: log and number name each measurement.

The same number of the same log is the same measurement, whatever its time. It is a duplicate if
telemetry says what a wire would have made of the card's word: the value itself, as a float of 32
bits, or of 24 bits by satellite. Otherwise it differs: telemetry's word stays, and the card's is
kept beside it; in a reviewed file the card's counts. Heard tags are named by time, tag and
receiver, for their numbers are not kept; states by their moment.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import partial
from typing import Final

import numpy as np
from sqlalchemy.orm import Session

from autonomy.arrays import BoolArray, FloatArray, IntArray
from autonomy.channel import ChannelCatalogue, key_at_station
from autonomy.site import Site
from db.column import microseconds
from db.fault import StoreError, UnknownIdError
from db.ingest import append_telemetry
from db.query.fleet.deployments import DeploymentRecord
from db.query.fleet.recordings import (
    ImportedFile,
    extend_deployment,
    live_deployments_between,
    refuse_closed,
)
from db.query.fleet.robot_channels import list_announcements
from db.query.fleet.robots import get_robot, robot_key
from db.query.measured.imported import complete_states
from db.query.measured.recovered import (
    CardWord,
    NumberedSamples,
    detection_name,
    keep_card_words,
    known_detections,
    numbered_samples,
    robots_of_log,
)
from db.query.station.events import add_event
from robot_link.channel_table import contradictions
from robot_link.messages import LogId, RobotId, Sample
from robot_link.report import Detection
from robot_link.sample_log import HeardTag, Measurement, SampleKey
from server.base.channels import catalogue_in
from server.fleet.plausibility import fault_of_detection, fault_of_sample
from server.recording.card_state import held_states, judged_states
from server.recording_file.card import Card, CardEntry
from server.recording_file.raw import FileFault

CLOCK_S: Final = 1.0
"""A card whose clock is farther off than this is not taken until a person has decided."""
_BATCH: Final = 5_000
_NEAR_M: Final = 0.002
"""Places are kept in millimetres, and travel as floats of 32 bits."""
_UNIT_SHARE: Final = 16.0
"""By satellite a place is told in units of at most this part of its deviation."""


class CardRefusedError(StoreError):
    """A card that was not taken; ``faults`` names its lines."""

    def __init__(self, sentence: str, faults: Sequence[FileFault] = ()) -> None:
        super().__init__(sentence)
        self.faults = faults


@dataclass(frozen=True, slots=True)
class CardOrder:
    """What is to become of a card."""

    robot: str
    card: Card
    files: Sequence[ImportedFile]
    by: str
    at: datetime
    skips_faults: bool
    clock_offset_s: float | None = None
    """How far the card's clock was ahead, as a person decided; None where nobody did."""
    speed: float = 1.0
    """Seconds of the station's clock per second of the wall."""

    @property
    def shift(self) -> timedelta:
        """What is taken off every time."""
        return timedelta(seconds=self.clock_offset_s or 0.0)


@dataclass(frozen=True, slots=True)
class KeptCard:
    """What became of a card; the four kinds sum up to its lines."""

    robot: str
    deployments: tuple[str, ...]
    new: int
    duplicate: int
    differs: int
    faults: tuple[FileFault, ...]
    notes: tuple[str, ...]


def keep_card(session: Session, order: CardOrder, go_on: Callable[[], None]) -> KeptCard:
    """Keep what a card tells more or otherwise than telemetry, all or nothing.

    Raises:
        CardRefusedError: If it is no card of this robot, its clock is off and nobody decided, or
            lines are faulty that are not to be skipped.
        DeploymentClosedError: If a deployment that it changes takes no more rows.
        WorkStoppedError: If ``go_on``, which is called between two blocks, says so.
    """
    site = _site(session, order)
    samples, heard, faults = _judged(session, order, site)
    states = judged_states(
        order.robot, order.card, order.shift, faults, site, order.at, order.speed
    )
    by_log = _held(session, order, samples)
    ahead_s = _ahead(by_log)
    _refuse_clock(order, ahead_s)
    faults += [fault for one in by_log for fault in one.faults]
    _refuse_faults(order, faults, right=sum(map(len, by_log)) + len(heard) + len(states))
    new = [one.samples[row] for one in by_log for row in np.flatnonzero(one.is_new).tolist()]
    new_heard = _new_detections(session, order.robot, heard)
    new_states, same_states = held_states(session, order.robot, states)
    words = [word for one in by_log for word in one.words]
    counts = {
        "new": len(new) + len(new_heard) + len(new_states),
        "duplicate": sum(int(one.is_same.sum()) for one in by_log)
        + (len(heard) - len(new_heard) + len(same_states) + order.card.repeated),
        "differs": sum(int(one.differs.sum()) for one in by_log),
    }
    changed = [one.measured_at for one in (*new, *new_heard, *new_states, *words)]
    told = [one.measured_at for one in (*samples, *heard, *states)]
    deployments = _noted(session, order, told, changed, counts, len(faults))
    rows = [*new, *new_heard, *new_states]
    for begin in range(0, len(rows), _BATCH):
        go_on()
        append_telemetry(session, rows[begin : begin + _BATCH])
    complete_states(session, robot_key(session, order.robot), same_states)
    keep_card_words(session, words, order.at)
    _say(session, order, deployments, counts, len(faults))
    return KeptCard(
        order.robot,
        tuple(deployments),
        counts["new"],
        counts["duplicate"],
        counts["differs"],
        tuple(faults),
        _notes(order, ahead_s, counts["differs"], by_log),
    )


def _site(session: Session, order: CardOrder) -> Site:
    try:
        robot = get_robot(session, order.robot)
    except UnknownIdError:
        robot = None
    if robot is None or robot.kind == "recorded":
        raise CardRefusedError(
            f"A card belongs to a robot that this station knows, and {order.robot} is none: its "
            "places count from the origin of its robot's water."
        )
    owners = [robots_of_log(session, log) for log in {one.key.log for one in order.card.entries}]
    others = sorted({one for known in owners for one in known} - {order.robot})
    if others and not any(order.robot in known for known in owners):
        raise CardRefusedError(
            f"The logs on this card are those of {', '.join(others)}, not of {order.robot}."
        )
    return robot.site


def _judged(
    session: Session, order: CardOrder, site: Site
) -> tuple[list[Sample], list[Detection], list[FileFault]]:
    """Return what can be true, dated as a person decided, and what cannot."""
    catalogue = catalogue_in(session)
    means_else = _Meaning(session, order.robot, catalogue)
    samples: list[Sample] = []
    heard: list[Detection] = []
    faults = list(order.card.faults)
    for one in order.card.entries:
        at = one.entry.measured_at - order.shift
        if isinstance(one.entry, HeardTag):
            detection = _detection(order, one.key, one.entry, at)
            fault = fault_of_detection(detection, site, order.at, order.speed)
            if fault is None:
                heard.append(detection)
        else:
            channel = key_at_station(one.entry.variable, catalogue)
            sample = _sample(order, one.key, one.entry, at, channel or "")
            fault = fault_of_sample(sample, site, order.at, order.speed)
            if channel is None:
                fault = f"the channel {one.entry.variable} is not in the catalogue"
            fault = fault or means_else(one, channel or "")
            if fault is None:
                samples.append(sample)
        if fault is not None:
            faults.append(FileFault(one.place, fault))
    return samples, heard, faults


class _Meaning:
    """Says where a robot measured by a table of channels that contradicts the catalogue."""

    def __init__(self, session: Session, robot: str, catalogue: ChannelCatalogue) -> None:
        self._catalogue = catalogue
        self._tables = [
            (one.since, contradictions(one.table, catalogue))
            for one in list_announcements(session)
            if one.robot == robot
        ]

    def __call__(self, one: CardEntry, channel: str) -> str | None:
        held = [faults for since, faults in self._tables if since <= one.key]
        return held[-1].get(self._catalogue[channel].wire_number) if held else None


def _sample(
    order: CardOrder, key: SampleKey, entry: Measurement, at: datetime, channel: str
) -> Sample:
    return Sample(
        robot=RobotId(order.robot),
        log=key.log,
        sequence=key.sequence,
        variable=channel,
        value=entry.value,
        position_ned=entry.position_ned,
        position_std_m=entry.position_std_m,
        measured_at=at,
        received_at=order.at,
    )


def _detection(order: CardOrder, key: SampleKey, entry: HeardTag, at: datetime) -> Detection:
    return Detection(
        robot=RobotId(order.robot),
        log=key.log,
        sequence=key.sequence,
        receiver=entry.receiver,
        tag=entry.tag,
        sensor=entry.sensor,
        position_ned=entry.position_ned,
        position_std_m=entry.position_std_m,
        measured_at=at,
        received_at=order.at,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Log:
    """The measurements of one log, and what each is to what is kept, shape ``(n,)`` each."""

    samples: Sequence[Sample]
    is_new: BoolArray
    is_same: BoolArray
    differs: BoolArray
    ahead_s: FloatArray
    """Of those that are kept: how much later the card says that they were measured."""
    words: Sequence[CardWord]
    """Those that are not the same to the last bit."""
    faults: Sequence[FileFault]

    def __len__(self) -> int:
        return len(self.samples) - len(self.faults)


def _held(session: Session, order: CardOrder, samples: Sequence[Sample]) -> list[_Log]:
    """Hold the measurements of each log against those that are kept under their numbers."""
    by_log: dict[LogId, list[Sample]] = {}
    for one in samples:
        by_log.setdefault(one.log, []).append(one)
    key = robot_key(session, order.robot)
    places = {one.key: one.place for one in order.card.entries}
    found: list[_Log] = []
    for log, told in by_log.items():
        times = [microseconds(one.measured_at) for one in told]
        numbers = [one.sequence for one in told]
        kept = numbered_samples(session, key, log, numbers, min(times), max(times))
        if kept is None:
            nothing = np.zeros(len(told), dtype=np.bool_)
            found.append(_Log(told, ~nothing, nothing, nothing, np.empty(0), (), ()))
        else:
            at_us = np.array(times, dtype=np.int64)
            found.append(_compared(told, at_us, kept, partial(_place, places)))
    return found


def _place(places: dict[SampleKey, str], sample: Sample) -> str:
    return places[SampleKey(sample.log, sample.sequence)]


def _compared(
    told: Sequence[Sample],
    at_us: IntArray,
    kept: NumberedSamples,
    place_of: Callable[[Sample], str],
) -> _Log:
    numbers = np.array([one.sequence for one in told], dtype=np.int64)
    places = np.searchsorted(kept.sequence, numbers)
    nearest = np.minimum(places, max(0, len(kept.sequence) - 1))
    is_kept = np.zeros(len(told), dtype=np.bool_)
    if len(kept.sequence):
        is_kept = kept.sequence[nearest] == numbers
    rows, of = np.flatnonzero(is_kept), nearest[is_kept]
    value = np.array([told[row].value for row in rows.tolist()])
    ned = np.array([told[row].position_ned for row in rows.tolist()]).reshape(-1, 3)
    std = np.array([told[row].position_std_m for row in rows.tolist()])
    pairs = list(zip(rows.tolist(), of.tolist(), strict=True))
    channel = np.array(
        [told[row].variable == kept.channel[one] for row, one in pairs], dtype=np.bool_
    )
    is_equal = travelled(value, kept.value[of])
    moved_m = np.abs(ned - kept.position_ned[of]).max(axis=1, initial=0.0)
    is_equal &= moved_m <= np.maximum(_NEAR_M, std / _UNIT_SHARE)
    is_exact = (value == kept.value[of]) & (moved_m < _NEAR_M)
    is_same, differs = np.zeros_like(is_kept), np.zeros_like(is_kept)
    is_same[rows], differs[rows] = channel & is_equal, channel & ~is_equal
    words = [_word(kept.log_key, told[row]) for row in rows[channel & ~is_exact].tolist()]
    faults = [
        FileFault(
            place_of(told[row]),
            f"telemetry says that number {told[row].sequence} is {kept.channel[one]}, "
            f"not {told[row].variable}",
        )
        for row, one in pairs
        if told[row].variable != kept.channel[one]
    ]
    ahead_s = (at_us[rows] - kept.at_us[of]) / 1e6
    return _Log(told, ~is_kept, is_same, differs, ahead_s, words, faults)


def travelled(card: FloatArray, telemetry: FloatArray) -> BoolArray:
    """Tell which values are what a wire makes of the card's: as they are, or as shorter floats."""
    with np.errstate(over="ignore"):
        single = card.astype(np.float32)
    bits = single.view(np.uint32)
    short = np.minimum((bits & 0x7FFFFFFF) + 0x80, 0x7F7FFFFF) & 0xFFFFFF00
    by_satellite = (short | (bits & 0x80000000)).astype(np.uint32).view(np.float32)
    return (card == telemetry) | (single == telemetry) | (by_satellite == telemetry)


def _word(log_key: int, one: Sample) -> CardWord:
    return CardWord(
        log_key, one.sequence, one.measured_at, one.value, one.position_ned, one.position_std_m
    )


def _ahead(by_log: Sequence[_Log]) -> float | None:
    """Return how far the card's clock is ahead of telemetry's, None without a common number."""
    ahead_s = np.concatenate([np.empty(0), *(one.ahead_s for one in by_log)])
    return float(np.median(ahead_s)) if len(ahead_s) else None


def _refuse_clock(order: CardOrder, ahead_s: float | None) -> None:
    if ahead_s is None or order.clock_offset_s is not None or abs(ahead_s) <= CLOCK_S:
        return
    raise CardRefusedError(
        f"The card's clock is {_seconds(ahead_s)} telemetry's. Say by how much it was ahead: "
        f"{ahead_s:.3f} s dates everything as telemetry does, 0 takes the card's times as they "
        "are. Nothing was imported."
    )


def _seconds(ahead_s: float) -> str:
    return f"{abs(ahead_s):.3f} s {'behind' if ahead_s < 0.0 else 'ahead of'}"


def _refuse_faults(order: CardOrder, faults: Sequence[FileFault], right: int) -> None:
    if not right:
        raise CardRefusedError("No line of the card can be used.", faults)
    if faults and not order.skips_faults:
        first = faults[0]
        raise CardRefusedError(
            f"{len(faults):,} of {order.card.read:,} lines cannot be used, the first is "
            f"{first.place}: {first.reason}. Nothing was imported.",
            faults,
        )


def _new_detections(session: Session, robot: str, heard: Sequence[Detection]) -> list[Detection]:
    if not heard:
        return []
    times = [one.measured_at for one in heard]
    known = set(known_detections(session, robot_key(session, robot), min(times), max(times)))
    new: list[Detection] = []
    for one in heard:
        name = detection_name(one.measured_at, one.tag, one.receiver)
        if name not in known:
            known.add(name)
            new.append(one)
    return new


def _noted(
    session: Session,
    order: CardOrder,
    told: Sequence[datetime],
    changed: Sequence[datetime],
    counts: dict[str, int],
    faults: int,
) -> list[str]:
    """Note the card on the deployments of its time; those that it changes must be open."""
    first, last = min(told), max(told)
    found = live_deployments_between(session, order.robot, first, last)
    for one in found:
        if any(_is_within(one, at) for at in changed):
            refuse_closed(session, one)
        extend_deployment(
            session,
            one.id,
            variables=(),
            imported={
                "files": [{"name": file.name, "sha256": file.sha256} for file in order.files],
                "at": order.at.isoformat(),
                "by": order.by,
                "is_card": True,
                **counts,
                "faults": faults,
                "clock_offset_s": order.clock_offset_s,
            },
            rows=counts["new"],
            first=first,
            last=last,
        )
    return [one.id for one in found]


def _is_within(deployment: DeploymentRecord, at: datetime) -> bool:
    ended = deployment.ended_at
    return deployment.begun_at <= at and (ended is None or at < ended)


def _say(
    session: Session,
    order: CardOrder,
    deployments: Sequence[str],
    counts: dict[str, int],
    faults: int,
) -> None:
    add_event(
        session,
        order.at,
        "deployment.imported",
        f"{order.by} imported the card of {order.robot}: {counts['new']} new, "
        f"{counts['duplicate']} known, {counts['differs']} different, {faults} left out.",
        robot=order.robot,
        data={"deployment": deployments[-1] if deployments else ""},
    )


def _notes(
    order: CardOrder, ahead_s: float | None, differs: int, by_log: Sequence[_Log]
) -> tuple[str, ...]:
    notes: list[str] = []
    if order.clock_offset_s:
        notes.append(
            f"Every time of the card was moved by {-order.clock_offset_s:+.3f} s, "
            f"as {order.by} said."
        )
    common = sum(len(one.ahead_s) for one in by_log)
    if ahead_s is None:
        notes.append("Telemetry told none of these measurements: make sure whose card it is.")
    else:
        notes.append(
            f"The clock of the card is {_seconds(ahead_s)} telemetry's, by {common:,} "
            "measurements that both tell."
        )
    if differs:
        notes.append(
            f"{differs:,} measurements say something else than telemetry; both are kept, and a "
            "reviewed file has the card's."
        )
    return tuple(notes)
