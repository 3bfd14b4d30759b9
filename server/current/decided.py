"""What was learned of a water's current as a decision."""

from autonomy.current.config import CurrentMapConfig
from server.base.decision.kind import DecisionKind
from server.current.task import LEARN_CURRENT, CurrentLearning


def _learned(result: CurrentMapConfig) -> object:
    return result.model_dump(mode="json")


LEARNED_CURRENT = DecisionKind(
    key="current",
    title="Strength and size of a current",
    task=LEARN_CURRENT,
    problem=CurrentLearning,
    outcome=_learned,
    map_parts=("config", "observations"),
)
