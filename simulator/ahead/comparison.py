"""Flights held against the plan that they flew, and what can be expected of one more."""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.site import Area
from robot_link.dry_run import DryRun, DryRunProblem, DryRunTrack

_CIRCLE_95 = math.sqrt(-2.0 * math.log(0.05))
"""Radius of the circle that holds 95 % of a round Gaussian, in standard deviations."""
_ROWS_MAX = 600
_SHARES, _FEWER_SHARES = np.linspace(0.0, 1.0, 13), np.linspace(0.0, 1.0, 5)
"""Shares of a leg at which the expected track has a point; fewer for a plan of many legs."""
_MANY_LEGS = 100
_RUNS_LEAST = 2
"""A single flight is no mean."""
_RARE = 0.2
"""What happens in this part of many flights, or less, is told as a chance and keeps back no plan.
"""
_MANY_RUNS = 10
"""So many flights tell chances; of fewer each counts."""
_AT_SURFACE_M = 0.01
"""Planned depth of a surfacing, but for rounding."""


@dataclass
class Flight:
    """One run."""

    rows: FloatArray = field(default_factory=lambda: np.empty((0, 9)))
    """On legs: time s, leg, where it truly was and where it believed to be NED m, stated std m,
    shape ``(n, 9)``."""
    places: FloatArray = field(default_factory=lambda: np.empty((0, 2)))
    """Where the robot truly was, north and east, all the time."""
    surfaced: dict[int, tuple[float, float]] = field(default_factory=dict)
    """Where the robot truly was when the leg of this number ended at the surface."""
    duration_s: float = 0.0
    energy: float = 0.0
    reason: str = ""
    """Why it did not fly the whole mission; empty if it did."""
    leg: int = -1
    """Leg flown last."""


class PlannedLegs:
    """The plan by leg: where it has the robot at a share of a leg."""

    def __init__(self, problem: DryRunProblem) -> None:
        settings, legs = problem.mission.settings, problem.mission.legs
        begin = np.array([[0.0, settings.start_x_m, settings.start_y_m, 0.0, np.nan]])
        begin[0, 4] = problem.planned_points[0, 4]
        self._points = np.concatenate([begin, problem.planned_points])
        self._ends_s = np.cumsum([leg.duration_s for leg in legs])
        self._durations_s = np.array([leg.duration_s for leg in legs])
        self.legs = len(legs)

    def time_s(self, leg: IntArray, share: FloatArray) -> FloatArray:
        """Return the plan's time at shares of legs, shape ``(n,)``."""
        return self._ends_s[leg] - (1.0 - share) * self._durations_s[leg]

    def at(self, leg: IntArray, share: FloatArray) -> FloatArray:
        """Return north, east, down and position std at shares of legs, shape ``(n, 4)``."""
        time_s, points = self.time_s(leg, share), self._points
        return np.column_stack([np.interp(time_s, points[:, 0], points[:, k]) for k in range(1, 5)])


def shares_of(legs: int) -> FloatArray:
    """Return the shares of a leg at which the track of a plan of so many legs has points."""
    return _SHARES if legs <= _MANY_LEGS else _FEWER_SHARES


def _with_expectation(found: DryRun, plan: PlannedLegs, flights: list[Flight]) -> DryRun:
    """Add where the flights were in the mean, if enough of them flew the whole plan.

    The scatter is that of one more flight: those that made the mean lie nearer to it.
    """
    runs, legs = len(flights), plan.legs
    if runs < _RUNS_LEAST or not found.completed:
        return found
    shares = shares_of(legs)
    columns = (0, 1, 0, 2, 3, 4, 8)
    places = np.array(
        [by_share(flight.rows[:, columns], legs, shares) for flight in flights if not flight.reason]
    )  # (runs, legs, shares, 5)
    mean = places.mean(axis=0)  # (legs, shares, 5)
    passed_s = np.maximum(mean[:, -1, 0] - mean[:, 0, 0], 1.0)  # (legs,)
    off_m2 = ((places - mean)[..., 1:3] ** 2).sum(axis=-1).mean(axis=(0, 2))  # (legs,)
    runs = len(places)
    others = (runs + 1) / (runs - 1)
    spread_m = math.sqrt(others * float(np.average(off_m2, weights=passed_s)))
    leg = np.repeat(np.arange(legs), len(shares))
    points = mean.reshape(-1, 5)
    times_s = tuple((begin, end) for begin, end in mean[:, (0, -1), 0].round(1).tolist())
    points[:, 0] = plan.time_s(leg, np.tile(shares, legs))
    return replace(found, expected=points, expected_times_s=times_s, spread_m=spread_m)


def by_share(rows: FloatArray, legs: int, shares: FloatArray) -> FloatArray:
    """Return a flight at shares of its legs, shape ``(legs, shares, columns)``.

    A leg that was over at once, for the robot was where it ends already, is spent where the one
    before ended; so are those that a flight did not come to.

    Args:
        rows: Time, leg, and whatever else, of the moments on legs, shape ``(n, 2 + columns)``.
        legs: How many the plan has.
        shares: Ascending from 0 to 1.
    """
    leg, share = leg_shares(rows)
    # a leg's end and the next one's begin lie apart on this scale
    wanted = 2.0 * np.arange(legs)[:, None] + shares
    found = np.stack(
        [np.interp(wanted, 2.0 * leg + share, column) for column in rows[:, 2:].T], axis=-1
    )
    for number in np.setdiff1d(np.arange(legs), leg):
        found[number] = found[number - 1, -1] if number else rows[0, 2:]
    return found


