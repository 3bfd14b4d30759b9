"""The flight before the flight: a mission flown hundreds of times by compiled code.

Each flight meets another robot, other water and other noise, drawn from the problem's spread. They
fly in threads, for the kernel holds no lock, and as coarsely as the physics allows: a step of the
program in 0.2 s in place of 0.1 s, two Runge-Kutta steps of the body in it, as long as contact
with floor and walls allows, and a filter that carries its covariance by linear steps. Such flights
scatter as exact ones do; a single one is not the same as the exact one. They draw less from the
battery: over drawn missions in the lake some 7 % less where the robot glides, a third less in slow
dives in place, where noise of the readings keeps the actuators moving.
"""

import math
import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import replace
from operator import attrgetter

import numpy as np

from autonomy.current.table import table_of
from autonomy.planner.leg.primitive import dive
from autonomy.planner.preset import MINIGLIDER
from autonomy.site import TANK
from autonomy.vehicle.config import VEHICLES
from autonomy.vehicle.trim import TrimConfig
from onboard.flight.safety import plan_flaw
from robot_link.dry_run import DryRun, DryRunProblem, FailedFlight
from robot_link.mission import Mission, MissionSettings
from simulator.ahead.band import band_of, reason_of
from simulator.ahead.comparison import Flight, compared
from simulator.ahead.draw import drawn_for
from simulator.ahead.flight import FlightCancelledError, FlightPlan, Flown, fly
from simulator.ahead.pack import Grain
from simulator.ahead.safety import safety_of
from simulator.ahead.state import (
    ROW_EAST,
    ROW_LEG,
    ROW_NORTH,
    ROW_SAMPLES,
    ROW_STD,
    ROW_TIME,
)
from simulator.dry_run import DryRunCancelledError, definition_of

GRAINS = {"miniglider": Grain(0.2, 2, 5, 1, 2), "grace3": Grain(0.2, 2, 15, 1, 1)}
"""How finely flights of an ensemble are worked out, by vehicle."""
LEAST_RUNS = 24
"""So many flights are flown however long they take, unless fewer are asked for: the band of nine in
ten leaves out one at either side."""
FAILED_SHARE = 0.1
"""If a larger part of the flights cannot be computed, the others are no fair sample of all: a band
of nine in ten may be wrong by as much as it leaves out."""
_ROWS = 3000
"""Rows of a flight, about."""
_ROW_MAX_S = 20.0
_LOOK_S = 0.1
"""Time between two questions whether to go on."""

LEFT_OUT = (
    "Not rehearsed: the swim to where the plan begins, orders of people (hold, surface), calls by "
    "satellite and samples that wait at the surface, instruments and actuators that fail, and "
    "whatever else is in the water."
)
LEFT_OUT_RULES = " Its rules to come up by measured values or waiting samples are not either."


def run(
    problem: DryRunProblem,
    report: Callable[[float], None],
    is_cancelled: Callable[[], bool],
) -> DryRun:
    """Fly a mission ahead, many times.

    Raises:
        ValueError: If there is no simulated robot of this vehicle.
        DryRunCancelledError: It was stopped.
        TooManyFailedError: More than ``FAILED_SHARE`` of the flights could not be computed.
    """
    flaw = plan_flaw(problem.mission, problem.site, problem.vehicle.limits)
    if flaw:
        return compared(problem, [Flight(reason=flaw)])
    flights, failed = _fly(problem, report, is_cancelled)
    found = compared(problem, [_as_flight(one) for one in flights])
    left_out = LEFT_OUT + (LEFT_OUT_RULES if problem.mission.rules is not None else "")
    return replace(
        found,
        band=band_of(problem, flights),
        safety=safety_of(problem, flights),
        failed=failed,
        not_rehearsed=left_out,
    )


def flown(
    problem: DryRunProblem,
    report: Callable[[float], None],
    is_cancelled: Callable[[], bool],
    grain: Grain | None = None,
) -> list[Flown]:
    """Return the flights of a problem that could be computed, in their order.

    Args:
        problem: What is flown, and how often.
        report: Told the share that is done.
        is_cancelled: Asked now and then whether to stop.
        grain: How finely; None is what fits vehicle and mission.

    Raises:
        ValueError: If there is no simulated robot of this vehicle.
        DryRunCancelledError: It was stopped.
        TooManyFailedError: More than ``FAILED_SHARE`` of the flights could not be computed.
    """
    return _fly(problem, report, is_cancelled, grain)[0]


def _fly(
    problem: DryRunProblem,
    report: Callable[[float], None],
    is_cancelled: Callable[[], bool],
    grain: Grain | None = None,
) -> tuple[list[Flown], tuple[FailedFlight, ...]]:
    plan = plan_of(problem, grain)
    work = _Work(problem, plan)
    threads = min(os.cpu_count() or 1, problem.runs)
    with ThreadPoolExecutor(threads, thread_name_prefix="flight ahead") as pool:
        waiting: set[Future[None]] = {pool.submit(work.fly_all) for _ in range(threads)}
        while waiting:
            done, waiting = wait(waiting, timeout=_LOOK_S, return_when=FIRST_COMPLETED)
            if is_cancelled():
                work.is_over = True
            report(work.share)
            for one in done:
                one.result()
    failed = tuple(sorted(work.failed, key=attrgetter("number")))
    tried = len(work.flights) + len(failed)
    if len(failed) > FAILED_SHARE * tried:
        raise TooManyFailedError(failed, tried)
    if work.is_over:
        raise DryRunCancelledError
    return [work.flights[number] for number in sorted(work.flights)], failed


