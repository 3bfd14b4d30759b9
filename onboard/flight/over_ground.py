"""A plan that allows for a current, as a robot flies it that reckons with a current itself.

The legs of such a plan say where a robot believes to be that sees no current: they aim off, and at
each surfacing the next leg begins where the water has carried it. A robot that reckons with the
current wants to know where it shall be over ground, and which current each dive counts on; both
follow from the jumps at the surfacings.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from autonomy.planner.leg.drift import knows_place
from autonomy.planner.plan import Leg, PositionNed
from onboard.flight.course import dive_ends

_LEAST_JUMP_M = 2e-3
"""The wire rounds to the millimetre."""
_NorthEast = tuple[float, float]


@dataclass(frozen=True, slots=True)
class GroundCourse:
    """The legs of a plan over ground."""

    legs: tuple[Leg, ...]
    currents_ne_m_s: tuple[_NorthEast, ...]
    """Current, north and east, that each leg's dive counts on; empty where the plan has none."""


def over_ground(legs: tuple[Leg, ...]) -> GroundCourse:
    """Return a plan's legs over ground.

    No jump tells of the last dive, nor of a swim along the surface: they count on the current of
    the dive before, the first ones on that of the dive after. A plan of one dive tells of none.

    Args:
        legs: As the plan has them: where a robot believes to be that sees no current.
    """
    dives = _dives(legs)
    told = [_told(dive, after) for dive, after in pairwise(dives)]
    current = next((one for one in told if one is not None), (0.0, 0.0))
    flown: list[Leg] = []
    currents: list[_NorthEast] = []
    for dive, one in zip(dives, (*told, None), strict=False):
        current = one or current
        flown += _carried(dive, current)
        currents += [current] * len(dive)
    has_current = any(one != (0.0, 0.0) for one in currents)
    return GroundCourse(tuple(flown), tuple(currents) if has_current else ())


def _dives(legs: tuple[Leg, ...]) -> list[tuple[Leg, ...]]:
    """Return the legs from one surfacing to the next."""
    dives: list[tuple[Leg, ...]] = []
    begin = 0
    for end in sorted(set(dive_ends(legs))):
        dives.append(legs[begin : end + 1])
        begin = end + 1
    return dives


def _told(dive: Sequence[Leg], after: Sequence[Leg]) -> _NorthEast | None:
    """Return the current that carries a dive to where the next one begins; None if it sees it."""
    blind_s = sum(leg.duration_s for leg in dive if not knows_place(leg))
    if blind_s <= 0.0:
        return None
    believed, true = dive[-1].end_ned, after[0].start_ned
    north, east = true[0] - believed[0], true[1] - believed[1]
    if max(abs(north), abs(east)) < _LEAST_JUMP_M:
        return 0.0, 0.0
    return north / blind_s, east / blind_s


def _carried(dive: Sequence[Leg], current: _NorthEast) -> list[Leg]:
    """Move the legs of a dive along with the current, by the time since the last fix."""
    moved: list[Leg] = []
    under_s = 0.0
    for leg in dive:
        begins_s = under_s
        under_s = 0.0 if knows_place(leg) else under_s + leg.duration_s
        moved.append(
            replace(
                leg,
                start_ned=_moved(leg.start_ned, current, begins_s),
                end_ned=_moved(leg.end_ned, current, under_s),
            )
        )
    return moved


def _moved(place: PositionNed, current: _NorthEast, time_s: float) -> PositionNed:
    return place[0] + current[0] * time_s, place[1] + current[1] * time_s, place[2]
