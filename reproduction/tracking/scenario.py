"""Scenarios of the tracking chapter: who starts where, and what noise the measurements carry."""

import math
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.tracking.config import (
    THESIS_TRACKING,
    BarrierConfig,
    FilterConfig,
    TargetConfig,
    TrackingConfig,
)

MEASUREMENT_STD: Final = (math.sqrt(0.1), math.sqrt(0.0175), math.sqrt(0.1))
"""Of range (m), heading (rad) and speed (m/s): the thesis's numbers taken as variances, as its
section 4.4 says."""
_PATHS: Final = ("static", "line", "sine", "circle")


@dataclass(frozen=True, slots=True)
class Scenario:
    """One way to start, one target, one kind of noise, and the settings of who follows."""

    name: str
    config: TrackingConfig
    """Target path, filter, barrier and limits."""
    start: tuple[float, float, float, float]
    """North and east (m), heading (rad) and speed (m/s) of the robot at the start."""
    duration_s: float
    step_s: float = 0.1
    guess_std_m: float = math.sqrt(0.065)
    """Standard deviation per axis of the first estimate of the relative position; 0 knows it."""
    believed_variance_m2: float = 0.165
    """Variance per axis that the filter starts with."""
    noise_std: tuple[float, float, float] = MEASUREMENT_STD
    """Standard deviations of range, heading and speed measurements."""
    range_steps: int = 1
    """A range comes every so many steps; heading and speed come at each."""
    outlier_share: float = 0.0
    """Share of the ranges that are wrong."""
    outlier_m: float = 3.0
    """A wrong range is too long by up to so much, as after a reflection."""
    lost_share: float = 0.0
    """Share of the ranges that never come."""

    @property
    def steps(self) -> int:
        """Number of control steps."""
        return round(self.duration_s / self.step_s)

    def with_barrier(self, **settings: Any) -> "Scenario":  # noqa: ANN401 - fields of BarrierConfig
        """Return the scenario with other settings of the barrier."""
        barrier = BarrierConfig.model_validate(self.config.barrier.model_dump() | settings)
        return replace(self, config=self.config.model_copy(update={"barrier": barrier}))

    def with_filter(self, **settings: Any) -> "Scenario":  # noqa: ANN401 - fields of FilterConfig
        """Return the scenario with other settings of the estimator."""
        chosen = FilterConfig.model_validate(self.config.filter.model_dump() | settings)
        return replace(self, config=self.config.model_copy(update={"filter": chosen}))


@dataclass(frozen=True, slots=True, eq=False)
class Draws:
    """The random numbers of one seed, the same for every case."""

    offset_m: FloatArray
    """Error of the first estimate, shape ``(2,)``, m."""
    noise: FloatArray
    """Added to range (m), heading (rad) and speed (m/s), shape ``(n, 3)``."""
    has_range: FloatArray
    """1 where a range comes and 0 where none does, shape ``(n,)``."""


def draws(scenario: Scenario, seed: int) -> Draws:
    """Draw what is random in a run.

    The offset is drawn first and then the noise, row by row, so that a seed means the same for
    every case. Wrong and lost ranges have a generator of their own: they change nothing else.
    """
    generator = np.random.default_rng(seed)
    offset = scenario.guess_std_m * generator.standard_normal(2)
    n = scenario.steps
    noise = generator.standard_normal((n, 3)) * np.array(scenario.noise_std)
    has_range = (np.arange(n) % scenario.range_steps == 0).astype(np.float64)
    if scenario.outlier_share > 0.0 or scenario.lost_share > 0.0:
        chances = np.random.default_rng((seed, 1)).random((n, 3))
        is_wrong = chances[:, 0] < scenario.outlier_share
        noise[:, 0] += np.where(is_wrong, scenario.outlier_m * chances[:, 1], 0.0)
        has_range[chances[:, 2] < scenario.lost_share] = 0.0
    return Draws(offset, noise, has_range)


FIT: Final = Scenario(
    name="FIT",
    config=THESIS_TRACKING.model_copy(
        update={
            "target": THESIS_TRACKING.target.model_copy(
                update={"heading_rad": 3.474 - 2.0 * math.pi}
            ),
        }
    ),
    start=(4.55 * math.cos(-1.657), 4.55 * math.sin(-1.657), 1.376, 0.266),
    duration_s=335.0,
)
"""Found by search: it shows what the tables of chapter 4 show. The thesis prints neither run
length, step, path, start, margin, class-K function nor filter noises: these are not its own."""

STATIC: Final = Scenario(
    name="static",
    config=THESIS_TRACKING.model_copy(
        update={
            "target": TargetConfig(path="static", north_m=0.0, east_m=0.0),
            "barrier": BarrierConfig(shape="squared", fallback="nominal", epsilon=0.04, slope=1.0),
        }
    ),
    start=(-5.0, 0.0, 0.6, 0.1),
    duration_s=60.0,
    guess_std_m=0.0,
    noise_std=(0.0, 0.0, 0.0),
)
"""Without noise around a target that stays: what the anchors are worked out on."""


def random_scenarios(seed: int, count: int, config: TrackingConfig) -> tuple[Scenario, ...]:
    """Draw scenarios that have nothing in common but the robot.

    Args:
        seed: Decides all of them; the first ones are the same for every count.
        count: How many.
        config: Settings, the same for all; only the target is drawn anew.

    Returns:
        Scenarios whose targets stay, go straight, swing or circle in turn, at up to 3 cm/s, and
        whose robots start 2 to 6 m away in any direction, in any heading, at 0.05 to 0.3 m/s.
    """
    generator = np.random.default_rng(seed)
    return tuple(_random(f"random {n}", n, generator, config) for n in range(count))


def _random(
    name: str, number: int, generator: np.random.Generator, config: TrackingConfig
) -> Scenario:
    path: Literal["static", "line", "sine", "circle"] = _PATHS[number % len(_PATHS)]
    reach, bearing, heading, speed, course, pace, width, period = generator.random(8)
    distance, angle = 2.0 + 4.0 * reach, _angle(bearing)
    target = TargetConfig(
        path=path,
        north_m=0.0,
        east_m=0.0,
        heading_rad=_angle(course),
        speed_m_s=0.005 + 0.025 * pace,
        width_m=0.5 + 1.5 * width,
        period_s=300.0 + 300.0 * period,
    )
    return Scenario(
        name=name,
        config=config.model_copy(update={"target": target}),
        start=(
            distance * math.cos(angle),
            distance * math.sin(angle),
            _angle(heading),
            0.05 + 0.25 * speed,
        ),
        duration_s=335.0,
    )


def _angle(share: float) -> float:
    return math.pi * (2.0 * share - 1.0)
