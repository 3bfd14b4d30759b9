"""What a station may do of itself for a robot."""

from autonomy.configuration import Configuration, quantity


class AutomationConfig(Configuration):
    """Limits of what is sent without a person at the button."""

    most_sends_per_hour: int = quantity(4, title="Most automatic sends in an hour", ge=0, le=60)
    """Plans that wait for a surfacing, a time or a condition, and are then sent by themselves. One
    more is held until the hour has passed, and sent if it has not expired by then; 0 holds all."""
