"""Which samples to send when only few can be sent: those that change the map most.

Without any sample the map's variance is the kernel's prior. Each sample takes some of it away, the
less the worse the robot knew where it was. The samples are chosen one after the other: always the
one that takes most variance away from the places of all samples together, given those chosen
before. So they spread over what was surveyed, and a well located one is preferred.

Source:
    Greedy reduction of the posterior variance: Krause, Singh and Guestrin, Near-optimal sensor
    placements in Gaussian processes, JMLR 9 (2008). Noise by fidelity: Coleman, thesis,
    section 5.4.4.
"""

from collections.abc import Sequence

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.field.config import KernelParameters
from autonomy.field.fidelity import fidelity_level
from autonomy.field.model.kernel import covariance
from autonomy.field.thinning import space_filling
from robot_link.messages import Sample
from robot_link.onboard_settings import DigestSettings
from robot_link.satellite.sample_code import can_travel, most_that_fit

CANDIDATES_MAX = 256
"""Of more samples an evenly spread part is considered: an onboard computer is small."""
_CHOSEN_MAX = 32
"""More do not fit the longest record."""
_LEAST_NOISE = 1e-9


def choose(
    samples: Sequence[Sample], settings: DigestSettings | None, max_bytes: int
) -> tuple[Sample, ...]:
    """Return the samples to send, the one that changes the map most first.

    Args:
        samples: What the station does not have yet, of one variable; those that are no numbers, or
            too great for a record, are left out.
        settings: Kernel and noise by fidelity; without them samples are spread in space.
        max_bytes: Bytes that they may take in a record (``record.sample_room``).
    """
    samples = [sample for sample in samples if can_travel(sample)]
    if not samples or max_bytes <= 0:
        return ()
    points = np.array([sample.position_ned for sample in samples])  # (n, 3)
    scales = (1.0, 1.0, 1.0) if settings is None else settings.kernel.length_scales_m()
    kept = space_filling(points, CANDIDATES_MAX, scales)
    if settings is None:
        order = kept[_spread(points[kept], scales)]
    else:
        std_m = np.array([samples[index].position_std_m for index in kept])
        levels = fidelity_level(std_m, settings.thresholds_m)
        noise = np.array(settings.level_noise_variances)[levels]
        order = kept[most_telling(points[kept], noise, settings.kernel, _CHOSEN_MAX)]
    return most_that_fit([samples[index] for index in order], max_bytes)


def most_telling(
    points: FloatArray, noise_variance: FloatArray, kernel: KernelParameters, count: int
) -> IntArray:
    r"""Choose samples one by one, each the one that takes most variance away.

    With the posterior covariance :math:`C` given the samples chosen so far, sample :math:`i` takes
    :math:`\sum_p C_{pi}^2 / (C_{ii} + s_i)` away from the points; then :math:`C` loses
    :math:`c_i c_i^T / (C_{ii} + s_i)`. ``O(count n^2)``.

    Args:
        points: Where the samples were taken, shape ``(n, 3)``, m.
        noise_variance: Of each sample, shape ``(n,)``.
        kernel: Prior covariance of the field.
        count: How many to choose at most.

    Returns:
        Indices in the order of choice, shape ``(min(n, count),)``.
    """
    remaining = covariance(points, points, kernel)  # (n, n)
    noise = np.maximum(noise_variance, _LEAST_NOISE * kernel.signal_variance)
    is_free = np.ones(len(points), dtype=bool)
    chosen: list[int] = []
    while len(chosen) < min(count, len(points)):
        total = np.diagonal(remaining) + noise
        gain = np.einsum("pi,pi->i", remaining, remaining) / total
        best = int(np.argmax(np.where(is_free, gain, -np.inf)))
        column = remaining[:, best].copy()
        remaining -= np.outer(column, column) / total[best]
        is_free[best] = False
        chosen.append(best)
    return np.array(chosen, dtype=np.int64)


def _spread(points: FloatArray, scales: tuple[float, float, float]) -> IntArray:
    """Return an order in which each beginning is spread over the points."""
    order: list[int] = []
    for count in range(1, min(_CHOSEN_MAX, len(points)) + 1):
        taken = set(order)
        order += [int(one) for one in space_filling(points, count, scales) if int(one) not in taken]
    return np.array(order, dtype=np.int64)
