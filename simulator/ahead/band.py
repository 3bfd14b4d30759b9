"""Where many flights of one mission were: bands along the legs and along time, and chances."""

import math
from collections import Counter
from collections.abc import Sequence
from typing import Final

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.site import Area, Site
from onboard.flight.course import is_surface
from robot_link.dry_run import Chance, DryRunProblem, FlightBand, SurfacingBand
from simulator.ahead.comparison import PlannedLegs, by_share
from simulator.ahead.flight import BATTERY, LOST, TIMED_OUT, Flown
from simulator.ahead.state import (
    ROW_BATTERY,
    ROW_DOWN,
    ROW_EAST,
    ROW_LEG,
    ROW_NORTH,
    ROW_SAMPLES,
    ROW_TIME,
)

LEVEL: Final = 0.9
"""Part of the flights that a band holds."""
_QUANTILES = (0.5 * (1.0 - LEVEL), 0.5, 0.5 * (1.0 + LEVEL))
_ELLIPSE = math.sqrt(-2.0 * math.log(1.0 - LEVEL))
"""Half axis of the ellipse that holds that part of a Gaussian, in standard deviations."""
_MANY = 20
"""So many places tell the shape of the part of them that lies closest together."""
_STEPS = 6
_POINTS_MAX = 600
_SHARES_MAX = 7
_MOMENTS = 121
_PLACE = (ROW_NORTH, ROW_EAST, ROW_DOWN)
_WORDS = {
    0: "flew the whole mission",
    TIMED_OUT: "ran out of time",
    BATTERY: "ran out of battery",
    LOST: "did not come up",
}
"""How a flight ended, as a sentence goes on."""
LEFT_WATER = "left the water"


def band_of(problem: DryRunProblem, flights: Sequence[Flown]) -> FlightBand:
    """Sum up many flights of a mission; those that did not begin are none."""
    site, outcomes = problem.site, [_outcome(problem.site, one) for one in flights]
    done, count = _WORDS[0], len(flights)
    return FlightBand(
        level=LEVEL,
        along=_along(problem, flights),
        over_time=_over_time(flights),
        surfacings=tuple(_surfacings(problem, flights)),
        battery_end=_three([one.battery for one in flights]),
        duration_s=_three([one.duration_s for one in flights]),
        worst_std_m=_three([one.worst_std_m for one in flights]),
        leaves_water=_share([_leaves_water(site, one) for one in flights]),
        leaves_domain=_share([_leaves_domain(site, one) for one in flights]),
        touches=tuple(
            Chance(area.name, _share([_touches(area, one) for one in flights]))
            for area in problem.keep_outs
        ),
        not_back=_share([outcome != done for outcome in outcomes]),
        outcomes=tuple(
            Chance(name, often / count) for name, often in Counter(outcomes).most_common()
        ),
        dives_cut=_share([one.dives_cut > 0 for one in flights]),
    )


def _share(events: Sequence[bool]) -> float:
    return float(np.mean(events)) if events else 0.0


def _three(values: Sequence[float] | FloatArray) -> tuple[float, float, float]:
    """Return low, median and high of the band."""
    low, middle, high = np.quantile(values, _QUANTILES).tolist()
    return low, middle, high


