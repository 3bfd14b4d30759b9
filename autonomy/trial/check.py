"""Whether a scenario can be tried at all."""

from collections.abc import Collection

from autonomy.control.feasibility import (
    InfeasibleReferenceError,
    check_reference,
    check_swim,
)
from autonomy.trial.config import TrialConfig
from autonomy.trial.setting import reference_function
from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.steady import NoSteadyGlideError


def check_scenario(vehicle: Vehicle, config: TrialConfig, kinds: Collection[str]) -> None:
    """Refuse a reference that one of the controllers could not follow whatever its gains.

    Args:
        vehicle: The robot.
        config: The scenario.
        kinds: Keys of the controllers that are to try it.

    Raises:
        InfeasibleReferenceError: With the limit that the reference breaks.
    """
    try:
        trajectory = reference_function(vehicle, config)
    except NoSteadyGlideError as error:
        raise InfeasibleReferenceError(str(error)) from error
    swims = "controller.swimming" in kinds
    if swims and config.model != "extended":
        raise InfeasibleReferenceError(
            "the swimming controller needs the extended model: in the thesis's model the tail"
            " does not push"
        )
    if config.reference == "level_swim" and set(kinds) != {"controller.swimming"}:
        raise InfeasibleReferenceError("only the swimming controller follows a level course")
    if swims:
        check_swim(vehicle, trajectory, config.duration_s)
    if config.reference != "level_swim":
        check_reference(vehicle, trajectory, config.duration_s)
