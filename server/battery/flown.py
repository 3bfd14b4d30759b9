"""What plans use the battery for: what a plan will take, and what one took while nobody heard."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.estimation.energy_use import Use
from autonomy.planner.config import EnergyConfig
from autonomy.planner.leg import primitive
from autonomy.planner.plan import Leg, PrimitiveKind
from db.query.mission.plans import PlanRecord
from server.fleet.status import FOLLOW_TARGET

USE_OF_KIND = {
    PrimitiveKind.GLIDE: Use.GLIDE,
    PrimitiveKind.SPIRAL: Use.SPIRAL,
    PrimitiveKind.DIVE: Use.DIVE,
    PrimitiveKind.SWIM: Use.SWIM,
    PrimitiveKind.KEEP: Use.SWIM,
}
"""Of a stay at the surface it is what the robot does for the share that it swims."""
SLACK = timedelta(seconds=60.0)
"""A silence may begin so long before a plan, and end so long after it, and be of its flight."""
_S_PER_H = 3600.0
_PRICES = EnergyConfig()


def swum_share(
    kind: PrimitiveKind, energy: float, duration_s: float, prices: EnergyConfig
) -> float:
    """Return which part of a leg's time its use lasts: all of it, but for a stay at the surface."""
    if kind is not PrimitiveKind.KEEP:
        return 1.0
    floating = prices.time_factor * duration_s
    swimming = primitive.energy(PrimitiveKind.SWIM, duration_s, prices)
    return min(max((energy - floating) / max(swimming - floating, 1e-9), 0.0), 1.0)


def hours_of_legs(
    legs: Sequence[Leg], duration_s: float, prices: EnergyConfig = _PRICES
) -> FloatArray:
    """Return the hours of each use of a plan; what its legs do not fill it is at the surface.

    Args:
        legs: The plan's.
        duration_s: How long it takes, surfacings included.
        prices: By which the legs' energies were counted.
    """
    hours = np.zeros(len(Use))
    for leg in legs:
        share = swum_share(leg.kind, leg.energy, leg.duration_s, prices)
        hours[USE_OF_KIND[leg.kind]] += share * leg.duration_s / _S_PER_H
    hours[Use.AFLOAT] = max(0.0, duration_s / _S_PER_H - float(hours.sum()))
    return hours


@dataclass(frozen=True, slots=True, eq=False)
class FlownPlan:
    """When a robot that flew a plan did what, by the plan's own account."""

    started_at: datetime
    ended_at: datetime | None
    uses: tuple[Use, ...]
    begins_s: FloatArray
    """Since the start, shape ``(n,)``."""
    ends_s: FloatArray

    @classmethod
    def of(cls, plan: PlanRecord) -> "FlownPlan | None":
        """Return it of a plan that was begun, ``None`` of another one."""
        if plan.running_at is None:
            return None
        if plan.kind == FOLLOW_TARGET:
            all_the_time = np.array([np.inf])
            return cls(plan.running_at, plan.ended_at, (Use.SWIM,), np.zeros(1), all_the_time)
        legs: Sequence[Mapping[str, Any]] = plan.document.get("legs", ())
        uses = tuple(USE_OF_KIND[PrimitiveKind(leg["kind"])] for leg in legs)
        expected = (plan.document.get("rehearsal") or {}).get("expected_times_s") or ()
        if len(expected) == len(legs):
            times = np.array(expected, dtype=np.float64).reshape(-1, 2)
            begins, ends = times[:, 0], times[:, 1]
        else:
            ends = np.cumsum([leg["duration_s"] for leg in legs], dtype=np.float64)
            begins = np.append(0.0, ends[:-1])
        ends = begins + _shares(plan, legs) * (ends - begins)
        return cls(plan.running_at, plan.ended_at, uses, begins, ends)

    def hours(self, start: datetime, end: datetime) -> FloatArray | None:
        """Return the hours of each use between two moments, ``None`` if it was not flown then."""
        last = self.ended_at
        if start < self.started_at - SLACK or (last is not None and end > last + SLACK):
            return None
        from_s = (start - self.started_at).total_seconds()
        until_s = (end - self.started_at).total_seconds()
        hours = np.zeros(len(Use))
        spent_s = np.minimum(self.ends_s, until_s) - np.maximum(self.begins_s, from_s)
        for use, seconds in zip(self.uses, np.maximum(spent_s, 0.0).tolist(), strict=True):
            hours[use] += seconds / _S_PER_H
        hours[Use.AFLOAT] += max(0.0, (until_s - from_s) / _S_PER_H - float(hours.sum()))
        return hours


def _shares(plan: PlanRecord, legs: Sequence[Mapping[str, Any]]) -> FloatArray:
    """Return which part of each leg's time its use lasts, shape ``(n,)``."""
    prices = EnergyConfig.model_validate(plan.config.get("energy") or {})
    return np.array(
        [
            swum_share(PrimitiveKind(leg["kind"]), leg["energy"], leg["duration_s"], prices)
            for leg in legs
        ],
        dtype=np.float64,
    )
