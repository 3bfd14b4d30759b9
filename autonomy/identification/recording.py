"""A recorded flight, and the parts of it that can be held against a model."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from autonomy.arrays import BoolArray, FloatArray, IntArray
from autonomy.identification.config import SegmentRules

ReasonKind = Literal[
    "not_a_number",
    "repeated",
    "backward",
    "gap",
    "stuck",
    "flapping",
    "surface",
    "short",
    "unexplained",
]

SEEN_APART_S = 0.6
"""Between two places that are farther apart in time nothing is put in."""
_RARELY = 0.2
_OFTEN = 0.5
"""A noisy channel rarely keeps its value, and its curvature often changes sign (three times out of
four if its noise is white); a smooth one does not, and may well rest."""


@dataclass(frozen=True, slots=True)
class Recording:
    """What a robot reported of itself, in the order in which it was recorded.

    Nothing is promised of the numbers: stamps may repeat or run backward and any number may be
    NaN. ``segments`` finds the parts that are sound.
    """

    time_s: FloatArray
    """Shape ``(n,)``."""
    position_ned: FloatArray
    """Shape ``(n, 3)``, m; the horizontal part counts only where ``has_fix``."""
    position_std_m: FloatArray
    """Horizontal standard deviation, shape ``(n,)``."""
    has_fix: BoolArray
    """Whether the horizontal position came from outside, shape ``(n,)``."""
    attitude_rad: FloatArray
    """Roll, pitch and heading, shape ``(n, 3)``."""
    net_buoyancy_kg: FloatArray
    """Feedback of the pump, shape ``(n,)``."""
    mass_position_m: FloatArray
    """Feedback of the sliding mass, shape ``(n,)``."""
    tail_rad: FloatArray
    """Feedback of the tail, shape ``(n,)``."""
    mode: IntArray | None = None
    """What the robot said that it does, where it was recorded, shape ``(n,)``."""

    def __post_init__(self) -> None:
        """Refuse columns that do not belong together.

        Raises:
            ValueError: If the shapes differ.
        """
        n = self.time_s.size
        shapes = {
            "time_s": (n,),
            "position_ned": (n, 3),
            "position_std_m": (n,),
            "has_fix": (n,),
            "attitude_rad": (n, 3),
            "net_buoyancy_kg": (n,),
            "mass_position_m": (n,),
            "tail_rad": (n,),
        }
        for name, shape in shapes.items():
            if getattr(self, name).shape != shape:
                raise ValueError(f"{name} must have the shape {shape}")

    @property
    def inputs(self) -> FloatArray:
        """Net mass kg, sliding mass m and tail rad as fed back, shape ``(n, 3)``."""
        return np.column_stack([self.net_buoyancy_kg, self.mass_position_m, self.tail_rad])

    def seen_from_outside(
        self, time_s: FloatArray, north_east_m: FloatArray, std_m: FloatArray
    ) -> "Recording":
        """Return the recording with horizontal positions that others saw, and none of its own.

        A row has one where it lies between two that are at most ``SEEN_APART_S`` apart.

        Args:
            time_s: When the robot was seen, strictly ascending, shape ``(m,)``.
            north_east_m: Where, shape ``(m, 2)``.
            std_m: Standard deviation along the worse axis, shape ``(m,)``.
        """
        place, std = self.position_ned.copy(), np.full(self.time_s.size, np.nan)
        is_seen = np.zeros(self.time_s.size, dtype=np.bool_)
        if time_s.size > 1:
            after = np.clip(np.searchsorted(time_s, self.time_s), 1, time_s.size - 1)
            first, last = time_s[after - 1], time_s[after]
            is_seen = (first <= self.time_s) & (self.time_s <= last)
            is_seen &= last - first <= SEEN_APART_S
            for axis in (0, 1):
                seen = np.interp(self.time_s, time_s, north_east_m[:, axis])
                place[is_seen, axis] = seen[is_seen]
            std[is_seen] = np.maximum(std_m[after - 1], std_m[after])[is_seen]
        return replace(self, position_ned=place, position_std_m=std, has_fix=is_seen)

    def taken(self, rows: IntArray) -> "Recording":
        """Return the rows with the given indices, shape ``(m,)``."""
        return Recording(
            self.time_s[rows],
            self.position_ned[rows],
            self.position_std_m[rows],
            self.has_fix[rows],
            self.attitude_rad[rows],
            self.net_buoyancy_kg[rows],
            self.mass_position_m[rows],
            self.tail_rad[rows],
            None if self.mode is None else self.mode[rows],
        )


@dataclass(frozen=True, slots=True)
class Segment:
    """A part of a recording without a flaw: its stamps ascend strictly and all is finite."""

    rows: IntArray
    """Indices into the recording, shape ``(m,)``."""
    start_s: float
    end_s: float

    @property
    def duration_s(self) -> float:
        """Time from the first to the last row."""
        return self.end_s - self.start_s


@dataclass(frozen=True, slots=True)
class Reason:
    """Why a part of a recording is not used."""

    kind: ReasonKind
    start_s: float
    end_s: float
    message: str


@dataclass(frozen=True, slots=True)
class SegmentReport:
    """What can be used of a recording, and what was left out for which reason."""

    segments: tuple[Segment, ...]
    left_out: tuple[Reason, ...]

    @property
    def duration_s(self) -> float:
        """Time in all segments."""
        return sum(segment.duration_s for segment in self.segments)


def segments(recording: Recording, rules: SegmentRules | None = None) -> SegmentReport:
    """Cut a recording into parts that a model can be integrated over.

    Rows that hold NaN or repeat a stamp are skipped. A gap, a clock that was set back, a stuck
    sensor, a flapping tail and time at the surface end a segment. Nothing is filled in.

    Args:
        recording: As it was recorded.
        rules: What to leave out; the Miniglider's by default.
    """
    rules = rules or SegmentRules()
    reasons: list[Reason] = []
    rows = _finite_rows(recording, reasons)
    rows, block = _clock(recording.time_s, rows, rules, reasons)
    part = recording.taken(rows)
    usable = np.ones(rows.size, dtype=np.bool_)
    flaws = (_at_surface, _flapping, _stuck)
    for flaw in flaws:
        for found, kind, message in flaw(part, block, rules):
            usable &= ~found
            reasons += _stretches(part.time_s, found, block, kind, message)
    pieces: list[Segment] = []
    for first, stop in _runs(usable, block):
        pieces += _cut(part.time_s[first:stop], rows[first:stop], rules, reasons)
    reasons.sort(key=lambda reason: (reason.start_s, reason.end_s))
    return SegmentReport(tuple(pieces), tuple(reasons))


def _finite_rows(recording: Recording, reasons: list[Reason]) -> IntArray:
    """Return the rows whose every needed number is finite."""
    table = np.column_stack(
        [recording.time_s, recording.position_ned[:, 2], recording.attitude_rad, recording.inputs]
    )
    names = ("time", "depth", "roll", "pitch", "heading", "net buoyancy", "mass position", "tail")
    finite = np.isfinite(table)
    good: BoolArray = np.asarray(finite.all(axis=1), dtype=np.bool_)
    known = np.where(finite[:, 0], recording.time_s, np.nan)
    one_block = np.zeros(good.size, dtype=np.int64)
    for first, stop in _runs(~good, one_block):
        missing = [name for k, name in enumerate(names) if not finite[first:stop, k].all()]
        around = known[max(first - 1, 0) : stop + 1]
        around = around[np.isfinite(around)]
        start, end = (around.min(), around.max()) if around.size else (0.0, 0.0)
        reasons.append(
            Reason(
                "not_a_number",
                float(start),
                float(end),
                f"{stop - first} rows without a number for {', '.join(missing)}",
            )
        )
    return np.flatnonzero(good)


def _clock(
    time_s: FloatArray, rows: IntArray, rules: SegmentRules, reasons: list[Reason]
) -> tuple[IntArray, IntArray]:
    """Skip rows with impossible stamps; return the others and the number of each one's block.

    Within a block the stamps ascend and no gap is too long.
    """
    kept: list[int] = []
    block: list[int] = []
    number, last = 0, -math.inf
    for place, row in enumerate(rows.tolist()):
        now = float(time_s[row])
        if now == last:
            reasons.append(Reason("repeated", now, now, "the stamp was recorded before"))
            continue
        if now < last:
            following = time_s[rows[place + 1]] if place + 1 < rows.size else -math.inf
            reasons.append(
                Reason("backward", now, last, f"the clock ran back by {last - now:.2f} s")
            )
            if following > last:
                continue
            number += 1
        elif now - last > rules.longest_gap_s and kept:
            reasons.append(Reason("gap", last, now, f"nothing recorded for {now - last:.1f} s"))
            number += 1
        kept.append(row)
        block.append(number)
        last = now
    return np.array(kept, dtype=np.int64), np.array(block, dtype=np.int64)


Finding = tuple[BoolArray, ReasonKind, str]


def _at_surface(part: Recording, block: IntArray, rules: SegmentRules) -> Iterator[Finding]:
    del block
    shallow = part.position_ned[:, 2] < rules.surface_depth_m
    yield shallow, "surface", f"shallower than {rules.surface_depth_m * 100:.0f} cm"


def _stuck(part: Recording, block: IntArray, rules: SegmentRules) -> Iterator[Finding]:
    """Find noisy channels that rest, and a depth or pitch that never moves at all."""
    channels = {
        "depth": part.position_ned[:, 2],
        "roll": part.attitude_rad[:, 0],
        "pitch": part.attitude_rad[:, 1],
        "heading": part.attitude_rad[:, 2],
        "net buoyancy": part.net_buoyancy_kg,
        "mass position": part.mass_position_m,
        "tail": part.tail_rad,
    }
    flaps = _flapping_rows(part, block, rules)
    for name, values in channels.items():
        same = np.zeros(values.size, dtype=np.bool_)
        same[1:] = (np.diff(values) == 0.0) & (np.diff(block) == 0)
        long = np.zeros(values.size, dtype=np.bool_)
        for first, stop in _runs(same, block):
            if part.time_s[stop - 1] - part.time_s[first - 1] >= rules.stuck_s:
                long[first - 1 : stop] = True
        is_dead = name in {"depth", "pitch"} and bool(long.all())
        if long.any() and (is_dead or _is_noisy(values[~long & ~flaps])):
            yield long, "stuck", f"{name} repeated the very same value"


def _is_noisy(values: FloatArray) -> bool:
    step = np.diff(values)
    if step.size < 10 or float(np.mean(step == 0.0)) > _RARELY:
        return False
    bend = np.diff(step)
    bend[np.abs(bend) < 1e-9 * float(np.ptp(values))] = 0.0  # rounding of a steady motion
    return float(np.mean(bend[1:] * bend[:-1] < 0.0)) > _OFTEN


def _flapping(part: Recording, block: IntArray, rules: SegmentRules) -> Iterator[Finding]:
    found = _flapping_rows(part, block, rules)
    yield found, "flapping", "the tail flaps: its thrust is not in the model"


def _flapping_rows(part: Recording, block: IntArray, rules: SegmentRules) -> BoolArray:
    """Find where the tail beats at least once, there and back and there again."""
    found = np.zeros(part.time_s.size, dtype=np.bool_)
    for number in range(int(block[-1]) + 1 if block.size else 0):
        rows = np.flatnonzero(block == number)
        time_s = part.time_s[rows]
        legs = _legs(part.tail_rad[rows], rules.flap_swing_rad)
        begin, end = time_s[legs[:, 0]], time_s[legs[:, 1]]
        is_quick = end - begin <= rules.flap_beat_s
        linked: BoolArray = np.asarray(
            is_quick[1:] & is_quick[:-1] & (begin[1:] - end[:-1] <= 0.5 * rules.flap_beat_s)
        )
        for first, stop in _runs(linked, np.zeros(linked.size, dtype=np.int64)):
            if stop - first >= 2:  # three movements in a row
                found[rows[legs[first, 0] : legs[stop, 1] + 1]] = True
    return found


def _legs(values: FloatArray, swing: float) -> IntArray:
    """Return first and last index of each movement between two turning points, ``(legs, 2)``.

    Rest at a turning point belongs to no movement.
    """
    turns = _turning_points(values, swing)
    near = swing / 3.0
    legs: list[tuple[int, int]] = []
    for start, goal in zip(turns[:-1].tolist(), turns[1:].tolist(), strict=True):
        way = values[start : goal + 1]
        left = int(np.flatnonzero(np.abs(way - way[0]) < near)[-1])
        there = np.flatnonzero(np.abs(way[left:] - way[-1]) < near)
        legs.append((start + left, start + left + int(there[0])))
    return np.array(legs, dtype=np.int64).reshape(-1, 2)


def _turning_points(values: FloatArray, swing: float) -> IntArray:
    """Return where a series turns back by at least ``swing``, with the extremes at both ends."""
    turns: list[int] = []
    low = high = 0
    rising: bool | None = None
    for k, value in enumerate(values.tolist()):
        if value > values[high]:
            high = k
        if value < values[low]:
            low = k
        if rising is not False and values[high] - value >= swing:
            turns.append(high)
            rising, low, high = False, k, k
        elif rising is not True and value - values[low] >= swing:
            turns.append(low)
            rising, low, high = True, k, k
    if rising is not None:
        turns.append(high if rising else low)
    return np.array(turns, dtype=np.int64)


def _runs(holds: BoolArray, block: IntArray) -> Iterator[tuple[int, int]]:
    """Yield first and one past the last index of each run of ``holds`` within one block."""
    first: int | None = None
    for k in range(holds.size):
        if first is not None and (not holds[k] or block[k] != block[k - 1]):
            yield first, k
            first = None
        if holds[k] and first is None:
            first = k
    if first is not None:
        yield first, holds.size


def _stretches(
    time_s: FloatArray, found: BoolArray, block: IntArray, kind: ReasonKind, message: str
) -> Iterator[Reason]:
    for first, stop in _runs(found, block):
        yield Reason(kind, float(time_s[first]), float(time_s[stop - 1]), message)


def _cut(
    time_s: FloatArray, rows: IntArray, rules: SegmentRules, reasons: list[Reason]
) -> Iterator[Segment]:
    """Cut one sound run into segments of allowed length."""
    start, end = float(time_s[0]), float(time_s[-1])
    if end - start < rules.shortest_segment_s:
        reasons.append(Reason("short", start, end, f"only {end - start:.1f} s between two flaws"))
        return
    parts = math.ceil((end - start) / rules.longest_segment_s - 1e-9)
    borders = np.linspace(start, end, parts + 1)
    for k in range(parts):
        first = int(np.searchsorted(time_s, borders[k] - 1e-9))
        # a row on the border between two segments is the later one's
        reach = borders[k + 1] + (1e-9 if k == parts - 1 else -1e-9)
        last = int(np.searchsorted(time_s, reach, side="right"))
        piece = rows[first:last]
        if piece.size >= 2:
            yield Segment(piece, float(time_s[first]), float(time_s[last - 1]))
