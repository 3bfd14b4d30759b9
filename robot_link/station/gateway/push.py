"""What gateways' pushes have in common: how they are refused, numbers in them, and payloads."""

import math
from typing import Literal

from robot_link.station.gateway.gateway import MO_BYTES_MAX


class PushRefusal(Exception):  # noqa: N818 - an answer, not a fault of the program
    """A push is not taken.

    Args:
        reason: ``malformed`` if it is no push of this gateway, ``signature`` if nothing proves
            that the gateway sent it, ``expired`` if that proof holds no longer, ``disagrees`` if
            its body says other than what was signed.
        sentence: What is wrong; it repeats nothing that the push said.
    """

    def __init__(
        self, reason: Literal["malformed", "signature", "expired", "disagrees"], sentence: str
    ) -> None:
        super().__init__(sentence)
        self.reason = reason


def whole_number(value: object, name: str, largest: int) -> int:
    """Return a number of a push that may stand there as text.

    Raises:
        PushRefusal: If it is not a whole number of ``0..largest``.
    """
    if isinstance(value, str) and value.isascii() and value.isdecimal() and len(value) <= 10:
        value = int(value)
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= largest:
        raise PushRefusal("malformed", f"{name} is not a whole number of 0 to {largest}.")
    return value


def place_of(
    latitude: object, longitude: object, radius_km: object
) -> tuple[float | None, float | None, float | None]:
    """Return latitude and longitude in degrees and the radius in km; None where they are not.

    A message is worth more than the place where the network believes its modem to be: a place
    that cannot be is left out, and the message is taken.
    """
    latitude_deg, longitude_deg, cep_km = map(_number, (latitude, longitude, radius_km))
    if latitude_deg is None or longitude_deg is None:
        return None, None, None
    if abs(latitude_deg) > 90 or abs(longitude_deg) > 180:
        return None, None, None
    return latitude_deg, longitude_deg, None if cep_km is None or cep_km < 0 else cep_km


def payload_fault(data: bytes) -> str:
    """Return what is wrong with a payload's length; empty when nothing is."""
    if len(data) <= MO_BYTES_MAX:
        return ""
    return f"{len(data)} bytes are more than the {MO_BYTES_MAX} that a modem sends"


def _number(value: object) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return None
    try:
        number = float(value)
    except (ValueError, OverflowError):
        return None
    return number if math.isfinite(number) else None
