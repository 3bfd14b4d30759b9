"""A simulated manual survey, and the hyperparameters that follow from it.

The thesis trains its multi-fidelity model with one trajectory of a manual data collection. Here
the robot is led up and down through a synthetic field on random courses, surfacing for fixes; its
position estimate drifts as much as its position filter expects. ``FIELD_PRESETS`` holds what
``derived_preset`` finds, rounded to three digits.
"""

import math
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.estimation.config import ESTIMATOR_PRESETS, EstimatorConfig
from autonomy.estimation.position import surface_covariance
from autonomy.field import synthetic
from autonomy.field.config import FIELD_PRESETS, FieldConfig, KernelParameters
from autonomy.field.fidelity import fidelity_level
from autonomy.field.learning.level import learn
from autonomy.field.learning.model import learn_config
from autonomy.field.learning.start import kernels_of_extent
from autonomy.field.model.recursive import RecursiveGaussianProcess
from autonomy.field.samples import FieldSamples
from autonomy.site import LAKE, TANK, Box, Site

_NOISE_FLOOR_SHARE = 0.5
"""Learned noise is not believed below this share of the sensor's own noise variance."""
_FEWEST_SAMPLES = 20
_START_SHARES = (0.1, 0.5)
"""Length scales at which a search begins, as shares of the extent of the samples."""


@dataclass(frozen=True, slots=True)
class SurveyMotion:
    """How the robot is led through the water."""

    vertical_speed_m_s: float
    horizontal_speed_m_s: float
    surface_time_s: float
    """Time at the surface between two dives, long enough for a fix."""
    cycles_max: int
    """Most times that the robot goes down and up again before it surfaces for a fix."""
    sample_period_s: float


PRESET_MOTION: dict[str, SurveyMotion] = {
    "blue_light": SurveyMotion(
        vertical_speed_m_s=0.02,
        horizontal_speed_m_s=0.04,
        surface_time_s=20.0,
        cycles_max=4,
        sample_period_s=2.0,
    ),
    "chlorophyll": SurveyMotion(
        vertical_speed_m_s=0.1,
        horizontal_speed_m_s=0.2,
        surface_time_s=60.0,
        cycles_max=2,
        sample_period_s=10.0,
    ),
}
"""How the surveys behind the presets are led: about as fast as the two vehicles glide."""

PRESET_SITE: dict[str, Site] = {site.variable: site for site in (TANK, LAKE)}
PRESET_ESTIMATOR: dict[str, EstimatorConfig] = {
    "blue_light": ESTIMATOR_PRESETS["miniglider"],
    "chlorophyll": ESTIMATOR_PRESETS["grace3"],
}


@dataclass(frozen=True, slots=True, eq=False)
class Survey:
    """What a survey brings home."""

    points: FloatArray
    """Where the robot believes it was, shape ``(n, 3)``, m."""
    values: FloatArray
    """Measurements in the variable's unit, shape ``(n,)``."""
    position_std: FloatArray
    """Standard deviation that the position filter states, shape ``(n,)``, m."""


def simulate_survey(
    variable_key: str,
    box: Box,
    motion: SurveyMotion,
    estimator: EstimatorConfig,
    samples: int,
    rng: np.random.Generator,
) -> Survey:
    """Lead the robot through the synthetic field until it has taken ``samples`` samples.

    The horizontal error of the estimate walks so that its variance is the one the filter states;
    a fix at the surface draws it anew.

    Args:
        variable_key: A key of ``autonomy.channel``.
        box: Where the robot is led.
        motion: How.
        estimator: Noise that its position filter assumes, and true noise.
        samples: How many.
        rng: Draws course, errors and noise.
    """
    depths = _depths(box, motion, samples, rng)
    true_xy = _course(box, motion, samples, rng)
    dt = motion.sample_period_s
    axis = settled = surface_covariance(estimator, dt)
    error = math.sqrt(axis.position) * rng.standard_normal(2)
    estimated, std = np.empty((samples, 2)), np.empty(samples)
    for i, depth in enumerate(depths):
        before = axis.position
        at_surface = bool(depth <= estimator.surface_depth_m)
        axis = settled if at_surface else axis.step(estimator, dt, has_fix=False)
        if at_surface:
            error = math.sqrt(axis.position) * rng.standard_normal(2)
        else:
            error = error + math.sqrt(max(axis.position - before, 0.0)) * rng.standard_normal(2)
        estimated[i] = true_xy[i] + error
        std[i] = math.sqrt(axis.position)
    values = synthetic.measure(variable_key, np.column_stack([true_xy, depths]), rng)
    return Survey(np.column_stack([estimated, depths]), values, std)


