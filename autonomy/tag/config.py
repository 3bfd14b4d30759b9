"""How tags are heard, and when a detection deserves doubt."""

from autonomy.configuration import Configuration, quantity

DELAYS_IN_DOUBT = 30.0
"""A detection is doubtful where none other lies within so many nominal delays of its tag."""


class TagConfig(Configuration):
    """How the tags of a water are heard."""

    doubtful_after_s: float = quantity(
        3600.0, "s", title="Doubtful when alone for", ge=60.0, le=86_400.0
    )
    """A detection is doubtful when no other of its tag on its receiver lies within this time: 30
    times the nominal delay of the tags."""
    delay_s: float = quantity(120.0, "s", title="Mean delay of a tag", ge=1.0, le=7200.0)
    """Mean time between two transmissions of a tag."""
    half_range_m: float = quantity(
        300.0, "m", title="Range at which half is heard", ge=1.0, le=5000.0
    )
    """Distance at which the receiver hears half of what it hears beside the tag."""
    width_m: float = quantity(60.0, "m", title="Width of the fall", ge=0.1, le=2000.0)
    """Over how much distance the share of transmissions that are heard falls."""
    top: float = quantity(0.9, title="Share heard beside the tag", gt=0.0, le=1.0)
    """Part of the transmissions that are heard without any distance."""
    range_doubt: float = quantity(0.25, title="Doubt of the range", ge=0.0, le=1.0, advanced=True)
    """Standard deviation of the logarithm of the range; 0 takes it for certain."""
    delay_doubt: float = quantity(0.25, title="Doubt of the delay", ge=0.0, le=1.0, advanced=True)
    """Standard deviation of the logarithm of the delay; 0 takes it for certain."""
