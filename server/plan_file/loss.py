"""What of a design a format cannot express, in words; shown before a file is saved."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

from autonomy.design.document import Design, Mooring, StationKeep, SurfacingRules, Way, Waypoint
from server.plan_file.leg import WrittenLeg

Format = Literal["qgc_plan", "wpl", "kml", "geojson", "csv"]
_SPEEDS: Final = ("qgc_plan", "wpl", "csv")
_MANNERS: Final = ("csv",)
_KINDS: Final = {
    "lawnmower": "lawnmower",
    "expanding_square": "expanding square",
    "spiral": "spiral",
    "star": "star",
    "along_line": "line to follow",
    "along_isobath": "isobath to follow",
    "section": "repeated section",
    "mooring": "virtual mooring",
    "reference": "reference trajectory",
    "station_keep": "stay at the surface",
}


@dataclass(frozen=True, slots=True)
class Loss:
    """One thing that other programs will not see."""

    text: str
    is_kept: bool
    """Whether the file keeps it for this program alone, so that reading it again brings it back."""


def losses_of(
    format: Format, design: Design, legs: Sequence[WrittenLeg], way: Sequence[Waypoint]
) -> tuple[Loss, ...]:
    """Return what a format does not express of a design, whose waypoints are laid out."""
    texts = [*_of_content(format, design), *_of_manner(format, design, legs)]
    texts += _left_to_the_robot(format, design, legs, way)
    texts += _of_surfacing(format, design)
    return tuple(Loss(text, is_kept=format == "qgc_plan") for text in texts)


def _of_content(format: Format, design: Design) -> list[str]:
    content = design.content
    texts: list[str] = []
    if isinstance(content, Mooring | StationKeep):
        time = f" for {content.duration_s:g} s" if format not in ("qgc_plan", "wpl") else ""
        within = f" within {content.radius_m:g} m" if isinstance(content, StationKeep) else ""
        texts.append(f"the {_KINDS[content.kind]}{within}{time}: only its place is written")
    elif not isinstance(content, Way):
        kind = _KINDS.get(content.kind, content.kind.replace("_", " "))
        texts.append(f"the {kind} as such: its waypoints are written one by one")
    elif content.returns:
        texts.append("that it returns to the first waypoint: that one is written again at the end")
    waypoints: Sequence[Waypoint] = content.waypoints if isinstance(content, Way) else ()
    named = sum(1 for waypoint in waypoints if waypoint.name)
    if named and format != "csv":
        texts.append(f"the names of {named} waypoints" if named > 1 else "the name of a waypoint")
    return texts


def _of_manner(format: Format, design: Design, legs: Sequence[WrittenLeg]) -> list[str]:
    glides = [leg for leg in legs if leg.motion == "glide"]
    texts: list[str] = []
    if glides and format not in _MANNERS:
        texts.append("that a leg glides to and fro between two depths, and its glide angle")
        if any(leg.shallow_m > 0.0 for leg in glides):
            texts.append("the shallow turns below the surface")
    if format not in _SPEEDS and any(leg.speed_m_s is not None for leg in legs):
        texts.append("the speeds")
    if design.manner.floor_clearance_m is not None:
        texts.append("the clearance above the floor")
    return texts


def _left_to_the_robot(
    format: Format, design: Design, legs: Sequence[WrittenLeg], way: Sequence[Waypoint]
) -> list[str]:
    """Name what a design leaves to the robot, of which a file has to say a number."""
    glides = [
        (leg, waypoint) for leg, waypoint in zip(legs, way, strict=True) if leg.motion == "glide"
    ]
    texts: list[str] = []
    depths = [leg.depth_m for leg, waypoint in glides if waypoint.deep_m is None]
    if depths and design.manner.deep_m is None:
        texts.append(f"that it dives as deep as the robot's surveys: {depths[0]:g} m are written")
    angles = [leg.glide_angle_rad for leg, own in glides if own.glide_angle_rad is None]
    if angles and design.manner.glide_angle_rad is None and format in _MANNERS:
        written_deg = math.degrees(angles[0])
        texts.append(f"that its glide angle is the robot's own: {written_deg:.3g} deg are written")
    return texts


def _of_surfacing(format: Format, design: Design) -> list[str]:
    rules = design.surfacing
    texts: list[str] = []
    content = design.content
    waypoints: Sequence[Waypoint] = content.waypoints if isinstance(content, Way) else ()
    if format != "csv" and any(waypoint.surfaces is not None for waypoint in waypoints):
        texts.append("at which waypoints the robot comes up")
    if not rules.at_waypoints:
        texts.append("that the robot stays under water at its waypoints")
    if rules.every_s is not None:
        texts.append(f"that it comes up at least every {rules.every_s:g} s")
    if rules.at_utc:
        texts.append(f"that it comes up at {len(rules.at_utc)} times")
    if rules.max_uncertainty_m is not None:
        texts.append(f"that it comes up when less certain than {rules.max_uncertainty_m:g} m")
    if rules.samples_waiting is not None:
        texts.append(f"that it comes up when {rules.samples_waiting:,} samples wait")
    texts += [
        f"that it comes up when {one.channel} is {one.side} {one.value:g}" for one in rules.on_value
    ]
    if rules.hold_off_s != SurfacingRules().hold_off_s:
        texts.append(f"that its own rules bring it up not again for {rules.hold_off_s:g} s")
    return texts
