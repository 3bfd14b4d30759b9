"""Places to come to as a file tells them, and the design that they make."""

import itertools
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from autonomy.design.document import (
    WAYPOINTS_MAX,
    Design,
    Lawnmower,
    Manner,
    Motion,
    Spot,
    Way,
    Waypoint,
)
from robot_link.service.item_place import ItemRefusal, below_surface
from server.base.text import shown
from server.plan_file.place import REACH_M, Placement
from server.plan_file.proposal import Findings, NorthEast, ReadArea, ReadChoices
from server.water.proposal import ReadingError

SURFACE_M = 5e-4
"""What is no deeper is at the surface, and swum to."""
DEEPEST_M = 12_000.0
FASTEST_M_S = 5.0
_CORNERS_MAX = 256
_NAME_LENGTH_MAX = 60


@dataclass(slots=True)
class Stop:
    """A place to come to; what the file does not say is None."""

    place_m: NorthEast
    depth_m: float | None = None
    """Where a glide turns; 0 is swum to."""
    name: str = ""
    motion: Motion | None = None
    shallow_m: float | None = None
    angle_rad: float | None = None
    speed_m_s: float | None = None
    surfaces: bool | None = None

    def comes_as(self, usual: Motion) -> Motion:
        """Return how the robot comes here."""
        if self.motion is not None:
            return self.motion
        if self.depth_m is None:
            return usual
        return "swim" if self.depth_m <= SURFACE_M else "glide"


@dataclass(frozen=True, slots=True)
class SurveyManner:
    """How a survey of another program covers its area."""

    spacing_m: float | None = None
    heading_rad: float = 0.0
    is_crossed: bool = False


def reachable(placement: Placement, findings: Findings, place: str, at: NorthEast) -> bool:
    """Tell whether a design can hold a place; note it if not, and offer to move the file."""
    if math.hypot(*at) <= REACH_M:
        return True
    findings.refuse(place, "", f"lies {placement.away(at)}")
    offer_move(findings)
    return False


def offer_move(findings: Findings) -> None:
    """Offer to bring a file of elsewhere into this water."""
    findings.ask(
        "is_moved", "The file is of elsewhere: move its middle to the middle of this water's domain"
    )


def taken_depth(findings: Findings, place: str, value: str, depth_m: float) -> float | None:
    """Return a depth that a design can hold, or None after noting why not.

    Args:
        findings: Takes the refusal, and the question of the sign.
        place: Item, line or feature.
        value: What stands there.
        depth_m: The depth that it means, the choice of sign counted.
    """
    if not math.isfinite(depth_m):
        findings.refuse(place, value, "is no depth")
        return None
    if depth_m > DEEPEST_M:
        findings.refuse(place, value, f"{depth_m:g} m is deeper than any water")
        return None
    try:
        taken = below_surface(depth_m)
    except ItemRefusal as refusal:
        findings.refuse(place, value, str(refusal))
        offer_sign(findings)
        return None
    if depth_m < -SURFACE_M:
        findings.notes.append(f"{place}: {-depth_m:g} m above the water is taken as its surface.")
    return taken


def offer_sign(findings: Findings) -> None:
    """Offer to take the whole file's depths by the other sign, or to take that back."""
    numbers = "negative" if findings.says_depths else "positive"
    findings.ask(
        "turns_sign", f"The file means depths as {numbers} numbers: turn the sign of all of them"
    )


def asked_depth(findings: Findings, places: Sequence[str], choices: ReadChoices) -> float | None:
    """Return the depth of places of which the file says none; ask for it."""
    if not places:
        return None
    some = f"{places[0]} and {len(places) - 1} more" if len(places) > 1 else places[0]
    findings.ask(
        "default_depth_m",
        f"{some} say no depth: how deep is meant? 0 is at the surface",
        "m",
        is_needed=choices.default_depth_m is None,
    )
    return choices.default_depth_m