def plan_of(problem: DryRunProblem, grain: Grain | None = None) -> FlightPlan:
    """Pack what a problem asks for.

    Raises:
        ValueError: If there is no simulated robot of this vehicle.
    """
    definition = definition_of(problem, problem.current_ne_m_s)
    planned_s = sum(leg.duration_s for leg in problem.mission.legs)
    key = definition.vehicle.key
    row_s = min(max(planned_s / _ROWS, 1.0), _ROW_MAX_S)
    flow = None if problem.flow is None else table_of(problem.flow)
    return FlightPlan.of(definition, problem.mission, grain or GRAINS[key], row_s, flow)


def warm_up() -> None:
    """Compile the kernel and what it calls, by a dive in place."""
    site, start = TANK, (1.0, 0.5)
    down = dive(MINIGLIDER, (*start, 0.0), 0.25)
    legs = (down, dive(MINIGLIDER, down.end_ned, 0.0))
    settings = MissionSettings.of(MINIGLIDER, TrimConfig(), (*start, 0.0), 60.0)
    problem = DryRunProblem(
        mission=Mission.from_legs(settings, legs),
        planned_points=np.array([[20.0, *start, 0.25, 0.1], [40.0, *start, 0.0, 0.1]]),
        vehicle=VEHICLES["miniglider"],
        site=site,
        start_ne_m=start,
        heading_rad=0.0,
        drift_m_sqrt_s=0.0,
        runs=2,
    )
    run(problem, lambda _: None, lambda: False)


class TooManyFailedError(Exception):
    """So many flights could not be computed that the others tell too little."""

    def __init__(self, failed: Sequence[FailedFlight], tried: int) -> None:
        first = failed[0]
        super().__init__(
            f"{len(failed)} of {tried} flights could not be computed; flight {first.number} of "
            f"seed {first.seed} failed with {first.reason}"
        )


class _Work:
    """Flights that several threads fly, each the next one that nobody flies."""

    def __init__(self, problem: DryRunProblem, plan: FlightPlan) -> None:
        self._problem, self._plan = problem, plan
        self._until_s = time.process_time() + problem.processor_s
        self._numbers = iter(range(problem.runs))
        self.flights: dict[int, Flown] = {}
        self.failed: list[FailedFlight] = []
        self.is_over = False

    @property
    def share(self) -> float:
        """Part of the flights that is flown; of the time, where that runs out before."""
        runs, flown = self._problem.runs, len(self.flights) + len(self.failed)
        given_s = self._problem.processor_s
        left_s = max(self._until_s - time.process_time(), 0.0)
        of_time = 1.0 if given_s <= 0.0 else 1.0 - min(left_s / given_s, 1.0)
        of_time = of_time if math.isfinite(given_s) else 0.0
        return max(flown / runs, min(of_time, flown / min(LEAST_RUNS, runs)))

    def fly_all(self) -> None:
        """Fly until nothing is left to fly."""
        least = min(LEAST_RUNS, self._problem.runs)
        for number in self._numbers:
            is_late = number >= least and time.process_time() > self._until_s
            if self.is_over or is_late:
                return
            generator = np.random.default_rng([self._problem.seed, number])
            try:
                self.flights[number] = self._fly(generator)
            except FlightCancelledError:
                return
            except Exception as error:  # noqa: BLE001 - whatever it is, other flights may do
                reason = f"{type(error).__name__}: {error}"
                self.failed.append(FailedFlight(number, self._problem.seed, reason))
                if len(self.failed) > FAILED_SHARE * self._problem.runs:
                    self.is_over = True

    def _fly(self, generator: np.random.Generator) -> Flown:
        """Draw what a flight meets, and fly it.

        Raises:
            ArithmeticError: If what came of it is no number.
        """
        drawn = drawn_for(self._problem, self._plan.definition, generator)
        found = fly(self._plan, drawn, generator, lambda: self.is_over)
        if not (np.isfinite(found.rows).all() and math.isfinite(found.battery)):
            raise ArithmeticError("its track is not finite")
        return found


def _as_flight(one: Flown) -> Flight:
    """Return a flight as it is held against its plan."""
    rows = one.rows[one.rows[:, ROW_SAMPLES] > 0.0]
    came_up = np.isfinite(one.surfaced[:, 0])
    return Flight(
        rows=rows[:, (ROW_TIME, ROW_LEG, *range(ROW_NORTH, ROW_STD + 1))],
        places=one.rows[:, (ROW_NORTH, ROW_EAST)],
        surfaced={
            number: (float(place[1]), float(place[2]))
            for number, place in enumerate(one.surfaced)
            if came_up[number]
        },
        duration_s=one.duration_s,
        energy=one.energy,
        reason=reason_of(one),
    )
