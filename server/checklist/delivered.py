"""The templates that a station brings along; a team's own versions take their place."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from server.checklist.template import ChecklistItem, ChecklistTemplate


def _asks(
    check: str, text: str, limit: float | None = None, *, blocking: bool = True
) -> ChecklistItem:
    return ChecklistItem(
        key=check, text=text, kind="automatic", check=check, limit=limit, blocking=blocking
    )


def _tick(key: str, text: str, help_text: str = "", *, blocking: bool = True) -> ChecklistItem:
    return ChecklistItem(key=key, text=text, help=help_text, blocking=blocking)


DELIVERED: Final[Mapping[str, ChecklistTemplate]] = MappingProxyType(
    {
        "pre_dive_tank": ChecklistTemplate(
            title="Pre-dive, tank",
            act="start",
            waters=["tank"],
            valid_h=12.0,
            items=[
                _asks("link", "The link is live"),
                _asks("battery", "The battery is charged", 30.0),
                _asks("leak", "The hull is dry"),
                _asks("depth_zero", "The depth is zero at the surface", 0.05),
                _asks("position", "Positions are of the tank's frame"),
                _asks("clock", "The clock is right"),
                _asks("alarms", "No alarm stands"),
                _asks("free_disk", "The robot has room for its log", 200.0, blocking=False),
                _tick(
                    "hull",
                    "The hull is closed, its seals are clean and greased",
                    "Look along the whole ring: a hair is enough to let water in.",
                ),
                _tick(
                    "trim",
                    "The robot floats level and comes up by itself",
                    "Push its nose under and let go.",
                ),
                _tick(
                    "surface",
                    "Surface now was tried, and the robot answered",
                    "Hold Surface now; the reply stands under it.",
                ),
                _tick("tank", "Nobody and nothing is in the tank"),
                _tick("hook", "A hook or a line is at hand", blocking=False),
            ],
        ),
        "pre_launch_lake": ChecklistTemplate(
            title="Pre-launch, open water",
            act="launch",
            waters=["lake", "sea"],
            valid_h=0.0,
            items=[
                _asks("link", "The link is live"),
                _asks("battery", "The battery is charged", 80.0),
                _asks("leak", "The hull is dry"),
                _asks("internal_pressure", "The hull holds its vacuum", 1050.0, blocking=False),
                _asks("depth_zero", "The depth is zero at the surface", 0.2),
                _asks("position", "The position is fixed", 10.0),
                _asks("clock", "The clock is right"),
                _asks("channels", "Its instruments are announced", blocking=False),
                _asks("doubt", "The estimator trusts itself", 3.0, blocking=False),
                _asks("current", "The current is known", 0.1, blocking=False),
                _asks("free_disk", "The robot has room for its log", 500.0, blocking=False),
                _asks("alarms", "No alarm stands"),
                _tick(
                    "hull",
                    "The hull is closed, its seals are clean and greased",
                    "Look along the whole ring: a hair is enough to let water in.",
                ),
                _tick("ballast", "The ballast fits this water's density"),
                _tick("wings", "Wings, tail and instruments are fast, covers are off"),
                _tick(
                    "surface",
                    "Surface now was tried, and the robot answered",
                    "Hold Surface now; the reply stands under it.",
                ),
                _tick("recovery", "Boat, hook and the finder's number on the hull are ready"),
                _tick("notice", "Whom it concerns knows of the launch", blocking=False),
            ],
        ),
        "daily": ChecklistTemplate(
            title="Daily look",
            act="daily",
            valid_h=24.0,
            items=[
                _asks("battery", "The battery lasts", 30.0),
                _asks("leak", "The hull is dry"),
                _asks("free_disk", "The robot has room for its log", 200.0, blocking=False),
                _asks("doubt", "The estimator trusts itself", 3.0, blocking=False),
                _asks("alarms", "No alarm stands"),
                _tick("plan", "The plan on board is the one that is wanted"),
                _tick("weather", "Weather and traffic for the next day were looked at"),
                _tick("water", "Its water was looked at: ice, boats, nets", blocking=False),
            ],
        ),
        "recovery": ChecklistTemplate(
            title="Recovery",
            act="recovery",
            valid_h=24.0,
            items=[
                _asks("leak", "The hull is dry"),
                _tick("off", "The robot is out of the water and does nothing"),
                _tick("rinsed", "It was rinsed with fresh water"),
                _tick("damage", "Hull, wings and tail were looked at for damage"),
                _tick("log", "Its log was fetched"),
                _tick("charged", "Its battery is charging", blocking=False),
            ],
        ),
    }
)
"""By key."""
