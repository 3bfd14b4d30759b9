"""A limit that a plan breaks, and what the checks of plans have in common."""

from dataclasses import dataclass

from autonomy.planner.plan import Leg

PLACE_TOLERANCE_M = 0.005
"""Places nearer than this are one place: legs travel in millimetres."""
SHARE_TOLERANCE = 0.01
"""Share by which a leg's numbers may differ from what they say of each other."""


@dataclass(frozen=True, slots=True)
class Violation:
    """One limit that a plan breaks."""

    field: str
    """What breaks it, such as ``legs.2.end_ned`` or ``round_budget``."""
    message: str
    """One sentence with the limit and by how much it is broken."""


def leg_title(number: int, leg: Leg) -> str:
    """Return what sentences call a leg, given its place in the plan counted from 0."""
    return f"Leg {number + 1} ({leg.kind})"
