"""What REST tells of a robot's prediction, its own acts, and what predictions were worth."""

import statistics
from datetime import datetime, timedelta

import numpy as np

from autonomy.estimation.energy_use import EnergyEstimate
from autonomy.estimation.prediction import Prediction
from db.query.fleet.onboard import list_parameters
from db.query.measured.predictions import PredictionRecord, list_predictions
from db.query.mission.plans import PlanRecord, plan_by_hash
from robot_link.satellite.config import SatelliteConfig
from server.base.foundation import Foundation
from server.battery.battery_use import BatteryUse
from server.battery.lasting import rate_w
from server.fleet.fleet import Fleet
from server.plan.ledger import in_hand
from server.prediction.basis import (
    Basis,
    Told,
    kind_of,
    leg_times_s,
    stated_std_m,
)
from server.prediction.own_acts import Known, own_acts
from server.prediction.predictions import PredictedPath, Predictions, place_view
from server.prediction.view import (
    JudgedPredictionsView,
    JudgedPredictionView,
    OwnActView,
    PredictedPlaceView,
    PredictionView,
)

_AHEAD_S = np.arange(30.0, 6.0 * 3600.0, 30.0)
"""Times after the last word at which the robot's own uncertainty is looked at."""


class Outlook:
    """Says what is expected of robots. Belongs to one event loop."""

    def __init__(self, foundation: Foundation, fleet: Fleet, predictions: Predictions) -> None:
        self._foundation = foundation
        self._fleet = fleet
        self._predictions = predictions
        self._batteries = foundation.services.get(BatteryUse)

    async def of(self, robot: str) -> PredictionView:
        """Return where a robot should be and what it will do by itself.

        Raises:
            Problem: 404 if there is no such robot.
        """
        status, basis = self._fleet.status(robot), self._predictions.basis(robot)
        if basis is None:
            why = "It has not said where it is."
            if status.record.kind == "recorded":
                why = "It is a recording."
            elif status.record.is_foreign:
                why = "It is a vehicle of another maker, and does not tell what it will do."
            return PredictionView(
                robot, "unknown", why, is_silent=False, said_at=None, age_s=None, now=None, path=[],
                widened=1.0, next_contact=None, acts=[],
            )  # fmt: skip
        kind, text = kind_of(status, basis)
        path = self._predictions.path(robot)
        said_at = basis.state.measured_at
        age_s = self._predictions.age_s(said_at)
        return PredictionView(
            robot=robot,
            kind=kind,
            text=text,
            is_silent=path is not None,
            said_at=said_at,
            age_s=age_s,
            now=None if path is None else place_view(said_at, age_s, *path.at(age_s)),
            path=[] if path is None else _path_views(path),
            widened=await self._predictions.widened(robot, kind),
            next_contact=status.next_surfacing(),
            acts=await self._acts(robot, basis),
        )

    async def judged(self, robot: str, before: str | None, limit: int) -> JudgedPredictionsView:
        """Return the last predictions of a robot that a fix has judged.

        Raises:
            Problem: 404 if there is no such robot.
        """
        self._fleet.status(robot)
        rows = await self._foundation.store.query(
            lambda session: list_predictions(session, robot, before=before, limit=limit)
        )
        views = [_judged_view(row) for row in rows]
        return JudgedPredictionsView(
            robot,
            views,
            share_inside=statistics.fmean(one.is_inside for one in views) if views else None,
            median_miss_m=statistics.median(one.miss_m for one in views) if views else None,
        )

    async def _acts(self, robot: str, basis: Basis) -> list[OwnActView]:
        status, foundation = self._fleet.status(robot), self._foundation
        report = basis.plan_report
        sha256 = None if report is None else report.sha256
        plan = await self._plan_of(robot, sha256)
        told = await self._predictions.told(robot)
        parameters = await foundation.store.query(lambda session: list_parameters(session, robot))
        satellite = None
        if status.satellite_link is not None or status.satellite is not None:
            kept = await foundation.configurations.current("satellite", robot)
            satellite = kept.value_as(SatelliteConfig)
        rate, capacity_wh = await self._rate(robot)
        has_legs = plan is not None and bool(plan.document.get("legs"))
        ends_s = leg_times_s(in_hand(plan), told.turn_time_s)[1] if plan and has_legs else []
        return own_acts(
            Known(
                status=status,
                basis=basis,
                plan=plan,
                ends_s=ends_s,
                parameters={one.name: one for one in parameters},
                profile=told.profile,
                satellite=satellite,
                uncertain_at=_uncertain_at(basis, told, plan),
                rate_w=rate,
                capacity_wh=capacity_wh,
            )
        )

    async def _plan_of(self, robot: str, sha256: str | None) -> PlanRecord | None:
        if sha256 is None:
            return None
        hand = self._fleet.status(robot).plan
        if hand is not None and hand.record.sha256 == sha256:
            return hand.record
        return await self._foundation.store.query(
            lambda session: plan_by_hash(session, robot, sha256)
        )

    async def _rate(self, robot: str) -> tuple[EnergyEstimate | None, float]:
        battery = await self._batteries.of(robot)
        return (None, 0.0) if battery is None else (rate_w(battery), battery.config.capacity_wh)


def _uncertain_at(basis: Basis, told: Told, plan: PlanRecord | None) -> datetime | None:
    """Return when a robot under water takes its position for too uncertain, if no fix comes."""
    if plan is None or basis.state.has_fix:
        return None
    limit_m = float(plan.document["settings"]["max_uncertainty_m"])
    over = np.flatnonzero(stated_std_m(basis, told, _AHEAD_S) > limit_m)
    if len(over) == 0:
        return None
    return basis.state.measured_at + timedelta(seconds=float(_AHEAD_S[over[0]]))


def _path_views(path: PredictedPath) -> list[PredictedPlaceView]:
    found: Prediction = path.prediction
    return [
        place_view(path.said_at, age, place, covariance)
        for age, place, covariance in zip(
            found.age_s.tolist(), found.position_ned, found.covariance_m2, strict=True
        )
    ]


def _judged_view(row: PredictionRecord) -> JudgedPredictionView:
    document = row.document
    return JudgedPredictionView(
        id=row.id,
        said_at=row.said_at,
        seen_at=row.seen_at,
        silent_s=(row.seen_at - row.said_at).total_seconds(),
        kind=document["kind"],
        miss_m=document["miss_m"],
        ellipse_units=document["ellipse_units"],
        is_inside=row.is_inside,
        ellipse_m=document["ellipse_m"],
        predicted_ne_m=document["predicted_ne_m"],
        seen_ne_m=document["seen_ne_m"],
    )
