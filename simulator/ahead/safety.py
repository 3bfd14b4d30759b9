"""How often flights of an ensemble leave the water or enter a keep-out, on which leg, how far."""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.outline import Outline
from autonomy.site import Box, Site
from robot_link.dry_run import DryRunProblem, LegOut, Safety, allowed_flights
from simulator.ahead.flight import Flown
from simulator.ahead.state import ROW_EAST, ROW_LEG, ROW_NORTH

WATER = "the water"
"""What is left, where it is no keep-out that is entered."""
_TOUCH_M = 0.02
"""A robot that a wall holds back is no farther beyond it."""


def safety_of(problem: DryRunProblem, flights: Sequence[Flown]) -> Safety:
    """Return how often flights were where none may be, and how far."""
    legs: dict[tuple[int, str], list[float]] = defaultdict(list)
    farthest: list[float] = []
    for one in flights:
        found = _out(problem, one)
        if found:
            first, name, _ = min(found)
            farthest.append(max(beyond_m for _, _, beyond_m in found))
            last = len(problem.mission.legs) - 1
            leg = min(int(one.rows[first, ROW_LEG]), last)
            legs[leg, name].append(farthest[-1])
    farthest.sort(reverse=True)
    allowed = allowed_flights(problem.greatest_chance, len(flights))
    return Safety(
        flights=len(flights),
        out=len(farthest),
        legs=tuple(
            LegOut(leg, name, len(found_m), float(np.median(found_m)))
            for (leg, name), found_m in sorted(legs.items())
        ),
        short_m=farthest[max(allowed, 0)] if len(farthest) > max(allowed, 0) else 0.0,
    )


def _out(problem: DryRunProblem, one: Flown) -> list[tuple[int, str, float]]:
    """Return where a flight was first out of something or in it, its name, and how far at most."""
    north, east = one.rows[:, ROW_NORTH], one.rows[:, ROW_EAST]
    beyond = [
        (WATER, _beyond_water_m(problem.site, north, east)),
        *((area.name, _within_m(area.outline, north, east)) for area in problem.keep_outs),
    ]
    return [
        (int(np.argmax(found_m > 0.0)), name, float(found_m.max()))
        for name, found_m in beyond
        if found_m.size and found_m.max() > 0.0
    ]


def _beyond_water_m(site: Site, north: FloatArray, east: FloatArray) -> FloatArray:
    """Return how far places are outside of the water, 0 for those in it."""
    found = _beyond_box_m(site.water, north, east)
    found[found <= _TOUCH_M] = 0.0
    if site.shore is not None:
        dry = ~site.shore.contains(north, east)
        if dry.any():
            found[dry] = np.maximum(found[dry], site.shore.distance_m(north[dry], east[dry]))
    return found


def _beyond_box_m(box: Box, north: FloatArray, east: FloatArray) -> FloatArray:
    sides = (box.x_min_m - north, north - box.x_max_m, box.y_min_m - east, east - box.y_max_m)
    return np.maximum(np.maximum.reduce(sides), 0.0)


def _within_m(outline: Outline, north: FloatArray, east: FloatArray) -> FloatArray:
    """Return how deep places are in an area, 0 for those outside."""
    found = np.zeros(len(north))
    inside = outline.contains(north, east)
    if inside.any():
        found[inside] = -outline.distance_m(north[inside], east[inside])
    return found
