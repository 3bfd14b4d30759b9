"""Settings of the first map of a water: of its channel, or like those of a known field."""

import numpy as np

from autonomy.channel import CHANNELS, Channel
from autonomy.field.config import FIELD_PRESETS, FieldConfig, KernelParameters
from autonomy.field.scale import to_model
from autonomy.site import LAKE, TANK, Site

_RANGE_STDS = 4.0
"""So many standard deviations are taken for the whole range that a channel can have."""
_LEAST_SHARE, _MOST_SHARE = 1e-12, 1e6


def field_preset(site: Site) -> FieldConfig:
    """Return the settings with which a water is mapped before anybody learned or set others.

    A channel without a preset takes that of the tank or the lake: its lengths as shares of the
    water, its variances as shares of the range that the channel can have. That is wide where the
    range is; the first learning from measurements replaces it.
    """
    known = FIELD_PRESETS.get(site.variable)
    if known is not None:
        return known
    like, of = ("blue_light", TANK) if site.kind == "tank" else ("chlorophyll", LAKE)
    preset = FIELD_PRESETS[like]
    lengths = tuple(ours / theirs for ours, theirs in zip(_sides(site), _sides(of), strict=True))
    mean, std = _expected(CHANNELS.get(site.variable))
    factor = std**2 / preset.single.signal_variance

    def scaled(kernel: KernelParameters) -> KernelParameters:
        north, east, down = lengths
        return kernel.model_copy(
            update={
                "length_x_m": kernel.length_x_m * north,
                "length_y_m": kernel.length_y_m * east,
                "length_z_m": kernel.length_z_m * down,
                "signal_variance": _believed(kernel.signal_variance * factor),
                "noise_variance": _believed(kernel.noise_variance * factor),
            }
        )

    return preset.model_copy(
        update={
            "variable": site.variable,
            "prior_mean": mean,
            "single": scaled(preset.single),
            "levels": tuple(map(scaled, preset.levels)),
            "joint_levels": tuple(map(scaled, preset.joint_levels)),
        }
    )


def _sides(site: Site) -> tuple[float, float, float]:
    """Return the sizes of the part to explore, m."""
    box = site.domain
    return box.x_max_m - box.x_min_m, box.y_max_m - box.y_min_m, box.depth_max_m


def _expected(channel: Channel | None) -> tuple[float, float]:
    """Return mean and standard deviation of what a channel may tell, in the model's scale."""
    if channel is None or not np.isfinite([channel.low, channel.high]).all():
        return 0.0, 1.0
    ends = to_model(channel.scale, np.array([channel.low, channel.high]), channel.log_floor)
    return float(np.mean(ends)), max(float(np.ptp(ends)) / _RANGE_STDS, 1e-6)


def _believed(variance: float) -> float:
    return float(np.clip(variance, _LEAST_SHARE, _MOST_SHARE))
