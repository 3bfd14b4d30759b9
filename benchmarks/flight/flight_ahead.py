"""The flight before the flight: how fast, how near to the readable program, how well calibrated.

Missions are drawn when this runs (``benchmarks.drawn.mission``), and so is what each flight meets.
For the calibration the "real" robot is the readable program on a simulated robot whose vehicle,
current, drift, ballast, noise and battery are drawn from the spread that the ensemble knows; of one
mission in five the current is told wrong, by as much again as it is unknown, and the ensemble is
told that such things happen by the doubled spread of the current.

Some flights are chaotic: the readable program parts from itself once the current is
another by far less than anybody knows. Each is flown with such twins, and the kernel is judged
for as long as the readable program keeps to them (``benchmarks.drawn.twin``).
"""

import os
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.planner.plan import Leg
from autonomy.planner.preset import PLANNER_PRESETS
from benchmarks.drawn.mission import mission_of
from benchmarks.drawn.twin import calm_rows
from robot_link.dry_run import DryRunProblem
from server.plan.primitive_legs import candidate_of
from simulator.ahead import ensemble, flight, readable
from simulator.ahead.draw import drawn_for
from simulator.ahead.pack import EXACT
from simulator.ahead.state import ROW_BATTERY, ROW_BELIEVED_NORTH, ROW_NORTH, ROW_TIME
from simulator.fleet import GRACE_1, MINI_1

AREA = "flight_ahead"
ROBOTS = {"tank": MINI_1, "lake": GRACE_1}
PAIRS = int(os.environ.get("FLIGHT_AHEAD_PAIRS", "50"))
"""Seeds of the comparison with the readable program, half of them in each water."""
REAL = int(os.environ.get("FLIGHT_AHEAD_REAL", "100"))
"""Real flights of the calibration, ten of each mission."""
EACH = 10
_DURATIONS_S = {"tank": 240.0, "lake": 1200.0}
_BARS = {"tank": 0.05, "lake": 0.01}
"""Most that a flight may be off, m, and as a part of the leg."""
_SHARES = np.linspace(0.1, 1.0, 10)


@dataclass(frozen=True)
class Compared:
    """How near a compiled flight was to the readable one, m, or as a part of the leg."""

    water: str
    has_same_modes: bool
    worst: float
    judged: float
    """Part of the flight for which the readable program keeps to its twins."""


def measure() -> list[dict[str, Any]]:
    """Measure speed, agreement and calibration; takes about half an hour of two cores."""
    seeds = np.random.SeedSequence()
    print(f"{AREA}: seed {seeds.entropy}", flush=True)
    rows = [*speeds(seeds.spawn(1)[0])]
    with ProcessPoolExecutor(2) as pool:
        rows += agreement(list(pool.map(compared, *pair_arguments(seeds))))
        rows += calibration(list(pool.map(judged, *real_arguments(seeds))))
    return rows


def problem_of(generator: np.random.Generator, water: str, duration_s: float) -> DryRunProblem:
    """Return a drawn mission with what the station would tell of it.

    Of three robots one was just switched on, one has told what it knows of the current, and one
    doubts itself besides.
    """
    definition = ROBOTS[water]
    config = PLANNER_PRESETS[definition.vehicle.key]
    mission = mission_of(generator, config, duration_s, 2.0 * config.max_uncertainty_m)
    start = mission.settings.start_x_m, mission.settings.start_y_m
    # what is left unknown once a dive or a stay has told of it
    unknown_m_s = 0.4 * definition.estimator.steady_current_m_s
    known = int(generator.integers(3))
    return DryRunProblem(
        mission=mission,
        planned_points=candidate_of(config, mission.legs).points,
        vehicle=definition.vehicle,
        site=definition.site,
        start_ne_m=start,
        heading_rad=float(generator.uniform(-np.pi, np.pi)),
        drift_m_sqrt_s=definition.drift_m_sqrt_s,
        unknown_current_std_m_s=unknown_m_s,
        known_current_std_m_s=unknown_m_s if known else None,
        doubt=float(generator.uniform(1.2, 3.0)) if known == 2 else 1.0,
        seed=int(generator.integers(2**31)),
    )


