"""Why a calibration is not taken."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Refusal:
    """A calibration that is not taken, and why, in words for who stands at the tank."""

    reason: str
