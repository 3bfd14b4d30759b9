"""The kernels of a whole field model, learned from all its samples."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.field.config import FieldConfig, KernelParameters
from autonomy.field.fidelity import fidelity_level
from autonomy.field.learned import LearnedConfig
from autonomy.field.learning.level import learn, learn_levels
from autonomy.field.learning.search import IsCancelled, Report
from autonomy.field.learning.start import starting_kernels
from autonomy.field.learning.trend import Trend
from autonomy.field.level_scale import scale_factors
from autonomy.field.model.model import ageing_of, centred_values, condition
from autonomy.field.model.position_noise import PositionNoise
from autonomy.field.model.recursive import RecursiveGaussianProcess
from autonomy.field.reckoning import error_scale
from autonomy.field.samples import FieldSamples, checked
from autonomy.field.thinning import space_filling

MOST_SAMPLES = 1000
"""More samples are thinned to this many, spread evenly: an evaluation takes ``O(n^3)``."""
FEWEST_OF_A_LEVEL = 20
"""A level with fewer samples keeps its kernel."""
_NOISE_ROUNDS = 3
_CURRENT_SHARES = (0.25, 0.5, 1.0, 2.0, 4.0)
"""Currents that are weighed where no jump tells, in the present one."""
_LEAST_GAIN = 1e-3
"""Nats by which learned kernels must be more likely to be taken."""
_SMALLEST_NOISE = 1e-12


def learn_config(
    config: FieldConfig,
    samples: FieldSamples,
    *,
    starts: int | None = None,
    rng: np.random.Generator,
    report: Report | None = None,
    is_cancelled: IsCancelled | None = None,
) -> LearnedConfig:
    """Learn the kernels, and where ``config.learning`` says so the mean, of a field's model.

    The single model and that with position-dependent noise learn one kernel; the latter with the
    noise that the present slopes bring about, found anew with each kernel. The recursive model
    learns level by level, each from what the levels below leave unexplained; the joint model all
    of its kernels by one likelihood. Kernels of the other models stay.

    Args:
        config: Model, present kernels (the centre of the priors), and how to learn.
        samples: All samples of the map.
        starts: Places to begin at; ``config.learning.starts`` without it.
        rng: Draws the starts beyond the present kernels and those that suit the extent.
        report: Told the share of the work that is done, and a sentence.
        is_cancelled: Asked at every evaluation; once it says yes the kernels stay.

    Raises:
        ValueError: If a sample is not usable, with its number.
    """
    used = _thinned(config, checked(samples))
    values = config.in_model_scale(used.values)
    if len(used) < 2:
        return _kept(config, "Learning needs at least two samples; the kernels stay.")
    if float(np.ptp(values)) == 0.0:
        return _kept(config, "All samples have the same value, which tells of no length scale.")
    if not np.ptp(used.points, axis=0).any():
        return _kept(config, "All samples are at one place, which tells of no length scale.")
    work = _Work(
        config=config,
        samples=used,
        floor=max(config.learning.noise_floor_share * float(np.var(values)), _SMALLEST_NOISE),
        starts=config.learning.starts if starts is None else starts,
        rng=rng,
        report=report,
        is_cancelled=is_cancelled,
    )
    try:
        found, kernels = _LEARN[config.model](work)
        return _judged(config, found, kernels, work)
    except _CalledOffError:
        return _kept(config, "Learning was called off; the kernels stay.")
    except ValueError as error:
        return _kept(config, f"Nothing could be learned: {error}.")


class _CalledOffError(Exception):
    """Leaves the work when nobody wants what it would find."""


@dataclass(frozen=True, slots=True, eq=False)
class _Work:
    config: FieldConfig
    samples: FieldSamples
    floor: float
    starts: int
    rng: np.random.Generator
    report: Report | None
    is_cancelled: IsCancelled | None

    @property
    def values(self) -> FloatArray:
        """Values less the prior mean; the whole values where the mean is learned too."""
        if self.config.learning.mean == "fixed":
            return centred_values(self.config, self.samples)
        return self.config.in_model_scale(self.samples.values)

    @property
    def age(self) -> FloatArray | None:
        """Times over the memory of the field; none if it stays."""
        memory_s = self.config.memory_s
        return self.samples.time_s / memory_s if memory_s > 0.0 else None

    def go_on(self) -> None:
        """Raise ``_CalledOffError`` if the work was cancelled; asked before each longer part."""
        if self.is_cancelled is not None and self.is_cancelled():
            raise _CalledOffError

    def of_part(self, done: int, parts: int) -> Report | None:
        """Return a report of one of several equal parts of the work."""
        report = self.report
        if report is None:
            return None
        return lambda share, message: report((done + share) / parts, message)


def _learn_single(work: _Work) -> tuple[FieldConfig, tuple[str, ...]]:
    starts = starting_kernels(
        work.config.single, work.samples.points, work.values, work.starts, work.rng
    )
    return _learn_one(work, starts, None, work.report)


def _learn_position_noise(work: _Work) -> tuple[FieldConfig, tuple[str, ...]]:
    """Learn with the noise of the present slopes held, then find the slopes anew."""
    config, samples, kernels = work.config, work.samples, ("",)
    starts = starting_kernels(config.single, samples.points, work.values, work.starts, work.rng)
    current_m_s = _current(work)
    for number in range(_NOISE_ROUNDS):
        work.go_on()
        noise = PositionNoise.of(
            config.single,
            samples,
            centred_values(config, samples),
            scale=error_scale(samples.reckoning, samples.dive, current_m_s),
            ageing=ageing_of(config, samples, None),
        ).covariance
        config, kernels = _learn_one(work, starts, noise, work.of_part(number, _NOISE_ROUNDS))
        starts = [work.config.single, config.single]
    if current_m_s == work.config.steady_current_m_s:
        return config, kernels
    fact = f"unknown current: {100.0 * current_m_s:.2g} cm/s on each axis"
    return config.model_copy(update={"steady_current_m_s": current_m_s}), (*kernels, fact)


def _current(work: _Work) -> float:
    """Return the steady current that jumps at fixes show, or without jumps the values themselves.

    The present one is the scale of a half Cauchy prior; 0 stays.
    """
    config, known = work.config, work.samples.reckoning
    prior_m_s = config.steady_current_m_s
    if prior_m_s == 0.0 or not known.since_fix_s.any():
        return prior_m_s
    if np.isfinite(known.jump_ne_m).any():
        return error_scale(known, work.samples.dive, prior_m_s).current_m_s

    def evidence(share: float) -> float:
        work.go_on()
        tried = _unadapted(config).model_copy(update={"steady_current_m_s": share * prior_m_s})
        return -_negative_log(tried, work.samples) - math.log1p(share**2)

    return prior_m_s * max(_CURRENT_SHARES, key=evidence)


def _learn_one(
    work: _Work,
    starts: list[KernelParameters],
    held_noise: FloatArray | None,
    report: Report | None,
) -> tuple[FieldConfig, tuple[str, ...]]:
    points = work.samples.points
    trend = Trend.of(work.config.learning.mean, points)
    learned = learn(
        points,
        work.values,
        starts,
        noise_floor=work.floor,
        prior_strength=work.config.learning.prior_strength,
        basis=trend.basis(points),
        held_noise=held_noise,
        age=work.age,
        report=report,
        is_cancelled=work.is_cancelled,
    )
    config = work.config.model_copy(update={"single": learned.parameters})
    fact = _fact("kernel", learned.parameters, len(points), learned.message)
    return trend.applied(config, learned.trend), (fact,)


def _learn_recursive(work: _Work) -> tuple[FieldConfig, tuple[str, ...]]:
    config, points = work.config, work.samples.points
    fidelity = _fidelity(work)
    values = work.values
    trend = Trend.of(config.learning.mean, points)
    levels: list[KernelParameters] = []
    facts: list[str] = []
    is_mean_known = config.learning.mean == "fixed"
    factors: list[float] = [0.0, *scale_factors(config.rho, len(config.levels)).tolist()]
    for level, present in enumerate(config.levels):
        work.go_on()
        mine = fidelity == level
        if np.count_nonzero(mine) < FEWEST_OF_A_LEVEL:
            levels.append(present)
            facts.append(_fact_of_kept(level, int(np.count_nonzero(mine))))
            continue
        residuals = values[mine]
        if is_mean_known:
            below = RecursiveGaussianProcess(
                levels,
                points,
                values,
                fidelity,
                rho=factors[1:level],
                ageing=ageing_of(config, work.samples, None),
            )
            residuals = residuals - factors[level] * below.mean(points[mine])
        learned = learn(
            points[mine],
            residuals,
            starting_kernels(present, points[mine], residuals, work.starts, work.rng),
            noise_floor=work.floor,
            prior_strength=config.learning.prior_strength,
            basis=None if is_mean_known else trend.basis(points[mine]),
            age=None if work.age is None else work.age[mine],
            report=work.of_part(level, len(config.levels)),
            is_cancelled=work.is_cancelled,
        )
        if not is_mean_known:
            config = trend.applied(config, learned.trend)
            values, is_mean_known = centred_values(config, work.samples), True
        levels.append(learned.parameters)
        facts.append(_fact(f"level {level}", learned.parameters, len(residuals), learned.message))
    return config.model_copy(update={"levels": tuple(levels)}), tuple(facts)


def _learn_joint(work: _Work) -> tuple[FieldConfig, tuple[str, ...]]:
    config, points, values = work.config, work.samples.points, work.values
    fidelity = _fidelity(work)
    counts = np.bincount(fidelity, minlength=len(config.joint_levels)).tolist()
    held = [level for level, count in enumerate(counts) if count < FEWEST_OF_A_LEVEL]
    by_level = [
        [
            present if level in held else kernel
            for kernel in starting_kernels(
                present, points, values / (1.0 + level), work.starts, work.rng
            )
        ]
        for level, present in enumerate(config.joint_levels)
    ]
    trend = Trend.of(config.learning.mean, points)
    learned = learn_levels(
        points,
        values,
        fidelity,
        list(zip(*by_level, strict=True)),
        noise_floor=work.floor,
        rho=config.rho,
        learns_rho=config.learning.learns_rho,
        held=held,
        prior_strength=config.learning.prior_strength,
        basis=trend.basis(points),
        age=work.age,
        report=work.report,
        is_cancelled=work.is_cancelled,
    )
    facts = tuple(
        _fact_of_kept(level, counts[level])
        if level in held
        else _fact(f"level {level}", kernel, counts[level], learned.message)
        for level, kernel in enumerate(learned.levels)
    )
    found = config.model_copy(update={"joint_levels": learned.levels})
    if config.learning.learns_rho and len(learned.rho):
        found = found.model_copy(update={"rho": learned.rho})
        told = ", ".join(f"{factor:.3g}" for factor in learned.rho)
        facts = (*facts, f"scale between levels: {told}")
    return trend.applied(found, learned.trend), facts


_LEARN: dict[str, Callable[[_Work], tuple[FieldConfig, tuple[str, ...]]]] = {
    "single": _learn_single,
    "recursive": _learn_recursive,
    "joint": _learn_joint,
    "position_noise": _learn_position_noise,
}

_KERNELS = {
    "single": "single",
    "recursive": "levels",
    "joint": "joint_levels",
    "position_noise": "single",
}
"""Where the settings keep the kernels of each model."""


def _fidelity(work: _Work) -> IntArray:
    return fidelity_level(work.samples.position_std_m, work.config.fidelity_thresholds_m)


def _thinned(config: FieldConfig, samples: FieldSamples) -> FieldSamples:
    kept = space_filling(samples.points, MOST_SAMPLES, config.single.length_scales_m())
    return samples[kept]


def _negative_log(config: FieldConfig, samples: FieldSamples) -> float:
    return -condition(_unadapted(config), samples).log_marginal_likelihood()


def _unadapted(config: FieldConfig) -> FieldConfig:
    """Return settings whose kernel is the one that is judged."""
    return config.model_copy(update={"adapts": False})


def _judged(
    config: FieldConfig, found: FieldConfig, kernels: tuple[str, ...], work: _Work
) -> LearnedConfig:
    """Take what was found if it is more likely than the present, noise floor included."""
    work.go_on()
    before, after = _negative_log(config, work.samples), _negative_log(found, work.samples)
    floored = _floored(config, work.floor)
    floored_nll = before if floored == config else _negative_log(floored, work.samples)
    is_better = floored_nll - after > _LEAST_GAIN
    if is_better:
        taken, taken_nll = FieldConfig.model_validate(found.model_dump()), after
        message = (
            f"The negative log likelihood of {len(work.samples)} samples went from {before:.1f} "
            f"to {after:.1f}."
        )
    else:
        taken, taken_nll = floored, floored_nll
        message = "The present kernels explain the samples as well as any that were found."
        if floored != config:
            message = "The present kernels stay, but for a noise that was below its floor."
    return LearnedConfig(
        config=taken,
        before_nll=before,
        after_nll=taken_nll,
        is_changed=is_better or floored != config,
        message=message,
        kernels=list(kernels) if is_better else [],
    )


def _floored(config: FieldConfig, floor: float) -> FieldConfig:
    """Return settings whose model counts no less noise than the floor."""
    name = _KERNELS[config.model]
    used = getattr(config, name)
    kernels = tuple(
        kernel.model_copy(update={"noise_variance": max(kernel.noise_variance, floor)})
        for kernel in (used if isinstance(used, tuple) else (used,))
    )
    return config.model_copy(update={name: kernels if isinstance(used, tuple) else kernels[0]})


def _kept(config: FieldConfig, message: str) -> LearnedConfig:
    return LearnedConfig(
        config=config,
        before_nll=None,
        after_nll=None,
        is_changed=False,
        message=message,
        kernels=[],
    )


def _fact(name: str, kernel: KernelParameters, samples: int, message: str) -> str:
    x, y, z = kernel.length_scales_m()
    return (
        f"{name}: {samples} samples, signal {kernel.signal_variance**0.5:.3g}, noise "
        f"{kernel.noise_variance**0.5:.3g}, length scales {x:.3g}, {y:.3g}, {z:.3g} m; {message}"
    )


def _fact_of_kept(level: int, samples: int) -> str:
    return f"level {level}: {samples} samples are too few, its kernel stays"
