"""What plans know of the current: a table of the map to plan in, and what it says of surfacings."""

import asyncio
from dataclasses import dataclass
from typing import Any

import numpy as np

from autonomy.current.model import CurrentMap, tabulate
from autonomy.estimation.prediction import ellipse_90
from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg import drift, primitive
from autonomy.planner.plan import Leg, PrimitiveKind
from server.base.foundation import Foundation
from server.current.currents import Currents
from server.current.words import tellers
from server.plan.settings import with_told_fix_depth

_LONGER = 1.5
"""A table goes on for so many times the expected duration of its round."""
_TRACK_POINTS = 7
"""Points of a leg by which its integral of the current is taken."""


@dataclass(frozen=True, slots=True)
class PlannedCurrent:
    """The current that a plan is made in and how deep fixes count, and what to tell of both."""

    config: PlannerConfig
    text: str
    """Where they come from, where that is not the settings alone; else ""."""


class PlanFlows:
    """Gives plans what the map of a current knows. Belongs to one event loop."""

    def __init__(self, foundation: Foundation) -> None:
        self._clock = foundation.clock
        self._currents = foundation.services.get(Currents)
        self._store = foundation.store

    async def planned(self, robot: str, config: PlannerConfig, ahead_s: float) -> PlannedCurrent:
        """Return settings with the current that holds for a plan which begins in so long a time.

        They count on fixes as deep as the robot said that it takes them.
        """
        config, of_fixes = await with_told_fix_depth(self._store, robot, config)
        planned = await self._in_current(robot, config, ahead_s)
        return PlannedCurrent(planned.config, " ".join(filter(None, (planned.text, of_fixes))))

    async def _in_current(
        self, robot: str, config: PlannerConfig, ahead_s: float
    ) -> PlannedCurrent:
        current = config.current
        if current.source != "map":
            return PlannedCurrent(_with_flow(config, None), "")
        known = self._currents.usable(robot)
        if known is None:
            found = self._currents.of(robot)
            dives = 0 if found is None else len(found.dives)
            text = (
                f"The map of the current tells too little for a plan ({dives} dives, or too long "
                "ago): the typed current was used."
            )
            return PlannedCurrent(_with_flow(config, None), text)
        from_s = self._clock.now().timestamp() + ahead_s
        until_s = from_s + _LONGER * round_duration_s(config)
        flow = await asyncio.to_thread(tabulate, known, config.domain, from_s, until_s)
        text = f"Planned in the current that {tellers(self._currents.of(robot), flow)} of."
        return PlannedCurrent(_with_flow(config, flow.model_dump()), text)

    async def surfacings(
        self, robot: str, config: PlannerConfig, legs: tuple[Leg, ...]
    ) -> list[dict[str, Any]]:
        """Return where each dive of a plan made in the map's current will come up, how surely.

        Nothing for a plan that was made in another current, whose dives are not aimed off for the
        map's, nor where the map tells too little by now.
        """
        known, flow = self._currents.usable(robot), config.current.flow
        if known is None or flow is None:
            return []
        return await asyncio.to_thread(surfacings_of, known, config, legs, flow.from_s)


def round_duration_s(config: PlannerConfig) -> float:
    """Return about how long a round takes that spends its budget on dives to the floor."""
    motion = config.primitives
    glide_s = config.domain.depth_max_m / motion.glide_speed_m_s
    dive_s = 2.0 * glide_s + config.mission.turn_time_s
    glide = primitive.energy(PrimitiveKind.GLIDE, glide_s, config.energy)
    dives = max(config.round_budget / (2.0 * glide + config.surfacing_energy), 1.0)
    duration_s = dives * dive_s
    return min(duration_s, config.time_budget_s) if config.time_budget_s > 0.0 else duration_s


def surfacings_of(
    known: CurrentMap, config: PlannerConfig, legs: tuple[Leg, ...], from_s: float
) -> list[dict[str, Any]]:
    """Return, for each dive of a plan, its drift and the ellipse that holds its surfacing."""
    courses = drift.courses(config, legs)
    position = config.position_filter
    found: list[dict[str, Any]] = []
    times: list[float] = []
    track: list[tuple[float, float, float]] = []
    for number, (leg, course) in enumerate(zip(legs, courses, strict=True)):
        if drift.knows_place(leg):
            times, track = [], []
            continue
        for share in np.linspace(0.0, 1.0, _TRACK_POINTS)[1 if track else 0 :].tolist():
            times.append(from_s + course.begin.time_s + share * leg.duration_s)
            track.append(primitive.position_at(leg, share))
        if leg.end_ned[2] > 0.0:
            continue
        duration_s = times[-1] - times[0]
        walk = known.walk_variance_m2(position.drift_m_sqrt_s, duration_s) + position.fix_std_m**2
        said = known.displacement(np.array(times), np.array(track), walk)
        end = drift.position_at(leg, course, 1.0)
        axes, direction_rad = ellipse_90(said.cov_m2)
        north, east = said.mean_ne_m.tolist()
        found.append(
            {
                "leg": number,
                "north_m": end[0],
                "east_m": end[1],
                "drift_ne_m": [north, east],
                "ellipse_m": list(axes),
                "ellipse_rad": direction_rad,
            }
        )
        times, track = [], []
    return found


def _with_flow(config: PlannerConfig, flow: dict[str, Any] | None) -> PlannerConfig:
    if flow is None and config.current.flow is None:
        return config
    current = type(config.current).model_validate(config.current.model_dump() | {"flow": flow})
    return config.model_copy(update={"current": current})
