"""Observations of a current as the database keeps them, and what was predicted of them."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import Any, TypeVar

import numpy as np

from autonomy.current.model import CurrentMap, Observation
from db.query.measured.current_observations import ObservationRecord
from robot_link.messages import RobotId

_Kept = TypeVar("_Kept")

_LONGEST_WAIT = 4.0
"""A prediction is for a dive that begins within so many times the length of the one before."""


@dataclass(frozen=True, slots=True)
class Forecast:
    """What was said, when a dive had ended, of the robot's next one: its mean current."""

    made_s: float
    until_s: float
    """It is no prediction of a dive that begins later."""
    dives: int
    """How many dives the map was made of."""
    north_m_s: float
    east_m_s: float
    last_north_m_s: float
    """The current of the newest dive of the water, which needs no map."""
    last_east_m_s: float


@dataclass(frozen=True, slots=True)
class Verdict:
    """How far a dive ended from what had been said of it before it began."""

    error_m: float
    """By the map."""
    last_error_m: float
    """By the newest current then."""


@dataclass(frozen=True, slots=True)
class KeptObservation:
    """An observation with what was predicted of it, and after it."""

    observation: Observation
    forecast: Forecast | None
    verdict: Verdict | None

    def record(self, water: str) -> ObservationRecord:
        """Return it as a row of a water, told by its digest."""
        one = self.observation
        start_s = float(one.time_s[0])
        document: dict[str, Any] = {
            "time_s": (one.time_s - start_s).tolist(),
            "start_s": start_s,
            "position_ned": one.position_ned.tolist(),
            "displacement_ne_m": list(one.displacement_ne_m),
            "walk_std_m": one.walk_std_m,
            "fix_std_m": one.fix_std_m,
            "water": water,
            "forecast": None if self.forecast is None else asdict(self.forecast),
            "verdict": None if self.verdict is None else asdict(self.verdict),
        }
        return ObservationRecord(
            robot=RobotId(one.robot),
            started_at=datetime.fromtimestamp(start_s, UTC),
            ended_at=datetime.fromtimestamp(float(one.time_s[-1]), UTC),
            is_surface=one.is_surface,
            document=document,
        )

    @classmethod
    def of(cls, record: ObservationRecord) -> "KeptObservation":
        """Return what a row holds."""
        document: Mapping[str, Any] = record.document
        north, east = document["displacement_ne_m"]
        observation = Observation(
            robot=record.robot,
            time_s=np.array(document["time_s"]) + document["start_s"],
            position_ned=np.array(document["position_ned"]),
            displacement_ne_m=(north, east),
            walk_std_m=document["walk_std_m"],
            fix_std_m=document["fix_std_m"],
            is_surface=record.is_surface,
        )
        forecast, verdict = document["forecast"], document["verdict"]
        return cls(
            observation,
            None if forecast is None else _read(Forecast, forecast),
            None if verdict is None else _read(Verdict, verdict),
        )


def _read(kind: type[_Kept], document: Mapping[str, Any]) -> _Kept | None:
    """Return what a document holds; ``None`` if it is of another shape."""
    try:
        return kind(**document)
    except TypeError:
        return None


def forecast_after(known: CurrentMap, dive: Observation) -> Forecast:
    """Say, when a dive has ended, what the current along the robot's next one will be.

    Nobody knows yet where it leads: it is taken to be as long and as deep as the last one, from
    where that ended.
    """
    dives = [one for one in known.observations if not one.is_surface]
    newest = dives[-1] if dives else dive
    end_s = float(dive.time_s[-1])
    place = dive.position_ned[-1].copy()
    place[:2] += dive.displacement_ne_m
    track = dive.position_ned.copy()
    track[:, :2] = place[:2]
    along = known.displacement(dive.time_s - dive.time_s[0] + end_s, track).mean_ne_m
    north, east = (along / dive.duration_s).tolist()
    return Forecast(
        made_s=end_s,
        until_s=end_s + _LONGEST_WAIT * dive.duration_s,
        dives=len(dives),
        north_m_s=north,
        east_m_s=east,
        last_north_m_s=newest.current_ne_m_s[0],
        last_east_m_s=newest.current_ne_m_s[1],
    )


def verdict_on(forecast: Forecast | None, dive: Observation) -> Verdict | None:
    """Hold a dive against what was said before it began; ``None`` if nothing was."""
    start_s = float(dive.time_s[0])
    if forecast is None or dive.is_surface or start_s > forecast.until_s:
        return None
    if start_s < forecast.made_s - 1.0:
        return None  # it had begun when that was said
    (north, east), T = dive.displacement_ne_m, dive.duration_s
    return Verdict(
        error_m=math.hypot(north - T * forecast.north_m_s, east - T * forecast.east_m_s),
        last_error_m=math.hypot(
            north - T * forecast.last_north_m_s, east - T * forecast.last_east_m_s
        ),
    )
