"""Rules of a mission that bring the robot up early: samples that wait, and values beyond limits."""

from collections.abc import Mapping

from autonomy.channel import CHANNELS
from robot_link.surfacing_order import SurfacingOrder


class SurfacingWatch:
    """Looks whether a rule of the mission is met.

    A rule that brought the robot up lets none do so again until its hold-off is over; what is
    measured meanwhile is not remembered.
    """

    def __init__(self) -> None:
        self._order: SurfacingOrder | None = None
        self._quiet_until_s = 0.0
        self._crossed = ""

    def begin(self, order: SurfacingOrder | None) -> None:
        """Obey the rules of a mission from now on."""
        self._order = order
        self._quiet_until_s, self._crossed = 0.0, ""

    def hear(self, measured: Mapping[str, float]) -> None:
        """Take what was measured, by channel; a value that cannot be true meets no rule."""
        for limit in () if self._order is None else self._order.on_value:
            channel = CHANNELS.numbered(limit.channel)
            value = None if channel is None else measured.get(channel.key)
            if channel is None or value is None or channel.fault(value) is not None:
                continue
            if limit.is_crossed(value):
                side = "above" if limit.is_above else "below"
                unit = "" if channel.unit == "1" else f" {channel.unit}"
                said = f"{channel.title.lower()} of {value:.4g} is {side} {limit.limit:g}{unit}"
                self._crossed = said

    def met(self, mission_s: float, samples_waiting: int, *, is_under_way: bool) -> str:
        """Return which rule is met, or ""; from then on the hold-off runs.

        Args:
            mission_s: Time since the mission began.
            samples_waiting: How many are not known to be stored ashore.
            is_under_way: Whether the robot is in a dive that can be ended.
        """
        crossed, self._crossed = self._crossed, ""
        order = self._order
        if order is None or not is_under_way or mission_s < self._quiet_until_s:
            return ""
        if not crossed and 0 < order.samples_waiting <= samples_waiting:
            crossed = f"{samples_waiting} samples wait"
        if crossed:
            self._quiet_until_s = mission_s + order.hold_off_s
            crossed = f"by rule: {crossed}"
        return crossed
