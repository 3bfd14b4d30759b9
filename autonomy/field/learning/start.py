"""Where the search for hyperparameters begins."""

from collections.abc import Sequence

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field.config import KernelParameters

_EXTENT_SHARE = 0.3
_NOISE_SHARE = 0.1
_LEAST_SHARE, _MOST_SHARE = 0.05, 1.0
_LARGEST = 1e6


def starting_kernels(
    present: KernelParameters,
    points: FloatArray,
    values: FloatArray,
    count: int,
    rng: np.random.Generator,
) -> list[KernelParameters]:
    """Return kernels from which to search.

    The first is the present one, the second suits the extent and the spread of the samples, and
    the others are drawn about that: length scales from a twentieth of the extent up to all of it.

    Args:
        present: Kernel now in use; all have its shape.
        points: Where the samples were taken, shape ``(n, 3)``, m.
        values: Measurements less their mean, shape ``(n,)``.
        count: How many kernels.
        rng: Draws those after the second.
    """
    extent = np.ptp(points, axis=0)
    spread = max(float(np.var(values)), np.finfo(np.float64).tiny)
    kernels = [present]
    for number in range(1, count):
        if number == 1:
            shares, signal, noise = np.full(3, _EXTENT_SHARE), spread, _NOISE_SHARE * spread
        else:
            shares = np.exp(rng.uniform(np.log(_LEAST_SHARE), np.log(_MOST_SHARE), 3))
            signal = spread * 10.0 ** float(rng.uniform(-0.5, 0.5))
            noise = spread * 10.0 ** float(rng.uniform(-3.0, -0.5))
        lengths = np.where(extent > 0.0, shares * extent, present.length_scales_m())
        kernels.append(_kernel(present, signal, lengths, noise))
    return kernels[:count]


def kernels_of_extent(
    extent_m: FloatArray, shares: Sequence[float], signal_variance: float, noise_variance: float
) -> tuple[KernelParameters, ...]:
    """Return kernels whose length scales are shares of the extent of the samples.

    Args:
        extent_m: North, east and down, shape ``(3,)``.
        shares: One for each kernel.
        signal_variance: Of every kernel.
        noise_variance: Of every kernel.
    """
    kernels: list[KernelParameters] = []
    for share in shares:
        x, y, z = (share * extent_m).tolist()
        kernels.append(
            KernelParameters(
                signal_variance=signal_variance,
                length_x_m=x,
                length_y_m=y,
                length_z_m=z,
                noise_variance=noise_variance,
            )
        )
    return tuple(kernels)


def _kernel(
    like: KernelParameters, signal: float, lengths: FloatArray, noise: float
) -> KernelParameters:
    x, y, z = np.minimum(lengths, _LARGEST).tolist()
    return KernelParameters(
        shape=like.shape,
        signal_variance=min(signal, _LARGEST),
        length_x_m=x,
        length_y_m=y,
        length_z_m=z,
        noise_variance=min(noise, _LARGEST),
    )
