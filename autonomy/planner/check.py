"""Finds every reason why a plan must not be sent, in words that name the limit."""

import math
from dataclasses import dataclass

from autonomy.planner.config import PlannerConfig
from autonomy.planner.edge import planned_points
from autonomy.planner.plan import Leg
from autonomy.planner.primitive import bounds
from autonomy.site import Box, Site

_TOLERANCE_M = 0.01
_JOINT_TOLERANCE_M = 0.05


@dataclass(frozen=True, slots=True)
class Violation:
    """One limit that a plan breaks."""

    field: str
    """Where it stands, such as ``legs.3.end_ned`` or ``round_budget``."""
    message: str
    """A sentence with the value and the limit."""


def violations(legs: tuple[Leg, ...], config: PlannerConfig, site: Site) -> tuple[Violation, ...]:
    """List every limit that the legs break; an empty tuple means that the plan may be sent.

    Args:
        legs: The plan, in the site's NED frame.
        config: The settings whose domain, budget and uncertainty hold.
        site: The water that the robot works in.

    Returns:
        All violations, in the order of the legs, then of the plan as a whole.
    """
    if not legs:
        return (Violation("legs", "The plan has no legs."),)
    found: list[Violation] = []
    for number, leg in enumerate(legs):
        found += _leg_violations(number, leg, config, site)
    if found:
        return tuple(found)
    found += _joint_violations(legs)
    found += _plan_violations(legs, config)
    return tuple(found)


def _leg_violations(number: int, leg: Leg, config: PlannerConfig, site: Site) -> list[Violation]:
    place = f"legs.{number}"
    numbers = (*leg.start_ned, *leg.end_ned, leg.speed_m_s, leg.duration_s, leg.energy,
               leg.heading_rad, leg.radius_m, leg.turn_rad)  # fmt: skip
    if not all(math.isfinite(value) for value in numbers):
        return [Violation(place, f"Leg {number + 1} holds a number that is not finite.")]
    if leg.speed_m_s <= 0.0 or leg.duration_s <= 0.0 or leg.energy < 0.0:
        text = "speed and duration must be positive, energy not negative"
        return [Violation(place, f"Leg {number + 1}: {text}.")]
    low, high = bounds(leg)
    beyond = _outside(low, high, site.water, site.kind)
    beyond = beyond or _outside(low, high, config.domain, "survey domain")
    return [
        Violation(f"{place}.end_ned", f"Leg {number + 1} ({leg.kind}) {text}.") for text in beyond
    ]


def _outside(
    low: tuple[float, float, float], high: tuple[float, float, float], box: Box, name: str
) -> list[str]:
    """Say for each side of a box by how much a leg leaves it."""
    sides = (
        (box.x_min_m - low[0], f"south edge of the {name}, x {box.x_min_m:g} m"),
        (high[0] - box.x_max_m, f"north edge of the {name}, x {box.x_max_m:g} m"),
        (box.y_min_m - low[1], f"west edge of the {name}, y {box.y_min_m:g} m"),
        (high[1] - box.y_max_m, f"east edge of the {name}, y {box.y_max_m:g} m"),
        (high[2] - box.depth_max_m, f"{name} floor {box.depth_max_m:g} m"),
        (-low[2], "surface"),
    )
    return [
        f"goes {excess:.2f} m beyond the {side}" for excess, side in sides if excess > _TOLERANCE_M
    ]


def _joint_violations(legs: tuple[Leg, ...]) -> list[Violation]:
    found: list[Violation] = []
    for number in range(1, len(legs)):
        gap_m = math.dist(legs[number - 1].end_ned, legs[number].start_ned)
        if gap_m > _JOINT_TOLERANCE_M:
            text = f"Leg {number + 1} starts {gap_m:.2f} m from where leg {number} ends."
            found.append(Violation(f"legs.{number}.start_ned", text))
    last_m = legs[-1].end_ned[2]
    if last_m > _JOINT_TOLERANCE_M:
        text = f"The plan ends {last_m:.2f} m under water; its last leg must end at the surface."
        found.append(Violation(f"legs.{len(legs) - 1}.end_ned", text))
    return found


def _plan_violations(legs: tuple[Leg, ...], config: PlannerConfig) -> list[Violation]:
    found: list[Violation] = []
    energy = sum(leg.energy for leg in legs)
    if energy > config.round_budget * (1 + 1e-9):
        text = f"The plan needs {energy:.1f} energy units; a round may use {config.round_budget:g}."
        found.append(Violation("round_budget", text))
    worst_m = float(planned_points(config, legs)[:, 4].max())
    if worst_m > config.max_uncertainty_m * (1 + 1e-6):
        text = (
            f"The position would be uncertain by {worst_m:.2f} m; the limit is "
            f"{config.max_uncertainty_m:g} m."
        )
        found.append(Violation("max_uncertainty_m", text))
    return found
