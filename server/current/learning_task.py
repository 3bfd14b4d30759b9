"""Learns strength and size of a current's parts from the dives of a water."""

from collections.abc import Callable

from autonomy.current.config import CurrentMapConfig
from autonomy.current.learning import learn
from server.current.task import CurrentLearning


def run(
    problem: CurrentLearning, report: Callable[[float], None], is_cancelled: Callable[[], bool]
) -> CurrentMapConfig:
    """Return the settings with what was learned."""
    del report, is_cancelled
    return learn(problem.config, problem.observations, problem.latitude_deg)
