"""Predictions of robots that are not heard: made, held against the next fix, and kept.

What a prediction is made of is what was known at the last word before the silence; nothing that was
told after it takes part, not even by a report that came a moment before the fix.
"""

import logging
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from typing import Any

import numpy as np
from sqlalchemy.orm import Session

from autonomy.arrays import FloatArray
from autonomy.estimation.config import EstimatorConfig
from autonomy.estimation.prediction import Prediction, calibration, ellipse_90, miss
from autonomy.planner.config import PlannerConfig
from db.query.measured.predictions import PredictionRecord, add_prediction, list_predictions
from db.query.station.events import add_event
from robot_link.messages import RobotId, StateReport
from server.base.foundation import Foundation
from server.base.retry_queue import until_stored
from server.base.vehicle_catalogue import profile_of
from server.base.wakeups import Wakeups
from server.current.event import CurrentChanged
from server.fleet.current_words import metres
from server.fleet.event import RobotReported
from server.fleet.fleet import Fleet
from server.fleet.status import RobotStatus
from server.prediction.basis import Basis, Told, kind_of, predicted
from server.prediction.view import PredictedPlaceView

log = logging.getLogger(__name__)

SILENCE_S = 60.0
"""A shorter silence is no loss, and its prediction no news; by the robots' clock."""
_SHOWN_AFTER_S = 10.0
"""From here on a prediction stands beside the last word, at the clock's normal speed."""
_SAME_WORD_S = 20.0
"""Reports that were made within so long of each other belong to one contact."""
_PATIENCE_S = 600.0
"""A robot that was heard again and took no fix for so long went on; nothing is judged."""
_JUDGED = 40
"""Newest judged predictions that widen or narrow the next."""
_SHORTEST_AHEAD_S = 300.0
_STEPS = 40


@dataclass(frozen=True, slots=True, eq=False)
class PredictedPath:
    """Where a silent robot should be for a while; computed once, read often."""

    said_at: datetime
    kind: str
    prediction: Prediction

    def at(self, age_s: float) -> tuple[FloatArray, FloatArray]:
        """Return place and covariance of north and east at an age of the last word."""
        ages = self.prediction.age_s
        place = [np.interp(age_s, ages, column) for column in self.prediction.position_ned.T]
        spread = self.prediction.covariance_m2.reshape(-1, 4)
        covariance = [np.interp(age_s, ages, column) for column in spread.T]
        return np.array(place), np.array(covariance).reshape(2, 2)


@dataclass(frozen=True, slots=True)
class PredictionJudged:
    """A fix told what the prediction of a robot was worth."""

    robot: str
    ellipse_units: float
    """How far off it lay; 1 is the edge of the 90 % ellipse."""


@dataclass(frozen=True, slots=True)
class _Return:
    """A robot that was heard again, until a fix judges where it should have been."""

    basis: Basis
    heard_at: datetime


