"""The three controllers that the thesis compares, with the gains that it prints."""

from dataclasses import dataclass

from autonomy.control.config import (
    BACKSTEPPING_EXPERIMENT,
    BACKSTEPPING_SIMULATION,
    PID_EXPERIMENT,
    PID_SIMULATION,
    BacksteppingConfig,
    PidConfig,
)
from reproduction.result import Hue

Gains = BacksteppingConfig | PidConfig


@dataclass(frozen=True, slots=True)
class Contender:
    """One controller, its name in tables, its colour in figures."""

    kind: str
    """Key in the catalogue of controllers."""
    hue: Hue
    simulation: Gains
    """Thesis section 3.3."""
    experiment: Gains
    """Thesis section 3.4.3."""

    @property
    def title(self) -> str:
        """Name in tables and legends."""
        return self.hue.value


CONTENDERS = (
    Contender(
        "controller.backstepping", Hue.PROPOSED, BACKSTEPPING_SIMULATION, BACKSTEPPING_EXPERIMENT
    ),
    Contender(
        "controller.baseline",
        Hue.BASELINE,
        BACKSTEPPING_SIMULATION.without_trade(),
        BACKSTEPPING_EXPERIMENT.without_trade(),
    ),
    Contender("controller.pid", Hue.PID, PID_SIMULATION, PID_EXPERIMENT),
)
"""Proposed, baseline (the same law with c = 0) and PID, in the order of the thesis's tables."""
