"""Every kind of decision that the station makes and can make once more."""

from typing import Any

from server.base.decision.kind import DecisionKind
from server.plan.search.decided import SURVEY_ROUND

KINDS: tuple[DecisionKind[Any, Any], ...] = (SURVEY_ROUND,)
