"""Joint filter of place, velocity and range delay: the readable reference of ``joint_kernel``."""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.tracking.filter import joint_kernel as k


def drift(
    particles: FloatArray,
    dt: float,
    walk_m: float,
    delay_walk_s: float,
    turn_rate_std: float,
    classes: FloatArray,
    normal: FloatArray,
    uniform: FloatArray,
) -> FloatArray:
    """Return the particles after ``dt``; arguments as of ``joint_kernel.drift``.

    A target keeps its class and most of its velocity (an Ornstein-Uhlenbeck process), which turns
    with it, or begins another class at any velocity of it, or turns at once; after either it swims
    straight on or circles.
    """
    table = classes[particles[:, k.CLASS].astype(np.int64)]  # (n, 4)
    before = particles[:, k.NORTH_RATE] + 1j * particles[:, k.EAST_RATE]  # (n,)
    noise = normal[:, 2] + 1j * normal[:, 3]
    jumps = uniform[:, 0] < table[:, k.JUMPS]
    anew = jumps & (uniform[:, 1] < k.ANEW)
    drawn = np.minimum((3.0 * uniform[:, 2]).astype(np.int64), 2)
    goes_on = table[:, k.KEPT] * before * np.exp(1j * dt * particles[:, k.TURN_RATE])
    goes_on += table[:, k.FRESH] * noise
    turned = before * np.exp(k.FASTER * normal[:, 3] + 1j * k.TURN_RAD * normal[:, 2])
    after = np.where(jumps, turned, goes_on)
    after = np.where(anew, classes[drawn, k.STEADY] * noise, after)
    place = particles[:, k.NORTH] + 1j * particles[:, k.EAST] + 0.5 * dt * (before + after)
    place += walk_m * (normal[:, 0] + 1j * normal[:, 1])
    delay = np.abs(particles[:, k.DELAY] + delay_walk_s * normal[:, 4])
    kind = np.where(anew, drawn, particles[:, k.CLASS])
    fresh_rate = np.where(uniform[:, 3] < k.STRAIGHT, 0.0, turn_rate_std * normal[:, 5])
    rate = np.where(jumps, fresh_rate, particles[:, k.TURN_RATE])
    return np.column_stack(
        [np.real(place), np.imag(place), np.real(after), np.imag(after), delay, kind, rate]
    )


def weights_after(
    particles: FloatArray,
    weights: FloatArray,
    way: FloatArray,
    grid_s: float,
    ages_s: FloatArray,
    ranges_m: FloatArray,
    std_m: float,
    outlier_stds: float,
) -> tuple[FloatArray, float]:
    """Return the weights after ranges, and the log of the mean likelihood of one of them.

    Arguments are those of ``joint_kernel.weigh``.
    """
    times = -grid_s * np.arange(len(way))[::-1]
    total = np.zeros(len(particles))
    for age_s, range_m in zip(ages_s, ranges_m, strict=True):
        back_s = age_s + particles[:, k.DELAY]
        own = np.column_stack([np.interp(-back_s, times, way[:, axis]) for axis in (0, 1)])
        then = particles[:, :2] - back_s[:, None] * particles[:, 2:4]
        off = (range_m - np.hypot(*(then - own).T)) / std_m
        total -= 0.5 * np.minimum(off * off, outlier_stds**2)
    weighed = weights * np.exp(total)
    return weighed / weighed.sum(), float(np.log(weighed.sum())) / len(ranges_m)
