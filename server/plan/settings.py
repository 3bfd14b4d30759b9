"""What a plan may be asked for: the planner's settings of a robot, and where it would begin."""

import math
from collections.abc import Mapping
from typing import Any

from autonomy.estimation.config import FASTEST_CURRENT_M_S, MOST_DOUBT
from autonomy.estimation.known_current import UNTOLD
from autonomy.planner.approach import approach_energy, way_in
from autonomy.planner.config import PlannerConfig
from autonomy.planner.outcome import least_energy
from autonomy.site import Box
from db.query.fleet.onboard import list_parameters
from db.store import Store
from server.base.foundation import Foundation
from server.base.problem import FieldError, Problem, conflict, unprocessable
from server.fleet.capability import refuse_unless_able
from server.fleet.current_words import metres
from server.fleet.dependency import refuse_recording
from server.fleet.fleet import Fleet
from server.fleet.status import RobotStatus

FIX_DEPTH = "FIX_DEPTH_M"
"""The robot's parameter: deeper than this it takes no fix."""
_DECIMALS = 4
"""Of what a robot said of the current: it is not known better, and two plans of a moment agree."""


async def with_told_fix_depth(
    store: Store, robot: str, config: PlannerConfig
) -> tuple[PlannerConfig, str]:
    """Return settings that count on fixes as deep as the robot said that it takes them.

    Beside them a sentence where that is another depth than the settings say, "" where it is not, or
    where the parameter was never read.
    """
    parameters = await store.query(lambda session: list_parameters(session, robot))
    told_m = next(
        (round(one.value, _DECIMALS) for one in parameters if one.name == FIX_DEPTH), None
    )
    position = config.position_filter
    if told_m is None or told_m == position.surface_depth_m:
        return config, ""
    known = type(position).model_validate(position.model_dump() | {"surface_depth_m": told_m})
    text = (
        f"Fixes count to a depth of {told_m:g} m, as {robot} said by {FIX_DEPTH};"
        f" the settings say {position.surface_depth_m:g} m."
    )
    return config.model_copy(update={"position_filter": known}), text


