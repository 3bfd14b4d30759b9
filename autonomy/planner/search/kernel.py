"""Compiles the planner ahead of time."""

import itertools
from typing import Literal, TypeAlias

import numpy as np

from autonomy.planner.belief import FieldBelief
from autonomy.planner.config import PlannerConfig, SearchConfig
from autonomy.planner.plan import Leg
from autonomy.planner.search.search import plan

Objective: TypeAlias = Literal["information_gain", "ergodic", "weighted"]
OBJECTIVES: tuple[Objective, ...] = ("information_gain", "ergodic", "weighted")
_ITERATIONS = 20


def warm_up(*objectives: Objective) -> None:
    """Plan a little with objectives, all if none is named, so that this process has their code.

    The first time takes a minute for each; later processes load the machine code in about a second.
    """
    points = np.array(list(itertools.product((0.0, 1.4, 2.7), (0.0, 1.3), (0.0, 0.6))))  # (12, 3)
    belief = FieldBelief(
        signal_variance=1.0,
        length_scales_m=(1.0, 1.0, 1.0),
        noise_variance=0.01,
        sample_points=points[:2],
        test_points=points,
        mean=np.zeros(len(points)),
        std=np.ones(len(points)),
    )
    for objective in objectives or OBJECTIVES:
        config = PlannerConfig(objective=objective, search=SearchConfig(iterations_max=_ITERATIONS))
        warm: tuple[tuple[Leg, ...], ...] = ()
        for _ in range(2):
            result = plan(
                config,
                belief,
                (0.5, 0.5),
                rng=np.random.default_rng(0),
                budget=8.0,
                on_progress=lambda _: None,
                is_cancelled=lambda: False,
                elapsed_s=lambda: 0.0,
                warm=warm,
            )
            warm = (result.best.legs,) if result.best else ()
