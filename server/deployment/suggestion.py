"""Suggests that a deployment begins or ends, by what the robot itself says; a person decides."""

from datetime import datetime, timedelta

from db.query.measured.telemetry import idle_since
from db.store import Store
from robot_link.messages import RobotMode, StateReport
from server.base.lifetime import Background
from server.fleet.event import RobotReported
from server.fleet.fleet import Fleet
from server.fleet.status import DeploymentSuggestion, RobotStatus
from server.fleet.words import clock_time

UNDER_M = 0.5
"""A robot below this is in the water."""
ASHORE_AFTER = timedelta(hours=24)
"""A robot that has been idle at the surface for so long is taken to be ashore."""


def is_at_rest(state: StateReport) -> bool:
    """Tell whether a robot is idle and not under water, as one in the workshop is."""
    return state.mode is RobotMode.IDLE and state.position_ned[2] <= UNDER_M


class Suggestions:
    """Looks at each robot when it reports. Belongs to one event loop."""

    def __init__(self, store: Store, fleet: Fleet, background: Background) -> None:
        self._store = store
        self._fleet = fleet
        self._background = background
        self._at_rest: dict[str, datetime] = {}
        """Since when robots in the water have been idle at the surface."""
        self._asked: set[str] = set()
        """Robots of which the database was asked since when they rest."""
        self._declined: set[str] = set()
        """Robots of which a person said "not now", until they are at rest, or active, again."""

    def look(self, reported: RobotReported) -> None:
        """Suggest something of a robot, or nothing any more."""
        status = self._fleet.status(reported.robot)
        state = status.state
        if state is None or status.record.kind == "recorded" or status.is_retired:
            self._fleet.set_suggestion(reported.robot, None)
        elif status.deployment is None:
            self._at_rest.pop(reported.robot, None)
            self._look_at_begin(status, state)
        else:
            self._look_at_end(status, state, status.deployment.begun_at)

    def decline(self, robot: str) -> None:
        """Take a suggestion back until the robot does something else."""
        self._declined.add(robot)
        self._fleet.set_suggestion(robot, None)

    def _look_at_begin(self, status: RobotStatus, state: StateReport) -> None:
        robot = status.record.id
        if is_at_rest(state):
            self._declined.discard(robot)
            if status.suggestion is not None and status.suggestion.kind == "end":
                self._fleet.set_suggestion(robot, None)
            return
        known = status.suggestion is not None and status.suggestion.kind == "begin"
        if known or robot in self._declined or state.measured_at <= status.ashore_since:
            return
        depth_m = state.position_ned[2]
        what = f"is {depth_m:.1f} m deep" if depth_m > UNDER_M else "is no longer idle"
        text = f"{robot} {what} since {clock_time(state.measured_at)}. Does its deployment begin?"
        self._fleet.set_suggestion(robot, DeploymentSuggestion("begin", state.measured_at, text))

    def _look_at_end(self, status: RobotStatus, state: StateReport, begun_at: datetime) -> None:
        robot = status.record.id
        if not is_at_rest(state):
            self._at_rest.pop(robot, None)
            self._declined.discard(robot)
            self._fleet.set_suggestion(robot, None)
            return
        since = max(begun_at, self._at_rest.setdefault(robot, state.measured_at))
        if robot not in self._asked:
            self._asked.add(robot)
            self._background.start(f"rest of {robot}", self._recall(robot, state))
        if robot in self._declined or self._fleet.age_s(since) < ASHORE_AFTER.total_seconds():
            if status.suggestion is not None and status.suggestion.kind == "begin":
                self._fleet.set_suggestion(robot, None)
            return
        if status.suggestion is None or status.suggestion.kind != "end":
            text = (
                f"{robot} has been idle at the surface since {since:%Y-%m-%d} "
                f"{clock_time(since)}. Has its deployment ended?"
            )
            self._fleet.set_suggestion(robot, DeploymentSuggestion("end", since, text))

    async def _recall(self, robot: str, state: StateReport) -> None:
        """Take up since when a robot rests from what is stored; the station may have restarted."""
        since = await self._store.query(
            lambda session: idle_since(session, robot, state.measured_at - ASHORE_AFTER, UNDER_M)
        )
        known = self._at_rest.get(robot)
        if since is not None and known is not None and since < known:
            self._at_rest[robot] = since
            self.look(RobotReported(robot))