class PlanSettings:
    """Settings that plans are made with, and what can be refused before anything is searched."""

    def __init__(self, foundation: Foundation, fleet: Fleet) -> None:
        self._foundation = foundation
        self._fleet = fleet

    async def configure(
        self, robot: str, patch: Mapping[str, Any], *, by: str
    ) -> tuple[str, PlannerConfig]:
        """Return the planner's settings for a robot with a patch on top, as a kept version.

        Settings that differ from the version that holds become the new one: a plan cites them.

        Raises:
            Problem: 404 for an unknown robot, 409 for one that flies no plans, 422 with the path
                of each wrong field below ``config``, 503 while storage fails.
        """
        config = await self.merged(robot, patch)
        book = self._foundation.configurations
        holds = await book.current("planner", robot)
        if holds.id is None or config != holds.value:
            holds = await book.patch("planner", robot, patch, by=by)
        if holds.id is None:
            raise TypeError("a kept version has an id")
        return holds.id, config

    def known_current(self, robot: str, config: PlannerConfig) -> PlannerConfig:
        """Return settings that reckon with the current as well as the robot says that it knows it.

        What it said grows old towards the settings' own. A robot that never told is taken for one
        that was just switched on.
        """
        report, position = self._fleet.status(robot).current_report, config.position_filter
        usual_m_s, doubt = position.usual_current_m_s, position.doubt
        if report is None:
            std_m_s = UNTOLD * usual_m_s if position.method == "model" else usual_m_s
        else:
            age_s = max(0.0, self._fleet.age_s(report.measured_at))
            std_m_s = report.current_std_m_s / max(report.doubt, 1.0)
            std_m_s = position.current_std_after(std_m_s, age_s)
            doubt = min(max(doubt, report.doubt), MOST_DOUBT)
        change = {
            "steady_current_m_s": round(min(std_m_s, FASTEST_CURRENT_M_S), _DECIMALS),
            "untold_current_m_s": usual_m_s,
            "doubt": round(doubt, _DECIMALS),
        }
        known = type(position).model_validate(position.model_dump() | change)
        return config.model_copy(update={"position_filter": known})

    async def merged(self, robot: str, patch: Mapping[str, Any]) -> PlannerConfig:
        """Return the planner's settings for a robot with a patch on top; nothing is kept.

        Raises:
            Problem: As of ``configure``.
        """
        status = self._fleet.status(robot)
        refuse_recording(status, "flies no plans")
        refuse_unless_able(status, "adaptive_survey")
        self.refuse_while_storage_fails()
        try:
            wanted = await self._foundation.configurations.merged("planner", robot, patch)
        except Problem as problem:
            raise below_config(problem) from problem
        config = wanted.value_as(PlannerConfig)
        _check_domain(config.domain, status)
        _check_budget(config)
        return config

    def check_start(self, robot: str, config: PlannerConfig) -> tuple[float, float]:
        """Return where a plan would begin: the robot's place at the surface.

        Raises:
            Problem: 409 if the position is not known, or the swim to the domain is too long; 422
                if the robot is inside a keep-out.
        """
        start_xy = self.position(robot)[:2]
        for number, area in enumerate(config.keep_outs):
            if area.contains(*start_xy):
                message = f"{robot} is inside the keep-out {area.name}; bring it out first"
                loc: list[str | int] = ["config", "keep_outs", number]
                raise unprocessable(f"{message}.", [FieldError(loc=loc, msg=message)])
        way = way_in(config, start_xy, self._fleet.status(robot).record.site)
        if way.refusal:
            raise conflict(f"{robot} cannot be planned for: {way.refusal}")
        longest = config.mission.approach_share * config.round_budget
        if approach_energy(config, way.legs) > longest:
            away_m = math.dist(start_xy, way.end_xy)
            raise conflict(
                f"{robot} is outside the domain or too near its edge: the nearest place that can "
                f"be planned from is {metres(away_m)} away; "
                "bring it there, or choose a domain that it is in."
            )
        return start_xy

    def least_energy(self, robot: str, config: PlannerConfig) -> float:
        """Return the least energy of a further round: back into the domain, and one primitive."""
        site = self._fleet.status(robot).record.site
        way = way_in(config, self.position(robot)[:2], site)
        return least_energy(config) + approach_energy(config, way.legs)

    def position(self, robot: str) -> tuple[float, float, float]:
        """Return where a robot said that it is, NED, m.

        Raises:
            Problem: 409 if it has said nothing yet.
        """
        state = self._fleet.status(robot).state
        if state is None:
            raise conflict(
                f"{robot} has not said where it is yet; plan when its first report has come."
            )
        return state.position_ned

    def refuse_while_storage_fails(self) -> None:
        """Refuse new plans while nothing can be kept.

        Raises:
            Problem: 503.
        """
        fault = self._foundation.store.fault
        if fault is not None:
            raise Problem(
                503,
                f"{fault} The station accepts no plans until its storage works again.",
                headers={"Retry-After": "5"},
            )


def _check_domain(domain: Box, status: RobotStatus) -> None:
    site = status.record.site
    if domain.is_inside(site.water):
        return
    water = site.water
    message = (
        f"the domain leaves the water of {site.name} ({water.x_min_m:g} to {water.x_max_m:g} m "
        f"north, {water.y_min_m:g} to {water.y_max_m:g} m east, {site.kind} floor "
        f"{water.depth_max_m:g} m)"
    )
    raise unprocessable("1 field is wrong.", [FieldError(loc=["config", "domain"], msg=message)])


def _check_budget(config: PlannerConfig) -> None:
    least = least_energy(config)
    if config.round_budget >= least:
        return
    message = f"the cheapest way from one surfacing to another takes {least:.3g} energy units"
    loc: list[str | int] = ["config", "round_budget"]
    raise unprocessable("1 field is wrong.", [FieldError(loc=loc, msg=message)])


def below_config(problem: Problem) -> Problem:
    """Return a refusal of settings with paths from the top of the request."""
    if problem.errors is None:
        return problem
    errors = [FieldError(loc=["config", *error.loc], msg=error.msg) for error in problem.errors]
    return Problem(problem.status, problem.detail, errors=errors, headers=problem.headers)
