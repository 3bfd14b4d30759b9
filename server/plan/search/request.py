"""What a search for one round of a survey is asked for."""

from dataclasses import dataclass
from typing import Any

from pydantic import TypeAdapter

from autonomy.estimation.config import EstimatorConfig
from autonomy.planner.config import PlannerConfig
from autonomy.planner.plan import Leg
from db.query.mission.plans import PlanRecord
from server.plan.search.survey_round import AHEAD_OF, REPLACES

SETTINGS_FILTER = "settings_filter"
"""Where a plan's document has ``SearchRequest.settings_filter``; plans of an earlier version have
none."""
_WARM = TypeAdapter(tuple[tuple[Leg, ...], ...])


@dataclass(frozen=True, slots=True)
class SearchRequest:
    """One round that is to be searched for."""

    robot: str
    config: PlannerConfig
    config_id: str | None
    """Kept version of the settings; ``None`` where no version has exactly these."""
    by: str
    mission: str | None = None
    round_number: int = 1
    budget: float | None = None
    """Energy units; ``None`` for those of a round."""
    start_xy: tuple[float, float] | None = None
    """Where it begins, north and east, m; ``None`` for where the robot is."""
    warm: tuple[tuple[Leg, ...], ...] = ()
    """Trajectories to begin with."""
    attempt: int = 0
    """How often this was searched for before; each time with other random numbers."""
    ahead_of: str | None = None
    """Plan that the robot flies, at whose end this one begins."""
    replaces: str | None = None
    """Draft whose place it takes once it is one itself."""
    settings_filter: EstimatorConfig | None = None
    """Position filter of the settings, before what the robot said of the current; ``None`` where
    ``config`` has it."""
    current_text: str = ""
    """Where the current comes from that it is planned in; "" where no map was asked for."""
    in_turn: bool = False
    """Whether it waits for other robots of the site that are planned for in turn."""

    @property
    def energy(self) -> float:
        """Energy units that the round may spend."""
        return self.config.round_budget if self.budget is None else self.budget

    def document(self) -> dict[str, Any]:
        """Return what the plan's document says of the request."""
        is_weighed = self.config.objective != "information_gain"
        return {
            "budget": self.energy,
            "attempt": self.attempt,
            "exploitation": self.config.ergodic.exploitation if is_weighed else None,
            AHEAD_OF: self.ahead_of,
            REPLACES: self.replaces,
            SETTINGS_FILTER: (self.settings_filter or self.config.position_filter).model_dump(
                mode="json"
            ),
            "current_text": self.current_text,
            "in_turn": self.in_turn,
            "start_xy": self.start_xy,
            "warm": _WARM.dump_python(self.warm, mode="json"),
        }


def request_of_plan(record: PlanRecord) -> SearchRequest:
    """Return what a plan was asked for, to search for it once more."""
    document = record.document
    start_xy = document.get("start_xy")
    kept = document.get(SETTINGS_FILTER)
    return SearchRequest(
        robot=record.robot,
        config=PlannerConfig.model_validate(record.config),
        config_id=document.get("config_id"),
        by=record.created_by,
        mission=record.mission,
        round_number=record.round,
        budget=document.get("budget"),
        start_xy=None if start_xy is None else (start_xy[0], start_xy[1]),
        warm=_WARM.validate_python(document.get("warm", ())),
        attempt=document.get("attempt", 0),
        ahead_of=document.get(AHEAD_OF),
        replaces=document.get(REPLACES),
        settings_filter=None if kept is None else EstimatorConfig.model_validate(kept),
        current_text=document.get("current_text", ""),
        in_turn=document.get("in_turn", False),
    )


def as_set(record: PlanRecord) -> PlannerConfig:
    """Return a plan's settings without what the robot had said of the current."""
    config = PlannerConfig.model_validate(record.config)
    kept = record.document.get(SETTINGS_FILTER)
    if kept is None:
        return config
    return config.model_copy(update={"position_filter": EstimatorConfig.model_validate(kept)})
