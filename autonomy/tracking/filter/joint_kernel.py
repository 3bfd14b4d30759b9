"""Compiled steps of the joint filter of place, velocity and range delay; ``joint`` says when.

A *particle* is seven numbers: place north and east in the frame of the robot's own positions, m,
velocity, m/s, delay of ranges beyond what is told, s, its speed class, and the rate at which it
turns, rad/s. ``reference.joint`` is the readable form. No kernel allocates.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import kernel

NORTH, EAST, NORTH_RATE, EAST_RATE, DELAY, CLASS, TURN_RATE = range(7)
"""Columns of a particle."""
SIZE = 7
RESTING, SLOW, FAST = range(3)
"""Speed classes, and rows of a table of them."""
KEPT, FRESH, STEADY, JUMPS = range(4)
"""Columns of a table of speed classes: share of its velocity that a target keeps over the step,
standard deviation of what it gains instead, standard deviation of its velocity at any time (m/s,
per axis), and probability of a jump within the step."""
ANEW = 0.5
"""Share of the jumps into any class and any velocity; the others only turn."""
TURN_RAD, FASTER = 1.0, 0.2
"""Standard deviations of a turn, and of the logarithm by which it changes the speed."""
STRAIGHT = 0.5
"""Share of the jumps after which a target swims straight on; after the others it circles."""


@kernel
def drift(
    particles: FloatArray,
    dt: float,
    walk_m: float,
    delay_walk_s: float,
    turn_rate_std: float,
    classes: FloatArray,
    normal: FloatArray,
    uniform: FloatArray,
) -> None:
    """Let ``dt`` pass, in place.

    Args:
        particles: Shape ``(n, 6)``.
        dt: Time, s.
        walk_m: Standard deviation by which each place strays meanwhile, per axis.
        delay_walk_s: The same of each delay, which stays positive.
        turn_rate_std: Standard deviation of the rate at which a target circles, rad/s.
        classes: Table of speed classes for this step, shape ``(3, 4)``.
        normal: Standard normal numbers, shape ``(n, 6)``.
        uniform: Uniform in 0..1, shape ``(n, 4)``.
    """
    for i in range(len(particles)):
        kind = int(particles[i, CLASS])
        north, east = particles[i, NORTH_RATE], particles[i, EAST_RATE]
        is_jump = uniform[i, 0] < classes[kind, JUMPS]
        if is_jump:
            circles = uniform[i, 3] >= STRAIGHT
            particles[i, TURN_RATE] = turn_rate_std * normal[i, 5] if circles else 0.0
        if not is_jump:
            kept, fresh = classes[kind, KEPT], classes[kind, FRESH]
            angle = particles[i, TURN_RATE] * dt
            c, s = kept * math.cos(angle), kept * math.sin(angle)
            particles[i, NORTH_RATE] = c * north - s * east + fresh * normal[i, 2]
            particles[i, EAST_RATE] = s * north + c * east + fresh * normal[i, 3]
        elif uniform[i, 1] < ANEW:
            kind = min(int(3.0 * uniform[i, 2]), 2)
            particles[i, CLASS] = kind
            particles[i, NORTH_RATE] = classes[kind, STEADY] * normal[i, 2]
            particles[i, EAST_RATE] = classes[kind, STEADY] * normal[i, 3]
        else:
            turn, times = TURN_RAD * normal[i, 2], math.exp(FASTER * normal[i, 3])
            c, s = times * math.cos(turn), times * math.sin(turn)
            particles[i, NORTH_RATE] = c * north - s * east
            particles[i, EAST_RATE] = s * north + c * east
        particles[i, NORTH] += 0.5 * dt * (north + particles[i, NORTH_RATE])
        particles[i, EAST] += 0.5 * dt * (east + particles[i, EAST_RATE])
        particles[i, NORTH] += walk_m * normal[i, 0]
        particles[i, EAST] += walk_m * normal[i, 1]
        particles[i, DELAY] = abs(particles[i, DELAY] + delay_walk_s * normal[i, 4])


@kernel
def weigh(
    particles: FloatArray,
    weights: FloatArray,
    logs: FloatArray,
    way: FloatArray,
    grid_s: float,
    ages_s: FloatArray,
    ranges_m: FloatArray,
    std_m: float,
    outlier_stds: float,
) -> float:
    """Weigh every particle by ranges, in place; the weights add up to 1 again.

    A range that arrives now is that between robot and target at its told age and the particle's
    delay before now.

    Args:
        particles: Shape ``(n, 6)``, as of now.
        weights: Shape ``(n,)``.
        logs: Room for one number for each particle.
        way: Where the robot was, every ``grid_s``, the newest last; shape ``(k, 2)``.
        grid_s: Time between two rows of ``way``, s.
        ages_s: How long ago each range held by what is told, shape ``(m,)``.
        ranges_m: Horizontal ranges, shape ``(m,)``.
        std_m: Their standard deviation.
        outlier_stds: A range contradicts no particle by more standard deviations than this.

    Returns:
        Log of the mean likelihood of one range, against 0 for one that all particles expected.
    """
    count, last, most = len(ranges_m), len(way) - 1, -math.inf
    widest = outlier_stds * outlier_stds
    for i in range(len(particles)):
        total = 0.0
        for j in range(count):
            back_s = ages_s[j] + particles[i, DELAY]
            steps = back_s / grid_s
            whole = int(steps)
            share = steps - whole
            newer, older = max(last - whole, 0), max(last - whole - 1, 0)
            own_north = way[newer, 0] + share * (way[older, 0] - way[newer, 0])
            own_east = way[newer, 1] + share * (way[older, 1] - way[newer, 1])
            north = particles[i, NORTH] - particles[i, NORTH_RATE] * back_s - own_north
            east = particles[i, EAST] - particles[i, EAST_RATE] * back_s - own_east
            off = (ranges_m[j] - math.sqrt(north * north + east * east)) / std_m
            total -= 0.5 * min(off * off, widest)
        logs[i] = total
        most = max(most, total)
    whole_weight = 0.0
    for i in range(len(particles)):
        weights[i] *= math.exp(logs[i] - most)
        whole_weight += weights[i]
    for i in range(len(particles)):
        weights[i] /= whole_weight
    return (math.log(whole_weight) + most) / count


@kernel
def turn(
    particles: FloatArray,
    own_north: float,
    own_east: float,
    own_north_rate: float,
    own_east_rate: float,
    angles: FloatArray,
) -> None:
    """Turn each particle's place and velocity, seen from the robot, by an angle, in place.

    A robot on a straight course hears the same ranges of a target and of one that is turned so.

    Args:
        particles: Shape ``(n, 6)``.
        own_north: Where the robot is, m.
        own_east: The same.
        own_north_rate: How it moves, m/s.
        own_east_rate: The same.
        angles: Shape ``(n,)``, rad.
    """
    for i in range(len(particles)):
        c, s = math.cos(angles[i]), math.sin(angles[i])
        x, y = particles[i, NORTH] - own_north, particles[i, EAST] - own_east
        particles[i, NORTH], particles[i, EAST] = (
            own_north + c * x - s * y,
            own_east + s * x + c * y,
        )
        x, y = particles[i, NORTH_RATE] - own_north_rate, particles[i, EAST_RATE] - own_east_rate
        particles[i, NORTH_RATE] = own_north_rate + c * x - s * y
        particles[i, EAST_RATE] = own_east_rate + s * x + c * y


@kernel
def middle(
    particles: FloatArray, weights: FloatArray, north_m: float, east_m: float, near_m: float
) -> tuple[float, float, float]:
    """Return the mean place of what is near a place, and its weight; the place itself for none.

    Args:
        particles: Shape ``(n, 6)``.
        weights: Shape ``(n,)``.
        north_m: The place.
        east_m: The same.
        near_m: How far off is near.
    """
    total = north = east = 0.0
    for i in range(len(particles)):
        x, y = particles[i, NORTH] - north_m, particles[i, EAST] - east_m
        if x * x + y * y < near_m * near_m:
            total += weights[i]
            north += weights[i] * x
            east += weights[i] * y
    if total > 0.0:
        return north_m + north / total, east_m + east / total, total
    return north_m, east_m, 0.0


def warm_up() -> None:
    """Compile every kernel of this module."""
    particles, weights = np.zeros((2, SIZE)), np.full(2, 0.5)
    particles[:, NORTH] = 1.0
    drift(particles, 0.1, 0.1, 0.1, 0.1, np.ones((3, 4)), np.zeros((2, 6)), np.zeros((2, 4)))
    ages, ranges, way = np.zeros(1), np.ones(1), np.zeros((2, 2))
    weigh(particles, weights, np.zeros(2), way, 0.1, ages, ranges, 1.0, 4.0)
    turn(particles, 0.0, 0.0, 0.0, 0.0, np.zeros(2))
    middle(particles, weights, 0.0, 0.0, 1.0)
