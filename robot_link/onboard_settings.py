"""Settings that a mission brings on board: controller, prices, and what the map's digest needs."""

from dataclasses import dataclass
from typing import Self

from autonomy.configuration import Configuration
from autonomy.field.config import FieldConfig, KernelParameters
from autonomy.planner.config import EnergyConfig, PlannerConfig


@dataclass(frozen=True, slots=True)
class DigestSettings:
    """What tells which samples change the map most."""

    kernel: KernelParameters
    """Of the mapped field, in the scale of its model."""
    thresholds_m: tuple[float, ...]
    """Position deviations that part the levels of fidelity, ascending."""
    level_noise_variances: tuple[float, ...]
    """Noise of a sample by its level of fidelity, worst located first."""


@dataclass(frozen=True, slots=True)
class OnboardSettings:
    """Settings as the integers that travel; build it with ``of`` or ``from_integers``."""

    controller: tuple[int, ...]
    """Number of the kind in the catalogue, then its gains in the order of declaration."""
    planner: tuple[int, ...]
    """Energy prices, then fidelity thresholds, kernel and noise of the digest."""

    @classmethod
    def of(
        cls,
        controller_kind: str,
        controller: Configuration,
        planner: PlannerConfig,
        field: FieldConfig,
    ) -> Self:
        """Round configurations to what travels.

        Args:
            controller_kind: Key of ``autonomy.control.catalogue.CONTROLLERS``.
            controller: Its gains.
            planner: Settings that the plan was made with.
            field: Settings of the robot's map.

        Raises:
            ValueError: If a number does not fit, or the rounded gains are none; it is named.
        """
        raise NotImplementedError

    @property
    def controller_kind(self) -> str:
        """Key of the controller in ``autonomy.control.catalogue.CONTROLLERS``."""
        raise NotImplementedError

    def controller_config(self) -> Configuration:
        """Return the gains, of the model that the catalogue names for the kind."""
        raise NotImplementedError

    def energy_config(self) -> EnergyConfig:
        """Return the prices of the primitives."""
        raise NotImplementedError

    def digest_settings(self) -> DigestSettings:
        """Return what tells which samples change the map most."""
        raise NotImplementedError

    def integers(self) -> tuple[int, ...]:
        """Return all numbers, each exact in a float32."""
        raise NotImplementedError

    @classmethod
    def from_integers(cls, integers: tuple[int, ...]) -> Self:
        """Rebuild the settings from ``integers``.

        Raises:
            ValueError: If they are none.
        """
        raise NotImplementedError
