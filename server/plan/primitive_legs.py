"""Legs that an operator laid out, completed by what the planner's settings say."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg import primitive
from autonomy.planner.leg.edge import Edge, expected_points, legs_energy
from autonomy.planner.outcome import as_candidate
from autonomy.planner.plan import Candidate, Leg, PositionNed, PrimitiveKind
from server.base.problem import FieldError, unprocessable

POINTS_MAX = 20_000
"""Of the points that a plan is looked at by, one each ``point_interval_s``."""
_SPEEDS = {
    PrimitiveKind.GLIDE: "glide_speed_m_s",
    PrimitiveKind.SPIRAL: "spiral_speed_m_s",
    PrimitiveKind.DIVE: "dive_speed_m_s",
    PrimitiveKind.SWIM: "swim_speed_m_s",
    PrimitiveKind.KEEP: "swim_speed_m_s",
}


@dataclass(frozen=True, slots=True)
class LegRequest:
    """One leg as an operator says it; it starts where the one before ended."""

    kind: PrimitiveKind
    end_ned: PositionNed
    """Of a dive only the depth counts; of a spiral too, its circle says the rest. A stay at the
    surface is where the leg before ended."""
    speed_m_s: float | None = None
    heading_rad: float = 0.0
    radius_m: float = 0.0
    turn_rad: float = 0.0
    duration_s: float = 0.0
    """Of a stay at the surface."""


def legs_from(
    config: PlannerConfig, start_xy: tuple[float, float], requests: Sequence[LegRequest]
) -> tuple[Leg, ...]:
    """Lay legs end to end from a point of the surface.

    Raises:
        Problem: 422 with the path of each leg that does not move the robot, or where all take
            too long to be looked at.
    """
    here: PositionNed = (*start_xy, 0.0)
    legs: list[Leg] = []
    errors: list[FieldError] = []
    for i, request in enumerate(requests):
        try:
            leg = _leg(config, here, request)
        except ValueError as error:
            raise unprocessable(
                f"Leg {i + 1} cannot be swum.",
                [FieldError(loc=["legs", i, "end_ned"], msg=str(error))],
            ) from error
        if not (math.isfinite(leg.duration_s) and leg.duration_s > 0.0):
            loc: list[str | int] = ["legs", i, "end_ned"]
            errors.append(FieldError(loc=loc, msg=f"this {request.kind} does not move the robot"))
        legs.append(leg)
        here = leg.end_ned
    if errors:
        raise unprocessable(f"{len(errors)} legs do not move the robot.", errors)
    duration_s, interval_s = sum(leg.duration_s for leg in legs), config.primitives.point_interval_s
    if not duration_s / interval_s <= POINTS_MAX:
        text = (
            f"they take {duration_s:.3g} s, which at a point each {interval_s:g} s is more than "
            f"the {POINTS_MAX:,} points of a plan"
        )
        raise unprocessable("The legs take too long.", [FieldError(loc=["legs"], msg=text)])
    return tuple(legs)


def candidate_of(config: PlannerConfig, legs: Sequence[Leg]) -> Candidate:
    """Return legs as a trajectory with its account; the objective is not known."""
    whole = tuple(legs)
    edge = Edge(whole, expected_points(config, whole), legs_energy(config, whole))
    return as_candidate(config, [edge], 0.0)


def _leg(config: PlannerConfig, here: PositionNed, request: LegRequest) -> Leg:
    if request.speed_m_s is not None:
        motion = config.primitives.model_copy(update={_SPEEDS[request.kind]: request.speed_m_s})
        config = config.model_copy(update={"primitives": motion})
    north_m, east_m, depth_m = request.end_ned
    match request.kind:
        case PrimitiveKind.GLIDE:
            return primitive.glide(config, here, request.end_ned)
        case PrimitiveKind.DIVE:
            return primitive.dive(config, here, depth_m)
        case PrimitiveKind.SWIM:
            return primitive.swim(config, here, (north_m, east_m, here[2]))
        case PrimitiveKind.SPIRAL:
            return primitive.spiral(
                config, here, request.heading_rad, request.radius_m, request.turn_rad, depth_m
            )
        case PrimitiveKind.KEEP:
            return primitive.keep(config, here, request.radius_m, request.duration_s)
