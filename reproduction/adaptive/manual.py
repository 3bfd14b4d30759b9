"""A survey led by hand, and the kernels of every model that follow from it."""

import numpy as np

from autonomy.field.config import FieldConfig
from autonomy.field.learning.model import learn_config
from autonomy.field.samples import FieldSamples, joined
from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg.edge import propose_edge, random_shape
from reproduction.adaptive.point_robot import PointRobot
from reproduction.adaptive.scenario import START_NE_M, THRESHOLDS_M, TRUE_KERNEL, VARIABLE
from reproduction.adaptive.survey import Survey, inside, measured

MANUAL_SAMPLES = 500
"""Samples that a manual survey takes at least."""
_RARE_VARIANCE = 0.05
"""Signal variance of a level that the manual survey tells nothing of."""


def manual_survey(
    planner: PlannerConfig, drift_m_sqrt_s: float, rng: np.random.Generator
) -> Survey:
    """Lead the point robot along random trajectories from surfacing to surfacing.

    Args:
        planner: Domain and primitives.
        drift_m_sqrt_s: True drift.
        rng: Draws trajectories, errors and noise.
    """
    robot = PointRobot(planner.position_filter, drift_m_sqrt_s, START_NE_M, rng)
    flights = [robot.stay()]
    samples = measured(VARIABLE, flights[0], rng)
    domain = planner.domain
    low, high = (domain.x_min_m, domain.y_min_m), (domain.x_max_m, domain.y_max_m)
    while len(samples) < MANUAL_SAMPLES:
        north, east = rng.uniform(low, high).tolist()
        start = inside(robot.believed_ne_m, planner)
        edge = propose_edge(
            planner, start, (north, east), planner.round_budget, random_shape(planner, rng)
        )
        if edge is not None:
            flights.append(robot.fly(edge.points, start))
            samples = joined(samples, measured(VARIABLE, flights[-1], rng))
    return Survey.of(flights, samples)


def learned_models(samples: FieldSamples, rng: np.random.Generator) -> FieldConfig:
    """Return every model's kernels, those with levels learned from the samples of a manual survey.

    As in the thesis, the single model is given the kernel of the true field, and so is the one with
    position-dependent noise. The recursive model learns level by level, the joint one by a joint
    likelihood. A level of which there are fewer than 20 samples keeps a variance of 0.05.

    Args:
        samples: Of a survey at the drift that the models are for.
        rng: Draws the starts of the search.
    """
    rare = TRUE_KERNEL.model_copy(update={"signal_variance": _RARE_VARIANCE})
    levels = (rare,) * (len(THRESHOLDS_M) + 1)
    config = FieldConfig(
        variable=VARIABLE,
        single=TRUE_KERNEL,
        levels=levels,
        joint_levels=levels,
        fidelity_thresholds_m=THRESHOLDS_M,
    )
    for model in ("recursive", "joint"):
        config = learn_config(config.model_copy(update={"model": model}), samples, rng=rng).config
    return config
