"""What a station may do of itself for a robot."""

from typing import Literal

from autonomy.configuration import Configuration, quantity


class AutomationConfig(Configuration):
    """Limits of what is sent without a person at the button."""

    most_sends_per_hour: int = quantity(4, title="Most automatic sends in an hour", ge=0, le=60)
    """Plans that wait for a surfacing, a time or a condition, and suggestions that are sent by
    themselves, together. One more is held until the hour has passed, and sent if it has not expired
    by then; 0 holds all."""
    suggestions: Literal["asked", "offered", "sent"] = quantity("offered", title="Suggestions")
    """A new plan for what is left of the flown one: asked, only when a person asks; offered, made
    at every surfacing and offered; sent, the same and sent by itself within the limit above."""
    least_gain: float = quantity(
        0.05, title="Least gain of a suggestion", ge=0.0, le=10.0, advanced=True
    )
    """A new plan that brings less more than what is left of the present one is not suggested: 0.05
    is 5 %."""
