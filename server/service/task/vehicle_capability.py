"""Works out what a vehicle can fly, for the planner's settings of a robot."""

from collections.abc import Callable
from typing import Any

from autonomy.planner.capability import energy_of, motion_of
from server.service.task.problem import CapabilityProblem


def run(
    problem: CapabilityProblem, report: Callable[[object], None], is_cancelled: Callable[[], bool]
) -> dict[str, Any]:
    """Return a vehicle's primitives and their energies by its polar and actuators, for JSON."""
    del report, is_cancelled
    motion = motion_of(problem.vehicle, problem.depth_m)
    return {
        "primitives": motion.model_dump(mode="json"),
        "energy": energy_of(problem.vehicle, motion).model_dump(mode="json"),
    }
