"""Does a robot fly where its draft says?

Plans are drawn when this runs: dives of random shapes between random places. Each is flown ahead
as the station does, and then by robots that meet other eddies, other instruments and other
currents. Judged is the horizontal distance between a flight and the expected track at the same
share of the same leg, and beside it the distance from the nearest point of that leg's track, which
is what a flying robot is held against.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.planner.leg.edge import Edge, propose_edge, random_shape
from autonomy.planner.outcome import as_candidate
from autonomy.planner.plan import Candidate
from autonomy.planner.preset import MINIGLIDER
from autonomy.site import TANK
from autonomy.vehicle.config import VEHICLES
from autonomy.vehicle.trim import TrimConfig
from robot_link.dry_run import DryRun, DryRunProblem
from robot_link.mission import Mission, MissionSettings
from server.plan.dry_run import RUNS
from server.plan.expected import off_track_m
from simulator import dry_run
from simulator.ahead import comparison, ensemble

PLANS = 6
FRESH = 2
"""Flights of each plan in each water."""
_TRIES = 200
"""Shapes in vain after which a plan has what it can have."""
_RESAMPLED = 2000
_CALM_M_SQRT_S = 0.001


@dataclass(frozen=True, slots=True)
class Water:
    """What a rehearsal expects of the water, and what the robot then meets."""

    name: str
    bar_m: float
    drift_m_sqrt_s: float
    steady_m_s: float = 0.0
    """Speed of a current that nobody is told, in a direction that is drawn."""
    knows_calm: bool = False
    """Whether the rehearsal is told that there is neither an eddy nor a current."""


_DRIFT = MINIGLIDER.position_filter.drift_m_sqrt_s
WATERS = (
    Water("calm water, told", 0.13, _CALM_M_SQRT_S, knows_calm=True),
    Water("eddies", 0.28, _DRIFT),
    Water("2 cm/s untold", 0.35, _DRIFT, steady_m_s=0.02),
)


@dataclass(frozen=True, slots=True)
class Flown:
    """Mean square distances of one fresh flight, m2."""

    from_track: float
    nearest: float
    from_legs: float
    promised: float
    """What the spread of the rehearsals said."""


def measure() -> list[dict[str, Any]]:
    """Plan, rehearse and fly; takes about four minutes of a core."""
    seeds = np.random.SeedSequence()
    print(f"expected_track: seed {seeds.entropy}", flush=True)
    rng = np.random.default_rng(seeds)
    found: dict[str, list[list[Flown]]] = {water.name: [] for water in WATERS}
    for _ in range(PLANS):
        best = plan(rng)
        for water in WATERS:
            found[water.name].append(flown(best, water, rng))
    return [row for water in WATERS for row in rows_of(water, found[water.name], rng)]


def plan(rng: np.random.Generator) -> Candidate:
    """Draw dives of the shapes that a search tries, one after another until a round is spent."""
    domain = MINIGLIDER.domain
    low, high = (domain.x_min_m, domain.y_min_m), (domain.x_max_m, domain.y_max_m)
    here: tuple[float, float] = tuple(rng.uniform(low, high).tolist())
    edges: list[Edge] = []
    spent, tries = 0.0, 0
    while tries < _TRIES:
        north, east = rng.uniform(low, high).tolist()
        left = MINIGLIDER.round_budget - spent
        edge = propose_edge(MINIGLIDER, here, (north, east), left, random_shape(MINIGLIDER, rng))
        tries += 1
        if edge is not None and spent + edge.energy <= MINIGLIDER.round_budget:
            edges.append(edge)
            spent, tries = spent + edge.energy, 0
            here = edge.legs[-1].end_ned[:2]
    return as_candidate(MINIGLIDER, edges, 0.0)


def flown(best: Candidate, water: Water, rng: np.random.Generator) -> list[Flown]:
    """Fly a plan ahead, then for good some times."""
    told = problem_of(best, water)
    expected = ensemble.run(
        replace(told, runs=RUNS, seed=int(rng.integers(2**31))), lambda _: None, lambda: False
    )
    course = rng.uniform(0.0, 2.0 * math.pi)
    met = (water.steady_m_s * math.cos(course), water.steady_m_s * math.sin(course))
    fresh = replace(told, current_ne_m_s=met, unknown_current_std_m_s=0.0, runs=1)
    return [compared(expected, replace(fresh, seed=int(rng.integers(2**31)))) for _ in range(FRESH)]


def problem_of(best: Candidate, water: Water) -> DryRunProblem:
    """Return a plan as the station has it flown ahead."""
    start = best.legs[0].start_ned
    settings = MissionSettings.of(MINIGLIDER, TrimConfig(), start, best.duration_s)
    prior = 0.0 if water.knows_calm else MINIGLIDER.position_filter.steady_current_m_s
    return DryRunProblem(
        mission=Mission.from_legs(settings, best.legs),
        planned_points=best.points,
        vehicle=VEHICLES["miniglider"],
        site=TANK,
        start_ne_m=start[:2],
        heading_rad=0.0,
        drift_m_sqrt_s=water.drift_m_sqrt_s,
        unknown_current_std_m_s=prior,
    )


def compared(expected: DryRun, fresh: DryRunProblem) -> Flown:
    """Fly once and return how far that was from the expected track and from the legs."""
    rows = dry_run.fly(fresh, 0, lambda: False).rows
    places, (leg, share) = rows[:, 2:4], comparison.leg_shares(rows)
    legs = fresh.mission.legs
    if expected.expected is None or expected.spread_m is None:
        raise ValueError(expected.message)
    track = expected.expected.reshape(len(legs), -1, 5)
    shares = np.linspace(0.0, 1.0, track.shape[1])
    at, straight = np.empty((len(leg), 2)), np.empty((len(leg), 2))
    for number in np.unique(leg):
        mine = leg == number
        start, end = (
            np.array(point[:2]) for point in (legs[number].start_ned, legs[number].end_ned)
        )
        straight[mine] = start + share[mine, None] * (end - start)
        for k in range(2):
            at[mine, k] = np.interp(share[mine], shares, track[number, :, 1 + k])
    near = [
        off_track_m(expected.expected, legs, int(number), (float(place[0]), float(place[1])))
        for number, place in zip(leg, places, strict=True)
    ]
    return Flown(
        mean_square(places - at),
        float(np.mean(np.square(near))),
        mean_square(places - straight),
        expected.spread_m**2,
    )


def mean_square(off_m: FloatArray) -> float:
    """Return the mean of squared lengths of rows, m2."""
    return float((off_m**2).sum(axis=1).mean())


def rows_of(
    water: Water, plans: list[list[Flown]], rng: np.random.Generator
) -> Iterator[dict[str, Any]]:
    """Return what flights in one water were from, with intervals over plans."""
    for name, bar in (
        ("from_track", water.bar_m),
        ("nearest", None),
        ("from_legs", None),
        ("promised", None),
    ):
        each = np.array([np.mean([getattr(one, name) for one in plan]) for plan in plans])
        again = rng.choice(each, (_RESAMPLED, len(each))).mean(axis=1)
        low, high = np.sqrt(np.quantile(again, (0.025, 0.975)))
        value = math.sqrt(float(each.mean()))
        yield {
            "area": "expected_track",
            "name": f"{water.name}: {_TITLES[name]}",
            "value": round(value, 3),
            "unit": f"m rms, {len(plans)} plans x {FRESH}, 95 % {low:.2f} to {high:.2f}",
            "bar": bar,
            "met": None if bar is None else value <= bar,
        }


_TITLES = {
    "from_track": "fresh flights from the expected track",
    "nearest": "the same, from the nearest point of the leg's track",
    "from_legs": "from the straight legs",
    "promised": "what the rehearsals said of it",
}