def _along(problem: DryRunProblem, flights: Sequence[Flown]) -> FloatArray:
    """Return the band along the legs, as ``FlightBand.along`` has it."""
    plan = PlannedLegs(problem)
    each = min(max(_POINTS_MAX // plan.legs, 2), _SHARES_MAX)
    shares = np.linspace(0.0, 1.0, each)
    columns = (ROW_TIME, ROW_LEG, ROW_TIME, *_PLACE)
    begun = [one.rows[one.rows[:, ROW_SAMPLES] > 0.0][:, columns] for one in flights]
    found = np.array(
        [_until_end(by_share(rows, plan.legs, shares), rows) for rows in begun if len(rows)]
    )  # (flights, legs, shares, 4), not a number where a flight did not come to
    leg = np.repeat(np.arange(plan.legs), each)
    if not len(found):
        return np.empty((0, 15))
    points = found.reshape(len(found), -1, 4)
    rows: list[list[float]] = []
    for k, time_s in enumerate(plan.time_s(leg, np.tile(shares, plan.legs))):
        here = points[np.isfinite(points[:, k, 0]), k]
        if len(here) > 1:
            came = len(here) / len(flights)
            rows.append([float(leg[k]), float(time_s), *_point(here), came])
    return np.array(rows).reshape(-1, 15)


def _point(here: FloatArray) -> list[float]:
    """Return the band of places at one share of a leg: time, three ranges, ellipse."""
    ranges = np.quantile(here[:, 1:], (_QUANTILES[0], _QUANTILES[2]), axis=0).T.ravel().tolist()
    return [float(np.median(here[:, 0])), *ranges, *ellipse(here[:, 1:3])]


def ellipse(places: FloatArray) -> tuple[float, float, float, float, float]:
    """Return the ellipse that holds the band's part of places: centre, half axes, direction.

    Few places are taken for Gaussian ones. Of many it is the tight ellipse around the part of them
    that lies closest together, as wide as it must be to hold that part: some flights that are lost
    do not widen it.

    Args:
        places: North and east, shape ``(n, 2)``, m; two at least.

    Returns:
        North and east of its centre, half axes, the longer first, m; its direction, from north
        towards east, rad.

    Source:
        Rousseeuw and Van Driessen (1999), A fast algorithm for the minimum covariance determinant
        estimator, Technometrics 41: the concentration step.
    """
    centre, covariance = places.mean(axis=0), np.cov(places.T)
    width = _ELLIPSE
    if len(places) >= _MANY:
        kept = math.ceil(LEVEL * len(places))
        for _ in range(_STEPS):
            core = places[np.argsort(_squares(places, centre, covariance))[:kept]]
            centre, covariance = core.mean(axis=0), np.cov(core.T)
        squares = _squares(places, centre, covariance)
        width = math.sqrt(float(np.partition(squares, kept - 1)[kept - 1]))
    values, axes = np.linalg.eigh(covariance)
    short, long = (width * np.sqrt(np.maximum(values, 0.0))).tolist()
    north, east = centre.tolist()
    return north, east, long, short, math.atan2(axes[1, 1], axes[0, 1])


def _squares(places: FloatArray, centre: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return the squared Mahalanobis distance of places, shape ``(n,)``."""
    off = places - centre
    least = 1e-12 * (1.0 + float(np.trace(covariance)))
    found = np.linalg.solve(covariance + least * np.eye(2), off.T).T
    return np.einsum("ni,ni->n", off, found)


def _until_end(places: FloatArray, rows: FloatArray) -> FloatArray:
    """Leave out the legs that a flight did not come to."""
    places[int(rows[-1, 1]) + 1 :] = math.nan
    return places


def _over_time(flights: Sequence[Flown]) -> FloatArray:
    """Return the band along time, as ``FlightBand.over_time`` has it."""
    ends_s = np.array([one.duration_s for one in flights])
    moments = np.linspace(0.0, float(ends_s.max()), _MOMENTS)
    columns = (*_PLACE, ROW_BATTERY)
    at = np.array(
        [
            [np.interp(moments, one.rows[:, ROW_TIME], one.rows[:, k]) for k in columns]
            for one in flights
        ]
    )  # (flights, 4, moments)
    bands = np.quantile(at, _QUANTILES, axis=0)  # (3, 4, moments)
    under_way = (ends_s[:, None] >= moments).mean(axis=0)
    return np.column_stack([moments, bands.transpose(2, 1, 0).reshape(_MOMENTS, 12), under_way])


def _surfacings(problem: DryRunProblem, flights: Sequence[Flown]) -> list[SurfacingBand]:
    """Return when and where the flights came up after the legs that end at the surface."""
    found: list[SurfacingBand] = []
    for number, leg in enumerate(problem.mission.legs):
        if not is_surface(leg.end_ned[2]):
            continue
        came = np.array([one.surfaced[number] for one in flights])
        came = came[np.isfinite(came[:, 0])]
        if len(came) > 1:
            north, east, long, short, angle = ellipse(came[:, 1:3])
            found.append(
                SurfacingBand(
                    leg=number,
                    share=len(came) / len(flights),
                    time_s=_three(came[:, 0]),
                    north_m=north,
                    east_m=east,
                    ellipse_m=(long, short),
                    ellipse_rad=angle,
                    battery=_three(came[:, 3]),
                )
            )
    return found


def _places(one: Flown) -> tuple[FloatArray, FloatArray]:
    return one.rows[:, ROW_NORTH], one.rows[:, ROW_EAST]


def _leaves_water(site: Site, one: Flown) -> bool:
    """Tell whether a flight is outside of the water's box or its outline at some time."""
    north, east = _places(one)
    box, shore = site.water, site.shore
    is_out = (north < box.x_min_m) | (north > box.x_max_m)
    is_out |= (east < box.y_min_m) | (east > box.y_max_m)
    return bool(is_out.any() or (shore is not None and not shore.contains(north, east).all()))


def _leaves_domain(site: Site, one: Flown) -> bool:
    north, east = _places(one)
    box = site.domain
    is_out = (north < box.x_min_m) | (north > box.x_max_m)
    return bool((is_out | (east < box.y_min_m) | (east > box.y_max_m)).any())


def _touches(area: Area, one: Flown) -> bool:
    return bool(np.any(area.contains(*_places(one))))


def _outcome(site: Site, one: Flown) -> str:
    """Return how a flight ended; one that ends outside of the water did not come back."""
    if not one.is_done:
        return _WORDS[one.reason]
    north, east = one.rows[-1, ROW_NORTH], one.rows[-1, ROW_EAST]
    is_in = site.water.contains(north, east, 0.0)
    shore = site.shore
    if not is_in or (shore is not None and not bool(shore.contains(north, east))):
        return LEFT_WATER
    return _WORDS[0]


def reason_of(one: Flown) -> str:
    """Return why a flight did not fly the whole mission, "" if it did."""
    return "" if one.is_done else f"it {_WORDS[one.reason]}"
