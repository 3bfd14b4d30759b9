"""What robots heard, with the doubt that its neighbours leave, and where they heard it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

import numpy as np
from sqlalchemy.orm import Session

from autonomy.arrays import BoolArray, FloatArray
from autonomy.site import Site
from autonomy.tag.config import TagConfig
from autonomy.tag.doubtful import doubtful
from autonomy.tag.resting import Extent, RestingPlace, resting_place
from db.query.measured.detections import DetectionRecord, detections
from db.query.measured.telemetry import track

_TRACK_POINTS = 20_000
_GAP_MAX_S = 300.0
"""A robot that said nothing for longer is not known to have listened."""
_RATE_HALF_S = 1800.0
"""Detections of half an hour before and after a place make its rate."""


@dataclass(frozen=True, slots=True)
class Heard:
    """Detections in order of time, and which of them are doubtful."""

    records: Sequence[DetectionRecord]
    doubtful: BoolArray


def heard(
    session: Session,
    robots: Sequence[str],
    config: TagConfig,
    tag: str | None = None,
    start: datetime | None = None,
    end: datetime | None = None,
) -> Heard:
    """Return what robots heard in a stretch of time; doubt looks beyond its ends."""
    around = timedelta(seconds=config.doubtful_after_s)
    found = detections(
        session,
        robots,
        tag,
        None if start is None else start - around,
        None if end is None else end + around,
    )
    alone = doubtful(
        [one.tag for one in found],
        [one.receiver for one in found],
        np.array([one.measured_at.timestamp() for one in found], dtype=np.float64),
        config.doubtful_after_s,
    )
    wanted = [
        index
        for index, one in enumerate(found)
        if (start is None or one.measured_at >= start) and (end is None or one.measured_at <= end)
    ]
    return Heard([found[index] for index in wanted], alone[wanted])


@dataclass(frozen=True, slots=True)
class Listening:
    """Where a robot's receiver was, and for how long."""

    measured_at: Sequence[datetime]
    north_east_m: FloatArray
    """Shape ``(n, 2)``."""
    seconds: FloatArray
    """How long it listened about each point."""


def listening(
    session: Session,
    robot: str,
    start: datetime | None,
    end: datetime | None,
    max_points: int = _TRACK_POINTS,
) -> Listening:
    """Return where a robot listened; what it did in longer silence is not known."""
    known = track(session, robot, start, end, max_points)
    time_s = np.array([at.timestamp() for at in known.measured_at], dtype=np.float64)
    gaps = np.diff(time_s)
    gaps = np.where(gaps > _GAP_MAX_S, 0.0, gaps) / 2.0
    seconds = np.zeros(len(time_s))
    seconds[:-1] += gaps
    seconds[1:] += gaps
    return Listening(known.measured_at, known.position_ned[:, :2], seconds)


def rates_per_hour(times_s: FloatArray, heard_s: FloatArray) -> FloatArray:
    """Return how many detections an hour there were about each time, both ascending, s."""
    behind = np.searchsorted(heard_s, times_s + _RATE_HALF_S, side="right")
    before = np.searchsorted(heard_s, times_s - _RATE_HALF_S, side="left")
    return (behind - before).astype(np.float64) * (3600.0 / (2.0 * _RATE_HALF_S))


def where_resting(
    found: Heard, tracks: Mapping[str, Listening], config: TagConfig, site: Site
) -> RestingPlace:
    """Return where one tag is if it stays where it is; doubtful detections do not count.

    Raises:
        ValueError: If it was never heard at a known place, or nowhere in the water.
    """
    places = np.array(
        [
            (one.north_m, one.east_m)
            for one, is_doubtful in zip(found.records, found.doubtful.tolist(), strict=True)
            if not is_doubtful and one.north_m is not None and one.east_m is not None
        ],
        dtype=np.float64,
    ).reshape(-1, 2)
    if not len(places):
        raise ValueError("No detection of it is beyond doubt and at a known place.")
    extent = Extent.around(places, config)
    listened = [one for one in tracks.values() if len(one.seconds)] or [
        Listening((), places[:1], np.zeros(1))
    ]
    north, east = np.meshgrid(extent.north_m, extent.east_m, indexing="ij")
    water = site.water
    inside = (
        (water.x_min_m <= north)
        & (north <= water.x_max_m)
        & (water.y_min_m <= east)
        & (east <= water.y_max_m)
    )
    if site.shoreline is not None:
        inside &= site.shoreline.contains(north, east)
    return resting_place(
        places,
        np.concatenate([one.north_east_m for one in listened]),
        np.concatenate([one.seconds for one in listened]),
        config,
        extent,
        inside if inside.any() else None,
    )
