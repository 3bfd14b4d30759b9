"""Planning problems drawn at run time, and what a trajectory is worth on points nobody knew.

A third each: the thesis's robot in the tank, a Miniglider in the tank, GRACE 3 in the lake. Drawn
are the field's kernel (variance, lengths and noise lognormal about those learned from tank and
lake; Matern-3/2 three times in four, else Matern-5/2), up to 120 samples along random dives, the
place of the start, how much fixes have told of the current, and for the thesis's robot whether
fidelity counts.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from autonomy.arrays import FloatArray
from autonomy.estimation.config import EstimatorConfig
from autonomy.field.config import GridShape
from autonomy.field.grid import Grid
from autonomy.field.mask import water_mask
from autonomy.field.model.kernel import covariance
from autonomy.planner.belief import FieldBelief, sample_noise
from autonomy.planner.config import PlannerConfig, PrimitiveConfig
from autonomy.planner.leg.edge import propose_edge, random_shape
from autonomy.planner.leg.waterway import Waterway, depth_at, waterway_of
from autonomy.planner.objective import MutualInformation
from autonomy.planner.plan import PlanResult
from autonomy.planner.position_error import planned_noise
from autonomy.planner.preset import PLANNER_PRESETS
from autonomy.site import LAKE, TANK, Box, Site

KINDS = ("thesis", "miniglider", "grace3")
FRESH_POINTS = 1000
_DENSE_POINTS = 1500
_SAMPLES_MAX = 120
_UNKNOWN = (0.2, 0.6)
"""Of the current that nobody knows at first, what fixes have left of it."""
_TANK_FIELD = (5.27, (2.41, 2.46, 2.40), 0.0025)
_LAKE_FIELD = (6.04, (202.0, 293.0, 6.3), 0.07)
THESIS = PlannerConfig(
    max_uncertainty_m=0.5,
    fidelity_counts=False,
    primitives=PrimitiveConfig(swim_length_max_m=1.4),
    position_filter=EstimatorConfig(drift_m_sqrt_s=0.02, steady_current_m_s=0.0),
)
"""The thesis's robot, whose samples count alike wherever they are taken."""


@dataclass(frozen=True, slots=True)
class Problem:
    """What a planner is asked."""

    kind: str
    config: PlannerConfig
    site: Site
    belief: FieldBelief
    start_xy: tuple[float, float]

    def plan(
        self,
        planner: Callable[..., PlanResult],
        seed: int,
        seconds: float,
        clock: Callable[[], float] = time.process_time,
    ) -> PlanResult:
        """Let a planner search for so many seconds of a clock, by default the processor's."""
        began = clock()
        return planner(
            self.config.model_copy(update={"planning_time_s": seconds}),
            self.belief,
            self.start_xy,
            rng=np.random.default_rng(seed),
            budget=self.config.round_budget,
            on_progress=lambda _: None,
            is_cancelled=lambda: False,
            elapsed_s=lambda: clock() - began,
            site=self.site,
        )


class Judge:
    """What a trajectory is worth on points that are drawn here."""

    def __init__(self, problem: Problem, rng: np.random.Generator) -> None:
        config, self._belief = problem.config, problem.belief
        self._noise = sample_noise(config, self._belief)
        fresh = _anywhere(config.domain, problem.site, rng, FRESH_POINTS)
        self._dense = _anywhere(config.domain, problem.site, rng, _DENSE_POINTS)
        self.information = MutualInformation(self._belief.at(fresh), self._noise)

    def left_std(self, points: FloatArray | None) -> float:
        """Return the root of the map's variance, averaged over other points of the water.

        Args:
            points: A trajectory ``(m, 5)`` flown before; None for the map as it is.
        """
        belief, kernel = self._belief, self._belief.kernel()
        samples, noise = belief.known_samples(self._noise)
        gram_noise = np.diag(noise)
        if points is not None:
            own = planned_noise(belief, self._noise, points)
            gram_noise = np.block(
                [
                    [gram_noise, np.zeros((len(noise), len(own)))],
                    [np.zeros((len(own), len(noise))), own],
                ]
            )
            samples = np.concatenate([samples, points[:, 1:4]])
        if not len(samples):
            return math.sqrt(belief.signal_variance)
        factor = np.linalg.cholesky(covariance(samples, samples, kernel) + gram_noise)
        white = solve_triangular(factor, covariance(samples, self._dense, kernel), lower=True)
        left = belief.signal_variance - np.square(white).sum(axis=0)
        return math.sqrt(float(left.mean()))


