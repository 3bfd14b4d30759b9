"""Every controller that a robot or a trial can be given, with its settings and presets.

A process that only offers forms reads this, so compiled code is imported where it is first run.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from autonomy.arrays import FloatArray
from autonomy.configuration import Configuration
from autonomy.control import law_number
from autonomy.control.config import (
    BACKSTEPPING_PRESETS,
    BACKSTEPPING_SIMULATION,
    PID_PRESETS,
    PID_SIMULATION,
    BacksteppingConfig,
    PidConfig,
)
from autonomy.control.governor_config import (
    GOVERNOR_PRESETS,
    GOVERNOR_SIMULATION,
    GovernorConfig,
)
from autonomy.control.integral_config import (
    INTEGRAL_PRESETS,
    INTEGRAL_SIMULATION,
    IntegralConfig,
)
from autonomy.control.swimming_config import (
    SWIMMING_PRESETS,
    SWIMMING_SIMULATION,
    SwimmingConfig,
)
from autonomy.vehicle.config import Vehicle

if TYPE_CHECKING:
    from autonomy.control.controller import Controller

ControllerConfig = BacksteppingConfig | PidConfig | IntegralConfig | GovernorConfig | SwimmingConfig
"""Settings of a controller."""


@dataclass(frozen=True, slots=True)
class ControllerKind:
    """One kind of controller."""

    key: str
    title: str
    model: type[ControllerConfig]
    presets: Mapping[str, ControllerConfig]
    """Settings a robot starts with, by the key of its vehicle."""
    simulation_preset: ControllerConfig
    """Gains for exact states (thesis section 3.3)."""
    law: int
    """Which compiled law, of ``autonomy.control.law_number``."""
    pack: Callable[[Any], FloatArray]
    """Turns settings of ``model`` into the numbers that the compiled law takes."""

    def preset(self, vehicle_key: str) -> ControllerConfig:
        """Return the settings that a vehicle starts with, the defaults for an unknown one."""
        return self.presets.get(vehicle_key, self.model())

    def make(self, vehicle: Vehicle, config: Configuration) -> "Controller":
        """Return a fresh controller for a robot.

        Raises:
            TypeError: If the settings are those of another kind.
        """
        from autonomy.control.controller import CompiledController

        return CompiledController(self.law, vehicle, self.packed(config))

    def packed(self, config: Configuration) -> FloatArray:
        """Return the numbers that the compiled law takes, in one dimension.

        Raises:
            TypeError: If the settings are those of another kind.
        """
        if not isinstance(config, self.model):
            raise TypeError(f"{self.key} takes {self.model.__name__}, not {type(config).__name__}")
        return self.pack(config)


CONTROLLERS: Mapping[str, ControllerKind] = MappingProxyType(
    {
        kind.key: kind
        for kind in (
            ControllerKind(
                "controller.backstepping",
                "Backstepping",
                BacksteppingConfig,
                BACKSTEPPING_PRESETS,
                BACKSTEPPING_SIMULATION,
                law_number.BACKSTEPPING,
                BacksteppingConfig.packed,
            ),
            ControllerKind(
                "controller.baseline",
                "Baseline backstepping",
                BacksteppingConfig,
                {key: value.without_trade() for key, value in BACKSTEPPING_PRESETS.items()},
                BACKSTEPPING_SIMULATION.without_trade(),
                law_number.BACKSTEPPING,
                BacksteppingConfig.packed,
            ),
            ControllerKind(
                "controller.pid",
                "PID",
                PidConfig,
                PID_PRESETS,
                PID_SIMULATION,
                law_number.PID,
                PidConfig.packed,
            ),
            ControllerKind(
                "controller.integral",
                "Integral backstepping",
                IntegralConfig,
                INTEGRAL_PRESETS,
                INTEGRAL_SIMULATION,
                law_number.INTEGRAL,
                IntegralConfig.packed,
            ),
            ControllerKind(
                "controller.governor",
                "Robust backstepping",
                GovernorConfig,
                GOVERNOR_PRESETS,
                GOVERNOR_SIMULATION,
                law_number.GOVERNOR,
                GovernorConfig.packed,
            ),
            ControllerKind(
                "controller.swimming",
                "Swimming",
                SwimmingConfig,
                SWIMMING_PRESETS,
                SWIMMING_SIMULATION,
                law_number.SWIMMING,
                SwimmingConfig.packed,
            ),
        )
    }
)
"""Every kind of controller by its key."""
