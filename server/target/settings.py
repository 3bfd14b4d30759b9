"""Settings that a plan to follow a target is made with: kept from plans before, or the preset."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from autonomy.tracking.config import TrackingConfig
from robot_link.target_settings import TargetSettings
from server.base.configuration import ConfigurationBook, CurrentConfiguration, merge
from server.base.problem import Problem, conflict
from server.plan.settings import below_config
from server.plan.view import InheritedView

Base = Literal["kept", "preset"]
"""What a request's settings are laid over."""


@dataclass(frozen=True, slots=True)
class KeptTargetSettings:
    """What holds for a plan, as a kept version."""

    config_id: str
    order: TargetSettings
    """As both ends compute with it."""
    inherited: list[InheritedView]


async def configure_target(
    book: ConfigurationBook, robot: str, patch: Mapping[str, Any], base: Base, *, by: str
) -> KeptTargetSettings:
    """Keep the settings of a robot with a patch on top, unless they are refused.

    Raises:
        Problem: 409 for settings that cannot travel, 422 with the path of each wrong field below
            ``config``.
        UnknownIdError: If there is no such robot.
    """
    before = await book.current("tracking", robot)
    wish = _whole(before, patch) if base == "preset" else _unless_asked(before, patch)
    try:
        wanted = await book.merged("tracking", robot, wish)
    except Problem as problem:
        raise below_config(problem) from problem
    order = _order(wanted)
    holds = await book.current("tracking", robot)
    if holds.id is None or wanted.value != holds.value:
        holds = await book.patch("tracking", robot, wish, by=by)
        order = _order(holds)  # somebody may have changed another field meanwhile
    if holds.id is None:
        raise TypeError("a kept version has an id")
    return KeptTargetSettings(holds.id, order, list(_inherited(before, wish)))


def unfit(error: ValueError) -> Problem:
    """Return a 409: the settings cannot travel."""
    return conflict(f"The robot cannot be given these settings: {error}.")


def _whole(before: CurrentConfiguration, patch: Mapping[str, Any]) -> dict[str, Any]:
    """Return a patch that leaves nothing of what was kept."""
    preset = before.preset.model_dump(mode="json")
    return merge(preset, patch, preset)


def _unless_asked(before: CurrentConfiguration, patch: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a patch that turns the barrier on again, unless it names a controller itself.

    The teaching mode holds for the plan that asks for it only: nobody inherits it unknowingly.
    """
    barrier = patch.get("barrier", {})
    if not before.value_as(TrackingConfig).barrier.is_teaching:
        return patch
    if not isinstance(barrier, Mapping) or "controller" in barrier:
        return patch
    return {**patch, "barrier": {**barrier, "controller": "barrier"}}


def _order(settings: CurrentConfiguration) -> TargetSettings:
    try:
        return TargetSettings.of(settings.value_as(TrackingConfig))
    except ValueError as error:
        raise unfit(error) from error


def _inherited(before: CurrentConfiguration, wish: Mapping[str, Any]) -> Iterator[InheritedView]:
    """Yield what a wish leaves as it was although that is not the preset."""
    value, preset = before.value.model_dump(mode="json"), before.preset.model_dump(mode="json")
    for group, fields in value.items():
        named = wish.get(group, {})
        for name, held in fields.items():
            if name not in named and held != preset[group][name]:
                yield InheritedView(f"{group}.{name}", held, preset[group][name])