def design_of(
    stops: Sequence[Stop],
    *,
    returns: bool = False,
    swim_speed_m_s: float | None = None,
) -> Design:
    """Return the waypoints as a design; what most of them share is its manner.

    Raises:
        ReadingError: If there are more than a design may have.
    """
    if len(stops) > WAYPOINTS_MAX:
        reason = f"{len(stops):,} waypoints are more than the {WAYPOINTS_MAX} of a design"
        raise ReadingError(("", reason))
    usual = Manner()
    motions: list[Motion] = [stop.comes_as(usual.motion) for stop in stops]
    motion: Motion = "swim" if motions and set(motions) == {"swim"} else "glide"
    deep = _most(
        [
            stop.depth_m
            for stop, way in zip(stops, motions, strict=True)
            if way == "glide" and stop.depth_m is not None
        ],
        usual.deep_m,
    )
    shallow = _most([s.shallow_m for s in stops if s.shallow_m is not None], 0.0)
    if deep is not None and shallow is not None and shallow >= deep:
        shallow = 0.0
    angle = _most([s.angle_rad for s in stops if s.angle_rad is not None], usual.glide_angle_rad)
    manner = Manner(
        motion=motion,
        shallow_m=shallow or 0.0,
        deep_m=deep,
        glide_angle_rad=angle,
        swim_speed_m_s=swim_speed_m_s,
    )
    waypoints = tuple(
        _waypoint(stop, way, manner) for stop, way in zip(stops, motions, strict=True)
    )
    return Design(content=Way(waypoints=waypoints, returns=returns), manner=manner)


def _waypoint(stop: Stop, motion: Motion, manner: Manner) -> Waypoint:
    is_glide = motion == "glide"
    deep = stop.depth_m if is_glide else None
    return Waypoint(
        north_m=stop.place_m[0],
        east_m=stop.place_m[1],
        name=shown(stop.name, _NAME_LENGTH_MAX),
        motion=None if motion == manner.motion else motion,
        deep_m=None if deep is None or deep == manner.deep_m else deep,
        shallow_m=_other(stop.shallow_m if is_glide else None, manner.shallow_m),
        glide_angle_rad=_other(stop.angle_rad if is_glide else None, manner.glide_angle_rad),
        speed_m_s=stop.speed_m_s,
        surfaces=stop.surfaces,
    )


def _other(value: float | None, usual: float | None) -> float | None:
    return None if value == usual else value


def _most(values: Sequence[float], default: float | None) -> float | None:
    return Counter(values).most_common(1)[0][0] if values else default


def lawnmower_of(
    area: ReadArea, manner: SurveyManner, choices: ReadChoices, findings: Findings
) -> Design | None:
    """Return the design that covers an area, or None after noting why it cannot."""
    place = f"area {area.number}"
    if len(area.corners_m) > _CORNERS_MAX:
        count = len(area.corners_m)
        findings.refuse(place, f"{count} corners", f"a pattern takes {_CORNERS_MAX}")
        return None
    if any(math.hypot(*corner) > REACH_M for corner in area.corners_m):
        findings.refuse(place, "", "lies too far from the water to be covered")
        offer_move(findings)
        return None
    content = Lawnmower(
        area=tuple(Spot(north_m=north, east_m=east) for north, east in area.corners_m),
        spacing_m=manner.spacing_m,
        heading_rad=manner.heading_rad,
        is_crossed=manner.is_crossed,
    )
    depth = choices.default_depth_m
    findings.ask("default_depth_m", "How deep the lines over the area turn", "m")
    if depth is None or depth <= SURFACE_M:
        motion: Motion = "glide" if depth is None else "swim"
        return Design(content=content, manner=Manner(motion=motion))
    return Design(content=content, manner=Manner(deep_m=depth))


def way_length_m(design: Design) -> float:
    """Return the length of a way along the surface; 0 of a pattern."""
    content = design.content
    if not isinstance(content, Way):
        return 0.0
    places = [waypoint.ne_m for waypoint in content.waypoints]
    return math.fsum(math.dist(a, b) for a, b in itertools.pairwise(places))
