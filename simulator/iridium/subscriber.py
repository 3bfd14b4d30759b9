"""Who may use the satellite service: accounts and the modems that they own."""

from dataclasses import dataclass
from typing import Literal

Carrier = Literal["rockblock", "directip", "cloudloop"]

_BYTES_PER_CREDIT = 50
_IMEI_DIGITS = 15


@dataclass(slots=True)
class Account:
    """A customer of the service; may be changed at any time, as by an office that sends bills."""

    username: str
    password: str
    credits_left: int | None = None
    """None never runs out."""


@dataclass(slots=True)
class Subscriber:
    """A modem that is known to the service; the switches may be changed at any time."""

    imei: str
    account: Account
    carrier: Carrier = "rockblock"
    """Through which gateway the modem's messages go."""
    serial: int = 0
    """The serial number of the device around the modem."""
    thing: str = ""
    """Cloudloop's name of the device; empty takes the IMEI."""
    has_line_rental: bool = True
    is_attached: bool = True
    is_ring_enabled: bool = True

    def __post_init__(self) -> None:
        if len(self.imei) != _IMEI_DIGITS or not self.imei.isdecimal():
            raise ValueError(f"an IMEI has {_IMEI_DIGITS} digits, {self.imei!r} has not")
        self.thing = self.thing or self.imei


def credit_count(size: int) -> int:
    """Return what a message of so many bytes costs; a look into an empty mailbox costs one."""
    return max(1, -(-size // _BYTES_PER_CREDIT))
