"""What messages cost."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from robot_link.satellite.config import Tariff


@dataclass(frozen=True, slots=True)
class Quote:
    """What some messages cost together."""

    messages: int
    bytes: int
    credits: int
    price: float
    """In the tariff's currency."""


def credits(size: int, tariff: Tariff | None = None) -> int:
    """Return the credits of one message of ``size`` bytes; one that is empty costs one."""
    return max(1, math.ceil(size / (tariff or Tariff()).bytes_per_credit))


def quote(sizes: Iterable[int], tariff: Tariff | None = None) -> Quote:
    """Return what messages of these sizes cost together."""
    tariff = tariff or Tariff()
    all_sizes = tuple(sizes)
    charged = sum(credits(size, tariff) for size in all_sizes)
    return Quote(len(all_sizes), sum(all_sizes), charged, charged * tariff.price_per_credit)