def speeds(seeds: np.random.SeedSequence) -> Iterator[dict[str, Any]]:
    """Fly 200 flights of a short and of a long mission, after everything is compiled."""
    ensemble.warm_up()
    generator = np.random.default_rng(seeds)
    for water, duration_s, bar_s in (("tank", 1800.0, 10.0), ("lake", 86_400.0, 120.0)):
        asked = replace(problem_of(generator, water, duration_s), runs=200)
        began_s, used_s = time.perf_counter(), time.process_time()
        found = ensemble.run(asked, lambda _: None, lambda: False)
        wall_s, used_s = time.perf_counter() - began_s, time.process_time() - used_s
        rate = found.duration_s * found.runs / used_s
        yield {
            "area": AREA,
            "name": f"200 flights of {duration_s / 3600.0:g} h in the {water}",
            "value": round(wall_s, 1),
            "unit": f"s wall; {used_s:.0f} s of processor, {rate:.0f} s flown in one",
            "bar": bar_s,
            "met": wall_s <= bar_s,
        }


def pair_arguments(seeds: np.random.SeedSequence) -> tuple[list[int], list[str]]:
    drawn = [int(one) for one in seeds.generate_state(PAIRS)]
    return drawn, ["tank" if number % 2 else "lake" for number in range(PAIRS)]


def compared(seed: int, water: str) -> Compared:
    """Fly one drawn mission by the readable program and by the kernel, with the same noise."""
    generator = np.random.default_rng(seed)
    asked = problem_of(generator, water, _DURATIONS_S[water])
    plan = ensemble.plan_of(asked, EXACT)
    plan = replace(plan, row_s=0.1)
    drawn = drawn_for(asked, plan.definition, generator)
    truth = readable.fly_readable(plan.definition, asked.mission, drawn, seed)
    if truth is None:
        raise ValueError("it was cancelled")
    count = calm_rows(plan.definition, asked.mission, drawn, seed, truth)
    until_s = truth.rows[count - 1, ROW_TIME]
    mine = flight.fly_with(plan, drawn, truth.noise.first, truth.noise.steps)
    modes = [one[1:] for one in truth.changes if one[0] <= until_s]
    has_same = [tuple(one[1:]) for one in mine.changes[: len(modes)].tolist()] == modes
    worst = apart(water, asked.mission.legs, mine.rows[:count], truth.rows[:count])
    return Compared(water, has_same, worst, count / len(truth.rows))


def apart(water: str, legs: Sequence[Leg], rows: FloatArray, others: FloatArray) -> float:
    """Return how far two flights are apart at most, m, in the lake as a part of the leg."""
    if len(rows) != len(others):
        return float("inf")
    off_m = np.zeros(len(rows))
    for first in (ROW_NORTH, ROW_BELIEVED_NORTH):
        between = (rows - others)[:, first : first + 3]
        off_m = np.maximum(off_m, np.linalg.norm(between, axis=1))
    if water == "tank":
        return float(off_m.max())
    length_m = np.array(
        [np.linalg.norm(np.subtract(one.end_ned, one.start_ned)) for one in (*legs, legs[-1])]
    )
    leg = others[:, 1].astype(int)
    return float((off_m / np.maximum(length_m[leg], 1.0)).max())


def agreement(found: list[Compared]) -> Iterator[dict[str, Any]]:
    same = sum(one.has_same_modes for one in found)
    judged_percent = 100.0 * float(np.mean([one.judged for one in found]))
    yield row("same modes and legs as the readable program", same,
              f"of {len(found)} flights, in the {judged_percent:.0f} % that are not chaotic",
              len(found), same == len(found))  # fmt: skip
    for water, unit in (("tank", "m"), ("lake", "of the leg")):
        mine, bar = [one for one in found if one.water == water], _BARS[water]
        worst = max(one.worst for one in mine)
        calm = sum(one.judged == 1.0 for one in mine)
        text = f"{unit}, worst of {len(mine)} flights, same noise; {calm} of them not chaotic"
        yield row(f"from the readable program, {water}", worst, text, bar, worst <= bar)


