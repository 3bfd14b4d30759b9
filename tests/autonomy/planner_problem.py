"""Planning problems that the planner's tests share."""

import itertools
from collections.abc import Callable

import numpy as np

from autonomy.estimation.config import EstimatorConfig
from autonomy.planner.belief import FieldBelief, sample_noise
from autonomy.planner.config import PlannerConfig, PrimitiveConfig, SearchConfig
from autonomy.planner.leg.edge import planned_points
from autonomy.planner.leg.leg_kernel import leg_of
from autonomy.planner.objective import (
    ErgodicMeasure,
    FieldInformation,
    MutualInformation,
    Objective,
    objective,
    weighted_sum,
)
from autonomy.planner.plan import ObjectivePoint, PlanResult
from autonomy.planner.preset import PLANNER_PRESETS
from autonomy.planner.search.elite import elite_edge
from autonomy.planner.search.search import Search, independent_points
from autonomy.site import Box

THESIS_TANK = PlannerConfig(
    max_uncertainty_m=0.5,
    fidelity_counts=False,
    primitives=PrimitiveConfig(swim_length_max_m=1.4),
    position_filter=EstimatorConfig(drift_m_sqrt_s=0.02, steady_current_m_s=0.0),
)
START = (0.3, 0.3)


def belief_over(
    domain: Box, past: int = 20, lengths: tuple[float, float, float] = (2.41, 2.46, 2.40)
) -> FieldBelief:
    """A belief with a coarse grid of test points and some past samples along a line."""
    axes = (
        np.linspace(domain.x_min_m, domain.x_max_m, 5),
        np.linspace(domain.y_min_m, domain.y_max_m, 4),
        np.linspace(0.0, domain.depth_max_m, 3),
    )
    test_points = np.array(list(itertools.product(*axes)))
    part = np.linspace(0.1, 0.6, past)
    samples = np.column_stack(
        [
            domain.x_min_m + part * (domain.x_max_m - domain.x_min_m),
            domain.y_min_m + 0.4 * (domain.y_max_m - domain.y_min_m) + 0.0 * part,
            domain.depth_max_m * np.abs(np.sin(9.0 * part)),
        ]
    )
    score = np.linspace(3.0, 6.0, len(test_points))
    return FieldBelief(
        signal_variance=5.27,
        length_scales_m=lengths,
        noise_variance=0.0025,
        sample_points=samples,
        test_points=test_points,
        mean=score,
        std=np.full(len(test_points), 0.5),
        sample_position_std=np.linspace(0.01, 0.2, past),
    )


def with_search(config: PlannerConfig, **values: float) -> PlannerConfig:
    """The same settings with some of the search's replaced; validated as a whole."""
    search = SearchConfig.model_validate(config.search.model_dump() | values)
    return config.model_copy(update={"search": search})


def _silent(_: ObjectivePoint) -> None:
    """Take a report on progress and say nothing."""


def run(
    plan: Callable[..., PlanResult],
    config: PlannerConfig,
    belief: FieldBelief,
    *,
    seed: int = 0,
    start: tuple[float, float] = START,
    budget: float = 20.0,
    on_progress: Callable[[ObjectivePoint], None] = _silent,
    is_cancelled: Callable[[], bool] = lambda: False,
    elapsed_s: Callable[[], float] = lambda: 0.0,
    **more: object,
) -> PlanResult:
    """Call a planner; by default time stands still and only the iterations end it."""
    return plan(
        config,
        belief,
        start,
        rng=np.random.default_rng(seed),
        budget=budget,
        on_progress=on_progress,
        is_cancelled=is_cancelled,
        elapsed_s=elapsed_s,
        **more,
    )


def independent_worth(config: PlannerConfig, belief: FieldBelief, seed: int = 0) -> Objective:
    """What a trajectory is worth on points that the search of this seed is judged on."""
    points = independent_points(config, None, np.random.default_rng(seed))
    gain = MutualInformation(belief.at(points), sample_noise(config, belief))
    if config.objective == "weighted":
        return weighted_sum(config, belief, START, gain)
    return objective(config, belief, START) if config.objective == "ergodic" else gain


def plain_worth_of_best(one: Search, config: PlannerConfig, belief: FieldBelief) -> float:
    """What the plain formulas say of the best trajectory of a search."""
    kept = one.graph
    elite = int(kept.elite_worth.argmax())
    edges = []
    for i in range(kept.elite_length[elite]):
        number = elite_edge(kept, elite, i)
        legs = map(leg_of, kept.edge_legs[number, : kept.edge_leg_count[number]])
        edges.append(planned_points(config, tuple(legs)))
    worth, value = one.worth, one.worth.constant
    if one.info is not None:
        gain = FieldInformation(belief, sample_noise(config, belief), one.info.fine)
        value += worth.gain_weight * gain(edges)
    if one.ergodic is not None:
        measure = ErgodicMeasure(belief, config.ergodic)(np.concatenate(edges))
        value += worth.measure_weight * measure
    return value


def told(config: PlannerConfig) -> PlannerConfig:
    """Return settings of a robot to which many fixes have told the current."""
    position = config.position_filter.model_copy(update={"steady_current_m_s": 0.0})
    return config.model_copy(update={"position_filter": position})


TOLD = {key: told(preset) for key, preset in PLANNER_PRESETS.items()}
"""Presets of both vehicles where they know the current."""
