"""A mission, its rounds and its score."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from server.base.view import SettingsDocument, View, one_of
from server.map.view import ScoresView
from server.plan.view import PlanState

MissionState = Annotated[
    str,
    one_of(
        "planning", "ready", "running", "replanning", "scoring", "done", "failed", "stopped"
    ),
]  # fmt: skip


@dataclass(frozen=True, slots=True)
class RoundView(View):
    """One round of an adaptive survey."""

    round: int
    plan_id: str
    state: PlanState
    energy: float
    """Spent as the robot reports it; planned while the round has not begun."""
    objective: float | None


@dataclass(frozen=True, slots=True)
class BudgetView(View):
    """Energy units of the mission."""

    total: float
    spent: float
    """As the robot reported it."""
    round: float
    """Most that one round may spend."""
    remaining: float
    """What is left of the total."""
    round_time_s: float | None
    """Longest that one round may take; ``null`` for no limit."""
    round_satellite_bytes: int | None
    """Most that one round may say by satellite; ``null`` for no limit."""
    planned_s: float
    """Time of the rounds that were begun, by their plans."""
    satellite_bytes: int
    """What the rounds that were begun say by satellite, by their plans."""


@dataclass(frozen=True, slots=True)
class MissionView(View):
    """A mission and where it stands."""

    id: str
    robot: str
    kind: Annotated[str, one_of("adaptive_survey")]
    state: MissionState
    """``planning``, ``ready``, ``running``, ``replanning``, ``scoring``, ``done``, ``failed`` or
    ``stopped``."""
    automation: bool
    """Whether the station uploads and starts further rounds by itself."""
    config: SettingsDocument
    config_id: str | None
    rounds: list[RoundView]
    budget: BudgetView
    plan_id: str | None
    """Plan of the newest round."""
    scores: list[ScoresView] | None
    map_std: float | None
    """Mean standard deviation of the map over the domain, in the model's scale, after the newest
    round that was flown."""
    target_std: float
    """The survey ends when ``map_std`` is at or below this; 0 for never."""
    exploitation: float
    """Weight of the map's mean against its standard deviation that is in force now."""
    ahead: str | None
    """Plan of the next round, made while the robot still flies."""
    fleet: list[str]
    """Missions that were asked for together with this one, itself included."""
    message: str
    created_at: datetime


@dataclass(frozen=True, slots=True)
class LiveMissionView(View):
    """What changes of a mission while people watch."""

    state: MissionState
    automation: bool
    budget: BudgetView
    plan_id: str | None
    map_std: float | None
    ahead: str | None
    message: str