class Predictions:
    """Belongs to one event loop."""

    def __init__(self, foundation: Foundation, fleet: Fleet) -> None:
        self._foundation = foundation
        self._store = foundation.store
        self._clock = foundation.clock
        self._fleet = fleet
        self._bases: dict[str, Basis] = {}
        self._returns: dict[str, _Return] = {}
        self._paths: dict[str, PredictedPath] = {}
        self._looks = Wakeups(foundation.clock, 0.2)

    # what robots say

    async def start(self) -> None:
        """Take up what the database knows of each robot's last word."""
        for status in list(self._fleet.statuses):
            self._take_word(status.record.id, status)

    def take(self, event: RobotReported) -> None:
        """Take that something of a robot may be new."""
        if not self._fleet.knows(event.robot):
            self._forget(event.robot)
            return
        self._take_word(event.robot, self._fleet.status(event.robot))

    def take_current(self, event: CurrentChanged) -> None:
        """Take that more is known of a water: what is shown of a silent robot may change."""
        if event.robot in self._paths:
            self._looks.wake(event.robot)

    def _take_word(self, robot: str, status: RobotStatus) -> None:
        state, known = status.state, self._bases.get(robot)
        if state is None or status.record.kind == "recorded" or status.record.is_foreign:
            return
        if known is not None and state.measured_at <= known.state.measured_at:
            self._bases[robot] = _with_words(known, status)
            return
        if known is not None:
            self._compare(robot, known, state)
        if self._paths.pop(robot, None) is not None:
            self._foundation.feed.mark("prediction", robot)
        fix_at = (
            state.measured_at if state.has_fix else None if known is None else known.last_fix_at
        )
        basis = Basis(state, None, None, None, fix_at)
        self._bases[robot] = _with_words(basis, status)
        after_s = self._fleet.limit_s(_SHOWN_AFTER_S)
        self._looks.set_due(robot, state.measured_at + timedelta(seconds=after_s))

    def _compare(self, robot: str, known: Basis, state: StateReport) -> None:
        """Hold a prediction against the first fix after a silence."""
        silent_s = (state.measured_at - known.state.measured_at).total_seconds()
        if robot not in self._returns and silent_s >= SILENCE_S:
            self._returns[robot] = _Return(known, state.measured_at)
        back = self._returns.get(robot)
        if back is None:
            return
        if state.has_fix:
            del self._returns[robot]
            work = self._judge(robot, back.basis, state)
            self._foundation.background.start(f"judge the prediction of {robot}", work)
        elif (state.measured_at - back.heard_at).total_seconds() > _PATIENCE_S:
            del self._returns[robot]

    def _forget(self, robot: str) -> None:
        for kept in (self._bases, self._returns, self._paths):
            kept.pop(robot, None)

    # what is shown

    def basis(self, robot: str) -> Basis | None:
        """Return what is known of a robot's last word, ``None`` before the first."""
        return self._bases.get(robot)

    def path(self, robot: str) -> PredictedPath | None:
        """Return where a silent robot should be, ``None`` while it is heard or nobody can say."""
        return self._paths.get(robot)

    def age_s(self, said_at: datetime) -> float:
        """Return how old a word is by the robots' clock."""
        return self._fleet.age_s(said_at)

    async def told(self, robot: str) -> Told:
        """Return what a robot's prediction is made of beside its word."""
        book = self._foundation.configurations
        estimator = (await book.current("estimator", robot)).value_as(EstimatorConfig)
        planner = (await book.current("planner", robot)).value_as(PlannerConfig)
        return Told(estimator, profile_of(self._fleet.vehicle(robot)), planner.mission.turn_time_s)

    async def widened(self, robot: str, kind: str) -> float:
        """Return by what factor judged predictions of a kind widen the next."""
        rows = await self._store.query(
            lambda session: list_predictions(session, robot, limit=_JUDGED)
        )
        units = [row.document["plain_units"] for row in rows if row.document.get("kind") == kind]
        return calibration(np.array(units))

    async def run(self) -> None:
        """Predict robots that fell silent, and go on as long as they are, until cancelled."""
        while True:
            for robot in await self._looks.next():
                await until_stored(
                    f"the prediction of {robot}", lambda robot=robot: self._predict(robot)
                )

    async def _predict(self, robot: str) -> None:
        basis = self._bases.get(robot)
        if basis is None or not self._fleet.knows(robot):
            return
        status = self._fleet.status(robot)
        age_s = self.age_s(basis.state.measured_at)
        if age_s < self._fleet.limit_s(_SHOWN_AFTER_S):
            return
        kind, _ = kind_of(status, basis)
        told, factor = await self.told(robot), await self.widened(robot, kind)
        newest = self._bases.get(robot)
        if newest is None or newest.state is not basis.state:
            return  # heard meanwhile: its newer word has a look of its own
        ahead_s = max(_SHORTEST_AHEAD_S, age_s)
        ages = np.concatenate(
            [
                np.linspace(0.0, age_s, _STEPS, endpoint=False),
                np.linspace(age_s, age_s + ahead_s, _STEPS),
            ]
        )
        found = predicted(kind, basis, told, ages)
        if found is None:
            return
        wider = replace(found, covariance_m2=factor**2 * found.covariance_m2)
        self._paths[robot] = PredictedPath(basis.state.measured_at, kind, wider)
        self._foundation.feed.mark("prediction", robot)
        again = basis.state.measured_at + timedelta(seconds=age_s + 0.5 * ahead_s)
        self._looks.set_due(robot, again)

    # what it was worth

    async def _judge(self, robot: str, basis: Basis, fix: StateReport) -> None:
        """Keep how far a fix lay from where the robot should have been."""
        kind, _ = kind_of(self._fleet.status(robot), basis)
        age_s = (fix.measured_at - basis.state.measured_at).total_seconds()
        at = self._clock.now()

        async def keep() -> None:
            if not self._fleet.knows(robot):
                return
            found = predicted(kind, basis, await self.told(robot), np.array([age_s]))
            if found is None:
                return
            factor = await self.widened(robot, kind)
            record = _judged(RobotId(robot), kind, basis, fix, found, factor)

            def write(session: Session) -> bool:
                if not add_prediction(session, record):
                    return False
                text = _judged_text(robot, record, age_s)
                add_event(session, at, "prediction.judged", text, robot=robot)
                return True

            if await self._store.write(write):
                self._foundation.feed.mark("predictions", robot)
                units = float(record.document["ellipse_units"])
                self._foundation.bus.publish(PredictionJudged(robot, units))

        await until_stored(f"what the prediction of {robot} was worth", keep)