def draw(rng: np.random.Generator) -> Problem:
    """Draw a problem."""
    kind = str(rng.choice(KINDS))
    site, field = (LAKE, _LAKE_FIELD) if kind == "grace3" else (TANK, _TANK_FIELD)
    if kind == "thesis":
        config = THESIS.model_copy(update={"fidelity_counts": bool(rng.random() < 0.5)})
    else:
        config = _told(PLANNER_PRESETS[kind], float(rng.uniform(*_UNKNOWN)))
    variance, lengths, noise = field
    water = waterway_of(config, site)
    samples, std = _past_samples(config, water, rng)
    grid = Grid.over(config.domain, GridShape(x=10, y=6, z=4)).points
    grid = grid[water_mask(site, grid)]
    belief = FieldBelief(
        signal_variance=variance * float(np.exp(0.3 * rng.standard_normal())),
        length_scales_m=tuple(
            length * float(np.exp(0.3 * rng.standard_normal())) for length in lengths
        ),
        noise_variance=noise * float(np.exp(0.5 * rng.standard_normal())),
        sample_points=samples,
        test_points=grid,
        mean=np.zeros(len(grid)),
        std=np.ones(len(grid)),
        sample_position_std=std,
        shape="matern32" if rng.random() < 0.75 else "matern52",
    )
    return Problem(kind, config, site, belief, _place(config, water, rng))


def _told(config: PlannerConfig, share: float) -> PlannerConfig:
    """Return settings of a robot to which fixes have left this share of the unknown current."""
    position = config.position_filter
    left = position.model_copy(update={"steady_current_m_s": share * position.steady_current_m_s})
    return config.model_copy(update={"position_filter": left})


def _past_samples(
    config: PlannerConfig, water: Waterway, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return places and position deviations of samples along random dives."""
    count = int(rng.integers(_SAMPLES_MAX + 1))
    points = np.empty((0, 5))
    while len(points) < count:
        start, bearing = _place(config, water, rng), rng.uniform(0.0, 2.0 * math.pi)
        reach = 0.8 * config.search.step_m
        goal = (start[0] + reach * math.cos(bearing), start[1] + reach * math.sin(bearing))
        if config.domain.contains(*goal, 0.0):
            shape = random_shape(config, rng)
            edge = propose_edge(config, start, goal, config.round_budget, shape, water)
            if edge is not None:
                points = np.concatenate([points, edge.points])
    return points[:count, 1:4], points[:count, 4]


def _place(config: PlannerConfig, water: Waterway, rng: np.random.Generator) -> tuple[float, float]:
    """Draw a place of the domain where a robot can dive."""
    domain = config.domain
    while True:
        x = float(rng.uniform(domain.x_min_m, domain.x_max_m))
        y = float(rng.uniform(domain.y_min_m, domain.y_max_m))
        if depth_at(water, x, y) > 0.5 * domain.depth_max_m:
            return x, y


def _anywhere(domain: Box, site: Site, rng: np.random.Generator, count: int) -> FloatArray:
    """Draw points of the water of a domain, ``(count, 3)``."""
    low = (domain.x_min_m, domain.y_min_m, 0.0)
    high = (domain.x_max_m, domain.y_max_m, domain.depth_max_m)
    found = np.empty((0, 3))
    while len(found) < count:
        points = rng.uniform(low, high, size=(count, 3))
        found = np.concatenate([found, points[water_mask(site, points)]])
    return found[:count]