def row(name: str, value: float, unit: str, bar: float, met: bool) -> dict[str, Any]:
    return {"area": AREA, "name": name, "value": value, "unit": unit, "bar": bar, "met": met}


def real_arguments(seeds: np.random.SeedSequence) -> tuple[list[int], list[str], list[bool]]:
    count = REAL // EACH
    drawn = [int(one) for one in seeds.generate_state(PAIRS + count)[PAIRS:]]
    return (
        drawn,
        ["tank" if number % 2 else "lake" for number in range(count)],
        [number % 5 == 0 for number in range(count)],
    )


def judged(seed: int, water: str, is_told_wrong: bool) -> tuple[list[float], list[float]]:
    """Return how often the band of one mission held places and battery ends of real flights.

    Places are those at shares of the flights' own legs; each flight counts with the part of its
    places that lie within the ellipse and the depths.
    """
    generator = np.random.default_rng(seed)
    asked = problem_of(generator, water, _DURATIONS_S[water])
    told, off_ne_m_s = asked, np.zeros(2)
    if is_told_wrong:
        off_ne_m_s = asked.unknown_current_std_m_s * generator.standard_normal(2)
        asked = replace(asked, unknown_current_std_m_s=2.0**0.5 * asked.unknown_current_std_m_s)
    found = ensemble.run(replace(asked, runs=200), lambda _: None, lambda: False)
    band = found.band
    if band is None:
        raise ValueError(found.message)
    definition = ensemble.plan_of(asked).definition
    places: list[float] = []
    batteries: list[float] = []
    for _ in range(EACH):
        drawn = drawn_for(told, definition, generator)
        north, east = (drawn.current_ne_m_s + off_ne_m_s).tolist()
        drawn = replace(drawn, current_ne_m_s=(north, east))
        real = readable.fly_readable(
            definition, asked.mission, drawn, int(generator.integers(2**31))
        )
        if real is None or len(real.rows) == 0:
            raise ValueError("a real flight did not begin")
        places.append(held_share(band.over_time, real.rows))
        low, _, high = band.battery_end
        batteries.append(float(low <= real.rows[-1, ROW_BATTERY] <= high))
    return places, batteries


def held_share(over_time: FloatArray, rows: FloatArray) -> float:
    """Return the part of a flight's coordinates along time that lie within the band's ranges."""
    ends_s = rows[-1, ROW_TIME]
    at_s = _SHARES * ends_s
    held: list[bool] = []
    for k in range(3):
        value = np.interp(at_s, rows[:, ROW_TIME], rows[:, ROW_NORTH + k])
        low, high = (np.interp(at_s, over_time[:, 0], over_time[:, 1 + 3 * k + i]) for i in (0, 2))
        held += ((low - 1e-6 <= value) & (value <= high + 1e-6)).tolist()
    return float(np.mean(held))


def calibration(found: list[tuple[list[float], list[float]]]) -> Iterator[dict[str, Any]]:
    for part, name in enumerate(("positions", "battery ends")):
        shares = np.concatenate([one[part] for one in found])
        missions = np.array([np.mean(one[part]) for one in found])
        std = float(missions.std(ddof=1) / np.sqrt(len(missions))) if len(missions) > 1 else 0.0
        value = float(shares.mean())
        yield {
            "area": AREA,
            "name": f"{name} of real flights within the 90 % band",
            "value": round(value, 3),
            "unit": f"of {len(shares)} flights, +- {std:.3f} over missions",
            "bar": "0.85 to 0.95",
            "met": 0.85 <= value <= 0.95,
        }