def _with_words(basis: Basis, status: RobotStatus) -> Basis:
    """Return a basis with what else was told in the same contact, and nothing of a later one."""
    said_at, plan, current = basis.state.measured_at, status.plan_report, status.current_report

    def belongs(measured_at: datetime) -> bool:
        return (measured_at - said_at).total_seconds() <= _SAME_WORD_S

    return Basis(
        state=basis.state,
        plan_report=plan if plan and belongs(plan.measured_at) else basis.plan_report,
        current_report=current
        if current and belongs(current.measured_at)
        else basis.current_report,
        hand=status.plan if basis.leg is None else basis.hand,
        last_fix_at=basis.last_fix_at,
    )


def _judged(
    robot: RobotId, kind: str, basis: Basis, fix: StateReport, found: Prediction, factor: float
) -> PredictionRecord:
    place, covariance = found.position_ned[0], found.covariance_m2[0]
    seen = np.array(fix.position_ned[:2])
    off_m, units = miss(place[:2], factor**2 * covariance, seen, fix.position_std_m)
    _, plain = miss(place[:2], covariance, seen, fix.position_std_m)
    axes, direction = ellipse_90(factor**2 * covariance)
    document: dict[str, Any] = {
        "kind": kind,
        "miss_m": round(off_m, 3),
        "ellipse_units": round(units, 4),
        "plain_units": round(plain, 4),
        "widened": round(factor, 3),
        "ellipse_m": [round(axis, 3) for axis in axes],
        "ellipse_rad": round(direction, 4),
        "predicted_ne_m": np.round(place[:2], 3).tolist(),
        "seen_ne_m": np.round(seen, 3).tolist(),
        "plan": None if basis.hand is None or kind != "flying" else basis.hand.plan_id,
    }
    return PredictionRecord(robot, basis.state.measured_at, fix.measured_at, units <= 1.0, document)


def _judged_text(robot: str, record: PredictionRecord, age_s: float) -> str:
    document = record.document
    long_m, short_m = document["ellipse_m"]
    side = "inside" if record.is_inside else "outside"
    return (
        f"{robot} was found {metres(document['miss_m'])} from where it was predicted after "
        f"{silence_text(age_s)} without a word: {side} the 90 % ellipse of {metres(long_m)} by "
        f"{metres(short_m)}."
    )


def silence_text(age_s: float) -> str:
    """Return how long nothing was heard, for a sentence."""
    return f"{age_s / 60.0:.0f} min" if age_s >= 90.0 else f"{age_s:.0f} s"


def place_view(
    said_at: datetime, age_s: float, place: FloatArray, covariance: FloatArray
) -> PredictedPlaceView:
    """Return a predicted place as REST tells it."""
    axes, direction = ellipse_90(covariance)
    north, east, depth = np.round(place, 3).tolist()
    return PredictedPlaceView(
        at=said_at + timedelta(seconds=age_s),
        north_m=north,
        east_m=east,
        depth_m=depth,
        ellipse_m=[round(axis, 3) for axis in axes],
        ellipse_rad=direction,
    )
