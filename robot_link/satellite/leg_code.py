"""The legs of a mission as few and small integers, from which the very same legs are rebuilt.

Most of a leg follows from the rest: where a spiral ends from its circle, the heading from the way,
the duration from the way and the speed, the energy from the duration and the prices. So each of
these travels as its difference to what both ends expect, which is mostly 0. Row of a leg:

    head        kind modulo 4 + 4 if a circle or jump follows + 8 if no differences follow + 16 if
                the kind is a stay at the surface, which is the only one above 3
    circle      radius mm, turn mrad; of a spiral also its heading mrad. Of other legs the jump
                north and east, mm
    ends        north, east: mm from where the leg is expected to end; depth mm, of a swim from
                where it began
    differences speed mm/s to the leg of that kind before; duration ds, energy 1/1000, heading mrad
                (of a stay its radius mm, expected to be 0)
"""

import math
from collections.abc import Iterator, Sequence

from autonomy.planner.config import EnergyConfig

LegIntegers = tuple[int, ...]
"""As of ``robot_link.mission.leg_integers``."""

_GLIDE, _SPIRAL, _DIVE, _SWIM, _KEEP = range(5)
_KIND_MASK = 3
_IS_KEEP = 16
_HAS_CIRCLE = 4
_IS_PLAIN = 8
_HEADS = (*range(16), *range(_IS_KEEP, 32, 4))
MOST_LEGS = 1000
"""More are no mission that a robot flies between two visits."""
_WIRE_MAX = 2**24
_OFFSET_MAX = 2**40


def packed_legs(
    start: tuple[int, int], legs: Sequence[LegIntegers], prices: EnergyConfig
) -> list[int]:
    """Return the rows of all legs, one behind the other.

    Args:
        start: Where the first leg begins, north and east, mm.
        legs: The legs' integers.
        prices: What energy is expected to be.
    """
    path = _Path(start)
    rows: list[int] = []
    for kind, x, y, z, speed, duration, energy, heading, radius, turn in legs:
        circle = (radius, turn) if radius or turn else ()
        is_turn = bool(circle) and kind == _SPIRAL
        path.begin(kind, circle, heading if is_turn else None)
        expected_x, expected_y, expected_z = path.expected_end()
        path.end((x, y, z))
        differences = (
            speed - path.expected_speed(),
            duration - path.expected_duration(speed),
            energy - _expected_energy(kind, duration, prices),
            heading - path.expected_heading(),
        )
        path.speeds[kind] = speed
        is_plain = not any(differences)
        head = _head_of(kind) + _HAS_CIRCLE * bool(circle) + _IS_PLAIN * is_plain
        rows += (head, *circle, *((heading,) if is_turn else ()))
        rows += (x - expected_x, y - expected_y, z - expected_z)
        rows += () if is_plain else differences
    return rows


def unpacked_legs(
    rows: Sequence[int], start: tuple[int, int], prices: EnergyConfig
) -> tuple[LegIntegers, ...]:
    """Rebuild the legs from their rows; arguments as of ``packed_legs``.

    Raises:
        ValueError: If the rows are none, or more than a robot takes.
    """
    path = _Path(start)
    numbers = iter(rows)
    legs: list[LegIntegers] = []
    for head in numbers:
        if head not in _HEADS or len(legs) == MOST_LEGS:
            raise ValueError(f"leg {len(legs) + 1} of the mission is none")
        leg = _next_leg(path, head, numbers, prices)
        if any(abs(number) >= _WIRE_MAX for number in leg):
            raise ValueError(f"leg {len(legs) + 1} of the mission is out of the wire's range")
        legs.append(leg)
    return tuple(legs)


def _head_of(kind: int) -> int:
    return _IS_KEEP if kind == _KEEP else kind


