"""Many dives of one controller, each from its own seed, reduced to what matters of them."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.trial import kernel
from autonomy.trial.config import TrialConfig
from autonomy.trial.run import ControllerChoice, fly_setting, trial_errors
from autonomy.trial.setting import packed_references, setting
from autonomy.vehicle.config import Vehicle


@dataclass(frozen=True, slots=True, eq=False)
class MonteCarlo:
    """One row a seed, in the order of the seeds."""

    rms: FloatArray
    """Root mean square of depth, horizontal, pitch and hybrid error, shape ``(dives, 4)``."""
    end: FloatArray
    """The four errors at the end, shape ``(dives, 4)``."""
    state: FloatArray
    """The 12 states at the end, shape ``(dives, 12)``."""
    travel: FloatArray
    """Way of each actuator, kg, m, rad, shape ``(dives, 3)``."""


def monte_carlo(
    vehicle: Vehicle, config: TrialConfig, choice: ControllerChoice, *, threads: int = 2
) -> MonteCarlo:
    """Fly ``config.runs`` dives; the result does not depend on the number of threads.

    Args:
        vehicle: The robot, as the controller believes it to be.
        config: The scenario.
        choice: The controller.
        threads: Dives that are flown at once.

    Raises:
        NoSteadyGlideError: If the reference is a glide flatter than the vehicle can glide.
    """
    references = packed_references(vehicle, config)

    def dive(seed: int) -> FloatArray:
        drawn = setting(vehicle, config, seed, references)
        record, effort = fly_setting(vehicle, config, choice, drawn)
        errors = trial_errors(record[:, kernel.STATE : kernel.INPUTS], references)
        rms = np.sqrt(np.mean(errors**2, axis=0))
        last = record[-1, kernel.STATE : kernel.INPUTS]
        return np.concatenate([rms, errors[-1], last, effort[0]])

    with ThreadPoolExecutor(threads) as pool:
        rows = np.array(list(pool.map(dive, config.seeds)))
    return MonteCarlo(rows[:, :4], rows[:, 4:8], rows[:, 8:20], rows[:, 20:])
