"""Whether a scenario can be tried at all."""

from collections.abc import Sequence
from dataclasses import replace

from autonomy.control.feasibility import (
    InfeasibleReferenceError,
    check_reference,
    check_swim,
)
from autonomy.control.governor_config import MOST_DELAY_CALLS, GovernorConfig
from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.glide import NoSteadyGlideError
from autonomy.whatif.config import ControllerChoice, TrialConfig
from autonomy.whatif.setting import reference_function
from autonomy.whatif.work import check_work


class UnfitControllerError(ValueError):
    """A controller cannot work in the scenario; the message says why and what to change."""

    def __init__(self, message: str, number: int) -> None:
        super().__init__(message)
        self.number = number
        """Which of the controllers, from 0."""


def check_scenario(
    vehicle: Vehicle, config: TrialConfig, choices: Sequence[ControllerChoice]
) -> None:
    """Refuse what would take too long, and what a controller could not do whatever its gains.

    Args:
        vehicle: The robot.
        config: The scenario.
        choices: The controllers that are to try it.

    Raises:
        TooMuchWorkError: If it takes more steps than are worked out.
        UnfitControllerError: If a controller cannot remember commands for as long as its delay.
        InfeasibleReferenceError: With the limit that the reference breaks.
    """
    check_work(vehicle, config, choices)
    for number, choice in enumerate(choices):
        _check_delay(choice, config.period_s, number)
    try:
        trajectory = reference_function(vehicle, config)
    except NoSteadyGlideError as error:
        raise InfeasibleReferenceError(str(error)) from error
    kinds = {choice.kind for choice in choices}
    swims = "controller.swimming" in kinds
    if swims and config.model != "extended":
        raise InfeasibleReferenceError(
            "the swimming controller needs the extended model: in the thesis's model the tail"
            " does not push"
        )
    if config.reference == "level_swim" and kinds != {"controller.swimming"}:
        raise InfeasibleReferenceError("only the swimming controller follows a level course")
    if swims:
        check_swim(vehicle, trajectory, config.duration_s)
    if config.reference != "level_swim":
        check_reference(_as_told(vehicle, choices), trajectory, config.duration_s)


def _as_told(vehicle: Vehicle, choices: Sequence[ControllerChoice]) -> Vehicle:
    """Return the vehicle with the slowest sliding mass that a controller was told of."""
    shares = [c.config.mass_rate_share for c in choices if isinstance(c.config, GovernorConfig)]
    rate = vehicle.limits.rp1_rate_m_s * min([1.0, *shares])
    return replace(vehicle, limits=vehicle.limits.model_copy(update={"rp1_rate_m_s": rate}))


def _check_delay(choice: ControllerChoice, period_s: float, number: int) -> None:
    config = choice.config
    if not isinstance(config, GovernorConfig):
        return
    calls = round(config.mass_delay_s / period_s)
    if calls > MOST_DELAY_CALLS:
        raise UnfitControllerError(
            f"a delay of {config.mass_delay_s:g} s is {calls} control periods of {period_s:g} s,"
            f" and this controller remembers {MOST_DELAY_CALLS} commands: take a control period of"
            f" at least {config.mass_delay_s / MOST_DELAY_CALLS:.2g} s",
            number,
        )