def _next_leg(
    path: "_Path", head: int, numbers: Iterator[int], prices: EnergyConfig
) -> LegIntegers:
    kind = _KEEP if head & _IS_KEEP else head & _KIND_MASK
    circle = (_number(numbers), _number(numbers)) if head & _HAS_CIRCLE else ()
    path.begin(kind, circle, _number(numbers) if circle and kind == _SPIRAL else None)
    x, y, z = (expected + _number(numbers) for expected in path.expected_end())
    path.end((x, y, z))
    differences = (0,) * 4 if head & _IS_PLAIN else tuple(_number(numbers) for _ in range(4))
    speed = path.expected_speed() + differences[0]
    duration = path.expected_duration(speed) + differences[1]
    energy = _expected_energy(kind, duration, prices) + differences[2]
    heading = path.expected_heading() + differences[3]
    path.speeds[kind] = speed
    return (kind, x, y, z, speed, duration, energy, heading, *(circle or (0, 0)))


def _number(numbers: Iterator[int]) -> int:
    number = next(numbers, None)
    if number is None:
        raise ValueError("the last leg of the mission is cut short")
    if abs(number) > _OFFSET_MAX:
        raise ValueError("a number of the mission is out of the wire's range")
    return number


class _Path:
    """What both ends expect of the next leg, from the legs before it."""

    def __init__(self, start: tuple[int, int]) -> None:
        self._start = (*start, 0)
        self._end = self._start
        self._kind = _GLIDE
        self._circle: tuple[int, ...] = ()
        self._heading: int | None = None
        self.speeds = [0] * (_KEEP + 1)
        """Of the newest leg of each kind, mm/s."""

    def begin(self, kind: int, circle: tuple[int, ...], heading: int | None) -> None:
        """Begin a leg; ``heading`` is known of a circle alone."""
        self._kind, self._circle, self._heading = kind, circle, heading
        self._start = self._end
        if circle and kind != _SPIRAL:
            x, y, z = self._end
            self._start = (x + circle[0], y + circle[1], z)

    def end(self, end: tuple[int, int, int]) -> None:
        """Say where the leg ends."""
        self._end = end

    def expected_end(self) -> tuple[int, int, int]:
        """Return where the leg should end, mm; but for a swim its depth as from the surface."""
        x, y, z = self._start
        if self._heading is not None:
            radius, turn = self._circle
            chord = 2.0 * radius * math.sin(turn / 2e3)
            direction = self._heading / 1e3 + turn / 2e3
            return (
                x + round(math.copysign(1.0, turn) * chord * math.cos(direction)),
                y + round(math.copysign(1.0, turn) * chord * math.sin(direction)),
                0,
            )
        return (x, y, z if self._kind == _SWIM else 0)

    def expected_speed(self) -> int:
        """Return the speed of the last leg of this kind, mm/s."""
        return self.speeds[self._kind]

    def expected_duration(self, speed: int) -> int:
        """Return how long the leg should take, ds: by depth, of a swim by distance."""
        if speed == 0 or self._kind == _KEEP:
            return 0
        way = abs(self._end[2] - self._start[2])
        if self._kind == _SWIM:
            way = math.dist(self._start, self._end)
        return round(10.0 * way / speed)

    def expected_heading(self) -> int:
        """Return the direction of the way, mrad; 0 of a stay, which says its radius instead."""
        if self._kind == _KEEP:
            return 0
        if self._heading is not None:
            return self._heading
        north, east = self._end[0] - self._start[0], self._end[1] - self._start[1]
        return round(1e3 * math.atan2(east, north))


def _expected_energy(kind: int, duration: int, prices: EnergyConfig) -> int:
    """Return what a leg of some duration, ds, should cost, in thousandths of an energy unit."""
    work = {_GLIDE: prices.glide, _SPIRAL: prices.spiral, _DIVE: prices.dive}
    rate = 2.0 * math.pi * prices.tail_frequency_hz * prices.tail_amplitude_rad
    swimming = prices.swim_factor * rate**2 / 2.0 * duration / 10.0
    return round(1e3 * (work.get(kind, swimming) + prices.time_factor * duration / 10.0))
