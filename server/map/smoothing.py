"""Moves the samples of a finished dive to where the fix that ended it says they were taken.

The robot's own word stays in the database beside them. Which samples are still to be looked at is
known from the database alone, so a station that was killed in the middle goes on where it was; the
samples of one look are kept in one transaction, and looking twice changes nothing.
"""

import asyncio
import copy
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np
from sqlalchemy.orm import Session

from autonomy.arrays import FloatArray, spaced
from autonomy.estimation.fix_watch import FixWatch
from autonomy.estimation.smoother import Dive, finished_dives, smooth_dive
from db.column import moment
from db.query.measured.current_reports import believed_currents
from db.query.measured.smoothing import (
    SmoothedPlace,
    TrackColumns,
    keep_smoothed,
    newest_fix,
    newest_sample,
    note_smoothed,
    track_columns,
    unsmoothed_from,
)
from db.query.station.events import add_event
from db.store import Store
from robot_link.clock import Clock
from robot_link.messages import Sample
from server.fleet.current_words import DOUBT_TOLD, LIKELY_WHY

ROWS_PER_LOOK = 20_000
"""Most reports and samples of one look; a longer track is looked at piece by piece."""
CLOSEST_S = 0.25
"""Points of a track closer than this give no speed: clocks and positions on a wire are rounded."""
TOLD_MAX = 1000
"""Dives of a robot that are known to have been told of: late samples come of newer ones."""


@dataclass(frozen=True, slots=True)
class SmoothedDive:
    """What a fix did to the samples of the dive that it ended."""

    dive: Dive
    samples: int
    moved_m: float
    """How far the sample that moved farthest did, m."""

    def text(self, robot: str) -> str:
        """Return a sentence for the event log."""
        north_m, east_m = self.dive.drift_ne_m
        off_m = float(np.hypot(*self.dive.jump_ne_m))
        ended = datetime.fromtimestamp(self.dive.fix_time_s, UTC)
        return (
            f"The fix of {ended:%H:%M:%SZ} moved {self.samples} samples of {robot}'s dive by up to "
            f"{self.moved_m:.2f} m; the water had carried it {np.hypot(north_m, east_m):.2f} m, "
            f"{off_m:.2f} m of it unforeseen."
        )

    def document(self) -> dict[str, object]:
        """Return what is known of the dive for JSON."""
        return {
            "start_s": self.dive.start_s,
            "fix_s": self.dive.fix_time_s,
            "samples": self.samples,
            "moved_m": self.moved_m,
            "drift_ne_m": list(self.dive.drift_ne_m),
            "believed_ne_m_s": list(self.dive.believed_ne_m_s),
            "believed_std_m_s": self.dive.believed_std_m_s,
            "walk_std_m": self.dive.walk_std_m,
            "current_ne_m_s": list(self.dive.current_ne_m_s),
            "surprise": self.dive.surprise,
        }


class Smoothing:
    """Smooths the dives of all robots. Belongs to one event loop; the work is done in threads."""

    def __init__(self, store: Store, clock: Clock) -> None:
        self._store = store
        self._clock = clock
        self._newest: dict[str, datetime] = {}
        """When the newest stored sample was taken, by robot; of a robot that is not here nobody
        asked the database yet."""
        self._pending: dict[str, datetime] = {}
        """When the first sample was taken that is to be looked at, by robot."""
        self._announced: defaultdict[str, set[float]] = defaultdict(set)
        """The newest ``TOLD_MAX`` fixes whose dives were told of, by robot."""
        self._told: dict[str, datetime] = {}
        """Newest fix that a robot reported, which the database may not have yet."""
        self._seen: dict[str, datetime] = {}
        """Newest fix that the database had at the last look, by robot."""
        self._watches: defaultdict[str, FixWatch] = defaultdict(FixWatch)
        """How far the dives of each robot ended from where it believed to be."""
        self._looking = asyncio.Lock()

    def feed(self, samples: Sequence[Sample]) -> None:
        """Note that samples were stored."""
        for sample in samples:
            self._restore(sample.robot, sample.measured_at)
            newest = self._newest.get(sample.robot)
            if newest is not None:
                self._newest[sample.robot] = max(newest, sample.measured_at)

    def take_fix(self, robot: str, at: datetime) -> None:
        """Note that a robot reported a fix."""
        self._told[robot] = max(self._told.get(robot, at), at)

    def is_behind(self, robot: str) -> bool:
        """Tell whether a fix was reported that was not in the database at the last look."""
        told, seen = self._told.get(robot), self._seen.get(robot)
        return told is not None and (seen is None or told > seen) and self.is_pending(robot)

    def has_ended_dive(self, robot: str) -> bool:
        """Tell whether a sample that is to be looked at was taken before a fix that is known of."""
        told, first = self._told.get(robot), self._pending.get(robot)
        return told is not None and first is not None and first < told

    def is_pending(self, robot: str) -> bool:
        """Tell whether samples of a robot may be there to be looked at."""
        return robot in self._pending or robot not in self._newest

    async def look(self, robot: str) -> int:
        """Smooth the dives of a robot that a fix has ended; return how many samples moved.

        Raises:
            UnknownIdError: If there is no such robot.
            StoreError: Nothing of the piece under way was kept; look again.
        """
        async with self._looking:
            return await self._look(robot)

    async def _look(self, robot: str) -> int:
        moved = 0
        while (fix := await self._fix_to_look_at(robot)) is not None:
            begin = self._pending.pop(robot)
            try:
                more, judged_us = await self._look_from(robot, begin, fix)
            except BaseException:
                self._restore(robot, begin)
                raise
            moved += more
            if judged_us is None:
                break
            self._restore(robot, moment(judged_us))
        return moved

    async def _fix_to_look_at(self, robot: str) -> datetime | None:
        """Return the newest fix if a sample was taken before it that was not looked at."""
        if not self.is_pending(robot):
            return None
        fix = await self._store.query(lambda session: newest_fix(session, robot))
        if fix is None:
            return None
        self._seen[robot] = fix
        if robot not in self._newest:
            first = await self._store.query(lambda session: unsmoothed_from(session, robot))
            newest = await self._store.query(lambda session: newest_sample(session, robot))
            if first is not None:
                self._restore(robot, first)
            self._newest.setdefault(robot, newest or fix)
        pending = self._pending.get(robot)
        return fix if pending is not None and pending < fix else None

    async def _look_from(
        self, robot: str, begin: datetime, fix: datetime
    ) -> tuple[int, int | None]:
        """Look at one piece; return how many samples moved, and where a further piece begins."""

        def work(session: Session) -> tuple[list[SmoothedPlace], list[SmoothedDive], int | None]:
            start = newest_fix(session, robot, before=begin)
            track = track_columns(session, robot, start, fix, ROWS_PER_LOOK)
            beliefs = believed_currents(session, robot, start, fix)
            is_whole = len(track) < ROWS_PER_LOOK
            if not is_whole:
                track = _up_to_last_fix(track)
            places, dives = smoothed_places(track, beliefs)
            return places, dives, None if is_whole else int(track.measured_at_us[-1]) + 1

        places, dives, more = await self._store.query(work)
        at = self._clock.now()
        # Samples that come late by satellite move a dive again; that is no news.
        announced = self._announced[robot]
        untold = [one for one in dives if one.dive.fix_time_s not in announced]
        watch = copy.deepcopy(self._watches[robot])
        doubts = _judged(robot, watch, [one.dive for one in untold])

        def keep(session: Session) -> None:
            keep_smoothed(session, robot, places)
            note_smoothed(session, robot, begin, fix if more is None else moment(more - 1))
            for one in untold:
                text = one.text(robot)
                add_event(session, at, "dive.smoothed", text, robot=robot, data=one.document())
            for text in doubts:
                add_event(session, at, "dive.doubted", text, level="watch", robot=robot)

        await self._store.write(keep)
        self._watches[robot] = watch
        announced.update(one.dive.fix_time_s for one in untold)
        for oldest in sorted(announced)[:-TOLD_MAX]:
            announced.discard(oldest)
        if self._newest[robot] >= fix:
            # What was taken after this fix waits for the next.
            self._restore(robot, fix)
        return sum(one.samples for one in dives), more

    def _restore(self, robot: str, first: datetime) -> None:
        """Note that samples from a moment on are to be looked at."""
        self._pending[robot] = min(self._pending.get(robot, first), first)


