"""One controller in one scenario on one seed."""

import math
from dataclasses import dataclass, replace

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.control.catalogue import CONTROLLERS
from autonomy.current.table import FlowTable
from autonomy.vehicle.config import Vehicle
from autonomy.whatif import kernel
from autonomy.whatif.config import ControllerChoice, TrialConfig
from autonomy.whatif.setting import Setting, packed_references, setting

REPORTED_TRADE_RAD = math.pi / 9.0
"""``c`` of the reported hybrid error."""


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """What happened, at each of ``n`` commands; SI units, angles rad."""

    seed: int
    time_s: FloatArray
    """Shape ``(n,)``."""
    state: FloatArray
    """The true 12 states, shape ``(n, 12)``."""
    estimate: FloatArray
    """The 12 states that the controller saw, shape ``(n, 12)``."""
    inputs: FloatArray
    """Where the actuators were by their own sensors: kg, m, rad, shape ``(n, 3)``."""
    commands: FloatArray
    """Set points of the three actuators inside their end stops, shape ``(n, 3)``."""
    flap: FloatArray
    """Amplitude rad and frequency Hz of the tail, shape ``(n, 2)``."""
    errors: FloatArray
    """True depth, horizontal, pitch and hybrid error, shape ``(n, 4)``."""
    reference: FloatArray
    """Packed references, shape ``(n, 12)``."""
    travel: FloatArray
    """Way of each actuator, kg, m, rad, shape ``(3,)``."""
    energy_j: float
    """Electrical energy by the vehicle's prices (Eq. 5.20)."""

    def rms(self) -> FloatArray:
        """Root mean square of each error over the whole trial, shape ``(4,)``."""
        return np.sqrt(np.mean(self.errors**2, axis=0))


def trial_errors(state: FloatArray, references: FloatArray) -> FloatArray:
    """Depth, horizontal, pitch and hybrid error of true states, shape ``(n, 4)``.

    The hybrid error is evaluated with the thesis's ``c`` for every controller, as in its tables.

    Args:
        state: Shape ``(n, 12)``.
        references: Packed references, shape ``(n, 12)``.
    """
    north, east = references[:, 0] - state[:, 0], references[:, 1] - state[:, 1]
    along = north * np.cos(state[:, 5]) + east * np.sin(state[:, 5])
    pitch = references[:, 3] - state[:, 4]
    traded = REPORTED_TRADE_RAD * np.tanh(state[:, 4]) * np.tanh(along)
    depth = references[:, 2] - state[:, 2]
    return np.stack([depth, np.hypot(north, east), pitch, pitch - traded], axis=1)


def run_trial(vehicle: Vehicle, config: TrialConfig, choice: ControllerChoice, seed: int) -> Trial:
    """Let one controller track the scenario's reference once.

    Args:
        vehicle: The robot, as the controller believes it to be.
        config: The scenario.
        choice: The controller.
        seed: Decides the start's scatter, the parameters' errors and the noise.

    Raises:
        KeyError: If there is no such kind of controller.
        TypeError: If its settings are those of another kind.
        NoSteadyGlideError: If the reference is a glide flatter than the vehicle can glide.
    """
    return fly(vehicle, config, choice, seed, packed_references(vehicle, config))


def fly(
    vehicle: Vehicle,
    config: TrialConfig,
    choice: ControllerChoice,
    seed: int,
    references: FloatArray,
    flow: FlowTable | None = None,
    noise: FloatArray | None = None,
) -> Trial:
    """Run as ``run_trial`` with references that were packed once for many runs, ``(n, 12)``.

    The water flows as ``flow`` says, if it is given, else as the scenario does; and what is sensed
    is off by ``noise``, shape ``(n, 9)``, if that is given, else as the scenario draws it.
    """
    drawn = setting(vehicle, config, seed, references, flow)
    if noise is not None:
        drawn = replace(drawn, noise=noise)
    record, effort = fly_setting(vehicle, config, choice, drawn)
    state = record[:, kernel.STATE : kernel.INPUTS]
    prices = vehicle.energy.packed(vehicle.limits)
    return Trial(
        seed=seed,
        time_s=config.period_s * np.arange(len(record), dtype=np.float64),
        state=state,
        estimate=state if config.sensing.exact else record[:, kernel.ESTIMATE :],
        inputs=record[:, kernel.INPUTS : kernel.COMMANDS],
        commands=record[:, kernel.COMMANDS : kernel.COMMANDS + 3],
        flap=record[:, kernel.COMMANDS + 3 : kernel.ESTIMATE],
        errors=trial_errors(state, references),
        reference=references,
        travel=effort[0],
        energy_j=float(prices[0] * config.period_s * len(record) + prices[1:] @ effort[1]),
    )


def fly_setting(
    vehicle: Vehicle, config: TrialConfig, choice: ControllerChoice, drawn: Setting
) -> tuple[FloatArray, FloatArray]:
    """Return the record ``(n, columns)`` and effort ``(2, 3)`` of a controller as the kernel does.

    Args:
        vehicle: The robot, as the controller believes it to be.
        config: The scenario.
        choice: The controller.
        drawn: What a seed decided.
    """
    kind = CONTROLLERS[choice.kind]
    return kernel.fly(
        kind.law,
        kind.packed(choice.config),
        vehicle.packed(),
        drawn.true,
        drawn.start,
        drawn.references,
        drawn.noise,
        drawn.conditions,
        drawn.surroundings,
        config.model == "extended",
        config.step_s,
        config.steps_per_period,
        drawn.delay_steps,
        drawn.flow,
    )