def leg_shares(rows: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the leg of each row of a flight and the share of it that has passed."""
    time_s, leg = rows[:, 0], rows[:, 1].astype(np.int64)
    flown, first, which = np.unique(leg, return_index=True, return_inverse=True)
    last = np.append(first[1:], len(leg)) - 1
    passed_s = np.maximum(time_s[last] - time_s[first], 1.0) if len(flown) else np.empty(0)
    return leg, (time_s - time_s[first][which]) / passed_s[which]


def _track(plan: PlannedLegs, flight: Flight) -> DryRunTrack:
    rows = flight.rows
    planned = plan.at(*leg_shares(rows))
    return DryRunTrack(
        time_s=rows[:, 0],
        true_ned=rows[:, 2:5],
        believed_ned=rows[:, 5:8],
        stated_std_m=rows[:, 8],
        planned_ned=planned[:, :3],
        planned_std_m=planned[:, 3],
    )


def _surfacing_errors(plan: PlannedLegs, flight: Flight) -> list[float]:
    """Return how far from its planned place each dive came up, m."""
    errors: list[float] = []
    for leg, place in flight.surfaced.items():
        if leg >= 0:
            planned = plan.at(np.array([leg]), np.ones(1))[0]
            if planned[2] < _AT_SURFACE_M:
                errors.append(math.dist(place, planned[:2].tolist()))
    return errors


def compared(problem: DryRunProblem, flights: list[Flight]) -> DryRun:
    """Hold flights against the plan that they flew."""
    plan = PlannedLegs(problem)
    tracks = [_track(plan, flight) for flight in flights]
    offsets = [track.true_ned[:, :2] - track.planned_ned[:, :2] for track in tracks]
    error_m = np.linalg.norm(np.concatenate(offsets), axis=1)
    lost = np.concatenate([(one.true_ned - one.believed_ned)[:, :2] for one in tracks])
    std_m = np.concatenate([track.planned_std_m for track in tracks])
    surfacings = [error for flight in flights for error in _surfacing_errors(plan, flight)]
    reasons = [flight.reason for flight in flights if flight.reason]
    entries = [_entered(problem.keep_outs, flight) for flight in flights]
    names = [area.name for area in problem.keep_outs]
    flown = bool(len(error_m))
    rms_m = _rms(error_m)
    worst_m = float(error_m.max()) if flown else 0.0
    within = float(np.mean(error_m <= _CIRCLE_95 * std_m)) if flown else 0.0
    rare = _RARE * len(flights) if len(flights) >= _MANY_RUNS else 0.0
    completed = len(reasons) <= rare
    message = _sentence(len(flights), reasons, rms_m, worst_m, completed=completed)
    found = DryRun(
        completed=completed,
        message=message + _entry_sentences(names, entries),
        rms_error_m=rms_m,
        worst_error_m=worst_m,
        surfacing_error_m=max(surfacings, default=0.0),
        position_error_m=_rms(np.linalg.norm(lost, axis=1)),
        predicted_error_m=_rms(math.sqrt(2.0) * std_m),
        planned_worst_std_m=float(problem.planned_points[:, 4].max()),
        within_share=within,
        duration_s=float(np.mean([flight.duration_s for flight in flights])),
        energy=float(np.mean([flight.energy for flight in flights])),
        runs=len(flights),
        entered=tuple(name for name in names if sum(name in one for one in entries) > rare),
        track=_thinned(tracks[0]),
    )
    return _with_expectation(found, plan, flights)


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


def _sentence(
    runs: int, reasons: list[str], rms_m: float, worst_m: float, *, completed: bool
) -> str:
    failed = ""
    if reasons:
        who = f"{len(reasons)} of {runs} times the robot" if runs > 1 else "The robot"
        often = max(set(reasons), key=reasons.count)
        failed = f"{who} did not fly the whole plan: {often}."
    if not completed:
        return failed
    times = "once" if runs == 1 else f"{runs} times"
    flown = (
        f"Flown {times} against the full dynamics: {_metres(rms_m)} (rms) from the plan, "
        f"{_metres(worst_m)} at worst."
    )
    return f"{flown} {failed}" if failed else flown


def _metres(distance_m: float) -> str:
    return f"{distance_m:.0f} m" if distance_m >= 10.0 else f"{distance_m:.2g} m"


def _entered(keep_outs: tuple[Area, ...], flight: Flight) -> frozenset[str]:
    """Return the names of the keep-outs that a flight led into."""
    north, east = flight.places.T
    return frozenset(area.name for area in keep_outs if np.any(area.contains(north, east)))


def _entry_sentences(names: list[str], entries: list[frozenset[str]]) -> str:
    """Return a sentence for each keep-out that was entered, after a space."""
    text = ""
    for name in names:
        count = sum(name in one for one in entries)
        often = f" in {count} of {len(entries)} flights" if len(entries) > 1 else ""
        text += f' It enters the keep-out "{name}"{often}.' if count else ""
    return text


def _thinned(track: DryRunTrack) -> DryRunTrack:
    step = max(1, -(-len(track.time_s) // _ROWS_MAX))
    return DryRunTrack(
        track.time_s[::step],
        track.true_ned[::step],
        track.believed_ned[::step],
        track.stated_std_m[::step],
        track.planned_ned[::step],
        track.planned_std_m[::step],
    )
