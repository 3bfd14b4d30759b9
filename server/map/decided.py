"""Learned kernels and compared models as decisions: what of them counts."""

from dataclasses import asdict

from autonomy.field.learned import LearnedConfig
from server.base.decision.kind import DecisionKind
from server.map.task import (
    COMPARE_MAPS,
    LEARN_FIELD,
    Compared,
    ComparisonProblem,
    LearningProblem,
)


def _learned(result: LearnedConfig) -> object:
    return result.model_dump(mode="json")


def _compared(result: Compared) -> object:
    return asdict(result)


def _seed(problem: LearningProblem) -> tuple[int, ...]:
    return (problem.seed,)


LEARNED_KERNELS = DecisionKind(
    key="kernels",
    title="Kernels of a map",
    task=LEARN_FIELD,
    problem=LearningProblem,
    outcome=_learned,
    map_parts=("field", "samples"),
    seed=_seed,
)
COMPARED_MODELS = DecisionKind(
    key="comparison",
    title="Comparison of map models",
    task=COMPARE_MAPS,
    problem=ComparisonProblem,
    outcome=_compared,
    map_parts=("field", "samples"),
)
