"""What the waters tell the other capabilities."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class WaterChanged:
    """A water was added, changed, retired or brought back."""

    id: str
    robots: tuple[str, ...]
    """Those that work there."""
