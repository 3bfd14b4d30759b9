"""The order to follow a target, as a mission of format 4 carries it.

Every field of ``TrackingConfig`` travels as one small integer, group by group in the order of
declaration: the two coordinates of the target as whole millimetres, choices by their number, all
other numbers rounded as ``robot_link.short_decimal`` says. Both ends compute with what was rounded,
and a mission's hash covers the integers.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from autonomy.tracking.config import TrackingConfig
from robot_link.short_model import CODE_MAX, codes_of, field_count, model_of, sentence_of

MOST_INTEGERS = 128
"""More numbers are no order."""
_IN_MILLIMETRES = ("north_m", "east_m")
"""Where a target is travels in full: a beacon's place must not be rounded."""
_OWNER = "an order to follow a target"


@dataclass(frozen=True, slots=True)
class TargetSettings:
    """Settings as the integers that travel; build it with ``of`` or ``from_integers``.

    What they say was checked then, so ``config`` does not fail.
    """

    codes: tuple[int, ...]
    """One for each field."""

    @classmethod
    def of(cls, config: TrackingConfig) -> Self:
        """Round settings to what travels.

        Raises:
            ValueError: If a number does not fit, or what is rounded is no order; it is named.
        """
        return cls(codes_of(config, "these settings", in_thousandths=_IN_MILLIMETRES))

    def config(self) -> TrackingConfig:
        """Return the settings as both ends compute with them."""
        return model_of(TrackingConfig, self.codes, _OWNER, in_thousandths=_IN_MILLIMETRES)

    def integers(self) -> tuple[int, ...]:
        """Return all numbers, each exact in a float32."""
        return self.codes

    @classmethod
    def from_integers(cls, integers: Sequence[int]) -> Self:
        """Rebuild an order from ``integers``; zeros behind them do not matter.

        Raises:
            ValueError: If they are none; the sentence says what is wrong.
        """
        if len(integers) > MOST_INTEGERS or any(abs(code) >= CODE_MAX for code in integers):
            raise ValueError(f"{_OWNER} is too many numbers, or too large ones")
        count = field_count(TrackingConfig)
        if len(integers) < count:
            raise ValueError(f"{_OWNER} has {count} numbers, not {len(integers)}")
        if any(integers[count:]):
            raise ValueError(f"{_OWNER} is followed by more")
        order = cls(tuple(integers[:count]))
        try:
            order.config()
        except ValueError as error:
            raise ValueError(f"{_OWNER} is impossible: {sentence_of(error)}") from error
        return order
