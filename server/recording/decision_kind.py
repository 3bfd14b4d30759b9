"""Every kind of decision that the station makes and can make once more."""

from typing import Any

from server.base.decision.kind import DecisionKind
from server.current.decided import LEARNED_CURRENT
from server.map.decided import COMPARED_MODELS, LEARNED_KERNELS
from server.plan.search.decided import MAP_UNCERTAINTY, SURVEY_ROUND
from server.schedule.replan.decided import SUGGESTION

KINDS: tuple[DecisionKind[Any, Any], ...] = (
    SURVEY_ROUND,
    MAP_UNCERTAINTY,
    SUGGESTION,
    LEARNED_KERNELS,
    COMPARED_MODELS,
    LEARNED_CURRENT,
)
