"""Learns the kernels of a field model from all samples of its map."""

from collections.abc import Callable

import numpy as np

from autonomy.field.learned import LearnedConfig
from autonomy.field.learning.model import learn_config
from server.map.task import LearningProblem


def run(
    problem: LearningProblem,
    report: Callable[[tuple[float, str]], None],
    is_cancelled: Callable[[], bool],
) -> LearnedConfig:
    """Return the settings with what was learned, and by how much they are more likely."""
    return learn_config(
        problem.field,
        problem.samples,
        starts=problem.field.learning.starts,
        rng=np.random.default_rng(problem.seed),
        report=lambda share, message: report((share, message)),
        is_cancelled=is_cancelled,
    )
