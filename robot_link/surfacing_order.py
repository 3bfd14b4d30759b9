"""Rules by which a robot comes up early, as the integers that travel with its mission."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

RULES_MAX = 4
"""Rules by a value of one mission."""
HOLD_OFF_MAX_S = 86_400
SAMPLES_MAX = 1_000_000
_NUMBERS_MAX = range(1, 256)
"""Numbers of channels on the wire."""
_HEAD = 3
_EACH = 4
_DIGITS = 7
_MANTISSA_MAX = 10**_DIGITS - 1
_EXPONENT_MAX = 30


@dataclass(frozen=True, slots=True)
class ValueLimit:
    """A value beyond which a robot comes up."""

    channel: int
    """Number in the catalogue of channels."""
    is_above: bool
    """Whether greater values bring it up; else smaller ones."""
    limit: float
    """In the channel's unit, rounded to seven digits by ``SurfacingOrder.of``."""

    def is_crossed(self, value: float) -> bool:
        """Tell whether a value brings it up."""
        return value > self.limit if self.is_above else value < self.limit


@dataclass(frozen=True, slots=True)
class SurfacingOrder:
    """When a robot comes up early; build it with ``of`` or ``from_integers``."""

    samples_waiting: int
    """Unacknowledged samples that bring it up, from 1 on; 0 for none."""
    hold_off_s: int
    """After such a rule brought it up, none does for so long."""
    on_value: tuple[ValueLimit, ...] = ()

    @classmethod
    def of(
        cls, samples_waiting: int | None, hold_off_s: float, on_value: Sequence[ValueLimit]
    ) -> Self:
        """Round rules to what travels.

        Raises:
            ValueError: If something does not fit; the sentence names it.
        """
        order = cls(samples_waiting or 0, round(hold_off_s), tuple(on_value))
        return cls.from_integers(order.integers())

    def integers(self) -> tuple[int, ...]:
        """Return samples, hold-off s, number of limits; of each channel, 1 above or 0 below, value.

        A value is a mantissa of at most seven digits and its power of ten, so all are exact in a
        float32.

        Raises:
            ValueError: If a value does not fit.
        """
        numbers = [self.samples_waiting, self.hold_off_s, len(self.on_value)]
        for one in self.on_value:
            numbers += (one.channel, int(one.is_above), *_decimal(one.limit))
        return tuple(numbers)

    @classmethod
    def from_integers(cls, integers: Sequence[int]) -> Self:
        """Rebuild rules; zeros behind them do not matter.

        Raises:
            ValueError: If they are none; the sentence says what is wrong.
        """
        if len(integers) < _HEAD or not 0 <= integers[2] <= RULES_MAX:
            raise ValueError(f"rules of surfacing are cut short, or more than {RULES_MAX}")
        samples, hold_off_s, count = integers[:_HEAD]
        if not (0 <= samples <= SAMPLES_MAX and 0 <= hold_off_s <= HOLD_OFF_MAX_S):
            raise ValueError("samples or hold-off of rules of surfacing are out of range")
        end = _HEAD + _EACH * count
        if len(integers) < end or any(integers[end:]):
            raise ValueError("rules of surfacing are cut short, or followed by more")
        limits = [_limit(integers[at : at + _EACH]) for at in range(_HEAD, end, _EACH)]
        return cls(samples, hold_off_s, tuple(limits))


def _limit(integers: Sequence[int]) -> ValueLimit:
    channel, side, mantissa, exponent = integers
    if channel not in _NUMBERS_MAX or side not in (0, 1):
        raise ValueError(f"a rule of surfacing names channel {channel}, side {side}")
    if abs(mantissa) > _MANTISSA_MAX or abs(exponent) > _EXPONENT_MAX:
        raise ValueError("the value of a rule of surfacing is out of range")
    return ValueLimit(channel, side == 1, float(f"{mantissa}e{exponent}"))


def _decimal(value: float) -> tuple[int, int]:
    """Return mantissa and power of ten of a number rounded to seven digits, without end zeros."""
    if not math.isfinite(value):
        raise ValueError("the value of a rule of surfacing is not finite")
    digits, power = f"{value:.{_DIGITS - 1}e}".split("e")
    mantissa, exponent = int(digits.replace(".", "")), int(power) - _DIGITS + 1
    while mantissa and mantissa % 10 == 0:
        mantissa, exponent = mantissa // 10, exponent + 1
    if mantissa and abs(exponent) > _EXPONENT_MAX:
        raise ValueError(f"{value:g} as the value of a rule of surfacing is out of range")
    return (mantissa, exponent) if mantissa else (0, 0)