def derived_preset(variable_key: str, rng: np.random.Generator) -> FieldConfig:
    """Repeat the derivation of the kernels of one of ``FIELD_PRESETS`` (some seconds).

    The prior mean is the mean of the survey. The single model learns from half as long a survey
    with exact positions, because the thesis gives it the hyperparameters of the true field.
    """
    preset = FIELD_PRESETS[variable_key]
    domain, motion = PRESET_SITE[variable_key].domain, PRESET_MOTION[variable_key]
    uncertain = PRESET_ESTIMATOR[variable_key]
    exact = uncertain.model_copy(
        update={
            "fix_std_m": uncertain.fix_std_m / 100.0,
            "drift_m_sqrt_s": uncertain.drift_m_sqrt_s / 100.0,
            "acceleration_density": uncertain.acceleration_density / 100.0**2,
        }
    )
    survey = simulate_survey(variable_key, domain, motion, uncertain, 1000, rng)
    exact_survey = simulate_survey(variable_key, domain, motion, exact, 500, rng)
    prior_mean = float(np.mean(preset.in_model_scale(survey.values)))
    learned = learned_config(
        preset.model_copy(update={"prior_mean": prior_mean}), survey, exact_survey
    )
    return learned.model_copy(update={"joint_levels": _joint_levels(learned, survey, rng)})


def learned_config(base: FieldConfig, survey: Survey, exact: Survey) -> FieldConfig:
    """Learn the kernels of both models from two surveys.

    Args:
        base: Prior mean, thresholds and grid to keep.
        survey: Survey with uncertain positions: each level is learned, from the worst located up,
            on what the levels below it leave unexplained. A level with fewer than 20 samples
            keeps its kernel.
        exact: Survey with exact positions, for the single model.
    """
    noise = synthetic.measurement_noise(base.variable) ** 2
    floor = _NOISE_FLOOR_SHARE * noise
    truth = base.in_model_scale(exact.values) - base.prior_mean
    single = learn(exact.points, truth, _starts(exact.points, truth, noise), noise_floor=floor)
    values = base.in_model_scale(survey.values) - base.prior_mean
    sample_levels = fidelity_level(survey.position_std, base.fidelity_thresholds_m)
    levels: list[KernelParameters] = []
    for level, known in enumerate(base.levels):
        mine = sample_levels == level
        if np.count_nonzero(mine) < _FEWEST_SAMPLES:
            levels.append(known)
            continue
        below = RecursiveGaussianProcess(levels, survey.points, values, sample_levels)
        points = survey.points[mine]
        residuals = values[mine] - below.mean(points)
        starts = _starts(points, residuals, noise)
        levels.append(learn(points, residuals, starts, noise_floor=floor).parameters)
    return FieldConfig.model_validate(
        base.model_dump() | {"single": single.parameters, "levels": tuple(levels)}
    )


def _joint_levels(
    config: FieldConfig, survey: Survey, rng: np.random.Generator
) -> tuple[KernelParameters, ...]:
    """Learn the joint model's kernels, from those of the recursion on.

    Every other sample is enough: neighbours share their position error, which no level models.
    """
    samples = FieldSamples.of(survey.points, survey.values, survey.position_std)[::2]
    joint = config.model_copy(update={"model": "joint", "joint_levels": config.levels})
    return learn_config(joint, samples, starts=1, rng=rng).config.joint_levels


def _starts(
    points: FloatArray, values: FloatArray, noise_variance: float
) -> tuple[KernelParameters, ...]:
    signal = max(float(np.mean(values**2)), noise_variance)
    return kernels_of_extent(np.ptp(points, axis=0), _START_SHARES, signal, noise_variance)


def _depths(box: Box, motion: SurveyMotion, samples: int, rng: np.random.Generator) -> FloatArray:
    """Depth at each sample: stays at the surface, then one or more triangles of random depth."""
    rate = motion.vertical_speed_m_s * motion.sample_period_s
    pieces: list[FloatArray] = []
    while sum(len(piece) for piece in pieces) < samples:
        pieces.append(np.zeros(math.ceil(motion.surface_time_s / motion.sample_period_s)))
        for _ in range(int(rng.integers(1, motion.cycles_max + 1))):
            down = np.arange(rate, rng.uniform(0.4, 1.0) * box.depth_max_m, rate)
            pieces += [down, down[::-1]]
    return np.concatenate(pieces)[:samples]


def _course(box: Box, motion: SurveyMotion, samples: int, rng: np.random.Generator) -> FloatArray:
    """Return true north and east at each sample: straight runs between random points."""
    low = np.array([box.x_min_m, box.y_min_m])
    high = np.array([box.x_max_m, box.y_max_m])
    step = motion.horizontal_speed_m_s * motion.sample_period_s
    here = rng.uniform(low, high)
    goal = rng.uniform(low, high)
    course = np.empty((samples, 2))
    for i in range(samples):
        course[i] = here
        while np.linalg.norm(goal - here) < step:
            goal = rng.uniform(low, high)
        here = here + step * (goal - here) / np.linalg.norm(goal - here)
    return course