def _judged(robot: str, watch: FixWatch, dives: Sequence[Dive]) -> list[str]:
    """Hold dives against what the robot had stated; say so once when they begin to go too far."""
    found: list[str] = []
    for dive in dives:
        was_doubted = watch.doubt >= DOUBT_TOLD
        known = dive.walk_std_m**2 + dive.fix_std_m**2
        watch.take(2.0 * dive.surprise, known / (known + dive.carried_std_m**2))
        if watch.doubt >= DOUBT_TOLD and not was_doubted:
            found.append(
                f"The last {watch.dives} dives of {robot} ended farther from where it believed to "
                f"be than it had stated, as if it were {watch.doubt:.1f} times less sure: "
                f"{LIKELY_WHY}."
            )
    return found


def smoothed_places(
    track: TrackColumns, beliefs: FloatArray
) -> tuple[list[SmoothedPlace], list[SmoothedDive]]:
    """Return where every sample of a track was taken, and what was done to which dive.

    Args:
        track: What a robot said of its position, up to a fix.
        beliefs: What it said of the current, see ``finished_dives``.
    """
    time_s = track.measured_at_us.astype(np.float64) * 1e-6
    position_ned, std_m = track.position_ned.copy(), track.position_std_m.copy()
    line = spaced(time_s, CLOSEST_S)
    dives = finished_dives(
        time_s[line], track.position_ned[line], track.position_std_m[line], beliefs
    )
    told: list[SmoothedDive] = []
    for dive in dives:
        mine = track.is_sample & (time_s >= dive.start_s) & (time_s < dive.fix_time_s)
        if not mine.any():
            continue
        moved = smooth_dive(
            dive, time_s[mine], track.position_ned[mine], track.position_std_m[mine]
        )
        position_ned[mine] = moved.position_ned
        std_m[mine] = np.minimum(moved.position_std_m, track.position_std_m[mine])
        way_m = np.linalg.norm(moved.position_ned - track.position_ned[mine], axis=1)
        told.append(SmoothedDive(dive, int(np.count_nonzero(mine)), float(way_m.max())))
    return _places(track, position_ned, std_m), told


def _places(
    track: TrackColumns, position_ned: FloatArray, std_m: FloatArray
) -> list[SmoothedPlace]:
    mine = track.is_sample
    columns = (track.log, track.sequence, position_ned, std_m)
    return [
        SmoothedPlace(log, sequence, (north_m, east_m, depth_m), one_std_m)
        for log, sequence, (north_m, east_m, depth_m), one_std_m in zip(
            *(column[mine].tolist() for column in columns), strict=True
        )
    ]


def _up_to_last_fix(track: TrackColumns) -> TrackColumns:
    """Return a track up to its last fix, all of it if it has none after its first point."""
    fixes = np.flatnonzero(track.has_fix[1:])
    return track.until(int(fixes[-1]) + 2 if len(fixes) else len(track))
