"""Works out what a vehicle can fly, for the planner's settings of a robot."""

from collections.abc import Callable
from typing import Any

from autonomy.planner.capability import energy_of, motion_of
from autonomy.planner.work import joules_per_unit
from autonomy.vehicle.glide import NoSteadyGlideError
from server.base.study import Refusal
from server.vehicle.task import CapabilityProblem


def run(
    problem: CapabilityProblem, report: Callable[[object], None], is_cancelled: Callable[[], bool]
) -> dict[str, Any] | Refusal:
    """Return a vehicle's primitives and their energies by its polar and actuators, for JSON."""
    del report, is_cancelled
    vehicle = problem.vehicle
    try:
        motion = motion_of(vehicle, problem.depth_m)
        energy = energy_of(vehicle, motion)
        joules = joules_per_unit(vehicle, motion, energy)
    except NoSteadyGlideError as error:
        text = str(error)
        return Refusal(f"{text[0].upper()}{text[1:].rstrip('.')}.")
    return {
        "primitives": motion.model_dump(mode="json"),
        "energy": energy.model_dump(mode="json"),
        "joules_per_unit": joules,
    }
