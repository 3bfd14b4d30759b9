"""A recorded deployment as a field: its hyperparameters, its map, and how far to trust it."""

from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.channel import Channel
from autonomy.field.config import FieldConfig, GridShape, KernelParameters
from autonomy.field.grid import Grid
from autonomy.field.learning.level import learn
from autonomy.field.learning.noise import Part, cross_validated_noise
from autonomy.field.learning.start import kernels_of_extent
from autonomy.field.live.live_map import LiveMap
from autonomy.field.model.gaussian_process import GaussianProcess
from autonomy.field.samples import FieldSamples
from autonomy.field.scale import to_model
from autonomy.field.score import Scores, score
from autonomy.field.thinning import space_filling
from autonomy.site import Box

_FEWEST_SAMPLES = 20
_NOISE_FLOOR = 1e-3
"""Smallest noise variance as a share of the variance of the values: 3 % of a standard deviation."""

_START_SHARES = (0.1, 0.3)
"""Length scales at which the search begins, as shares of the extent of the samples."""
_START_NOISE = 0.1


@dataclass(frozen=True, slots=True)
class RecordedFit:
    """What was learned from a recorded deployment."""

    config: FieldConfig
    """Single model with the learned kernel, in the model's scale of the variable."""
    box: Box
    """Around the samples that were used."""
    scores: Scores
    """On samples held out, noise included, in standard deviations of the values."""
    value_std: float
    """Standard deviation of the values, in the model's scale."""
    training: int
    """Samples that the kernel was learned from."""
    test: int
    """Samples held out."""
    message: str
    """How learning ended, for a person."""


def fit_recording(
    channel: Channel,
    points: FloatArray,
    values: FloatArray,
    rng: np.random.Generator,
    *,
    depth_limit_m: float = 120.0,
    training: int = 900,
    test: int = 400,
) -> RecordedFit:
    """Learn a map's hyperparameters from a recorded deployment, and score them.

    Of the samples above ``depth_limit_m``, ``test`` random ones are held out and ``training``
    others, spread as evenly as possible, are learned from: cost and memory do not grow with the
    length of the deployment. As many others again help to choose the noise. Held-out
    samples have near neighbours in time, so the scores tell how well the map interpolates along the
    track, not far from it.

    Args:
        channel: What was measured.
        points: Where the samples were taken, NED, shape ``(n, 3)``, m.
        values: Measurements in the channel's unit, shape ``(n,)``.
        rng: Chooses the samples held out.
        depth_limit_m: Deeper samples are left out: below the sunlit layer a field such as
            chlorophyll is another process.
        training: Most samples to learn from.
        test: Most samples to hold out; never more than a quarter.

    Raises:
        ValueError: If a number is not finite, or fewer than 20 samples are above the limit.
    """
    used = _usable(points, values, depth_limit_m)
    points, seen = points[used], to_model(channel.scale, values[used], channel.log_floor)
    mean, std = float(np.mean(seen)), max(float(np.std(seen)), 1e-9)
    standard = (seen - mean) / std
    extent = np.maximum(np.ptp(points, axis=0), 1.0)
    held_out, learned_from, left_over = _split(points, extent, training, test, rng)

    known = Part(points[learned_from], standard[learned_from])
    learned = learn(
        known.points,
        known.values,
        kernels_of_extent(extent, _START_SHARES, 1.0, _START_NOISE),
        noise_floor=_NOISE_FLOOR,
    )
    kernel = cross_validated_noise(
        learned.parameters,
        known,
        Part(points[left_over], standard[left_over]),
        floor=_NOISE_FLOOR,
    )
    return RecordedFit(
        config=_config_of(channel, kernel, mean, std),
        box=_box_around(points),
        scores=_scores(kernel, known, Part(points[held_out], standard[held_out])),
        value_std=std,
        training=len(learned_from),
        test=len(held_out),
        message=learned.message,
    )


def recorded_map(fit: RecordedFit, points: FloatArray, values: FloatArray) -> LiveMap:
    """Map a recorded deployment with what was learned from it.

    All samples inside the fit's box take part, thinned to what the map holds; positions count as
    exact.

    Args:
        fit: Outcome of ``fit_recording``.
        points: Where the samples were taken, NED, shape ``(n, 3)``, m.
        values: Measurements in the variable's unit, shape ``(n,)``.
    """
    live_map = LiveMap(fit.config, Grid.over(fit.box, fit.config.grid))
    used = _usable(points, values, fit.box.depth_max_m)
    live_map.append(FieldSamples.of(points[used], values[used], np.zeros(len(used))))
    return live_map


def _usable(points: FloatArray, values: FloatArray, depth_limit_m: float) -> IntArray:
    if not (np.isfinite(points).all() and np.isfinite(values).all()):
        raise ValueError("positions and values of a recording must be finite")
    used = np.flatnonzero(points[:, 2] <= depth_limit_m)
    if len(used) < _FEWEST_SAMPLES:
        raise ValueError(
            f"a map needs at least {_FEWEST_SAMPLES} samples above {depth_limit_m:g} m, "
            f"the recording has {len(used)}"
        )
    return used


def _split(
    points: FloatArray, extent: FloatArray, training: int, test: int, rng: np.random.Generator
) -> tuple[IntArray, IntArray, IntArray]:
    """Return indices held out, indices to learn from, and at most as many of the rest."""
    order = rng.permutation(len(points))
    count = min(test, len(points) // 4)
    held_out, rest = order[:count], np.sort(order[count:])
    learned_from = rest[space_filling(points[rest], training, tuple(extent.tolist()))]
    left_over = order[count:][np.isin(order[count:], learned_from, invert=True)]
    return held_out, learned_from, left_over[:training]


def _scores(kernel: KernelParameters, known: Part, held_out: Part) -> Scores:
    """Score what a kernel says of the values held out, noise included, from those known."""
    process = GaussianProcess(kernel, known.points, known.values)
    targets = held_out.points
    covariance = process.covariance(targets) + kernel.noise_variance * np.eye(len(targets))
    return score(process.mean(targets), covariance, held_out.values)


def _config_of(channel: Channel, kernel: KernelParameters, mean: float, std: float) -> FieldConfig:
    """Return the single model of a kernel learned from values less ``mean``, over ``std``."""
    scaled = kernel.model_copy(
        update={
            "signal_variance": kernel.signal_variance * std**2,
            "noise_variance": kernel.noise_variance * std**2,
        }
    )
    return FieldConfig(
        variable=channel.key,
        model="single",
        prior_mean=mean,
        single=scaled,
        levels=(scaled,),
        fidelity_thresholds_m=(),
        grid=GridShape(x=20, y=20, z=20),
    ).for_channel(channel)


def _box_around(points: FloatArray) -> Box:
    low = points.min(axis=0).tolist()
    high = np.maximum(points.max(axis=0), points.min(axis=0) + 1.0).tolist()
    return Box(
        x_min_m=low[0],
        x_max_m=high[0],
        y_min_m=low[1],
        y_max_m=high[1],
        depth_max_m=max(high[2], 1.0),
    )
