"""What one flight of many meets that the plan does not know."""

from dataclasses import dataclass

from autonomy.estimation.known_current import SETTLING_S
from autonomy.vehicle.config import Vehicle
from onboard.flight.navigation import CurrentBelief


@dataclass(frozen=True, slots=True)
class Drawn:
    """Robot and water of one flight."""

    vehicle: Vehicle
    """As the robot truly is."""
    current_ne_m_s: tuple[float, float]
    """Current that stays."""
    drift_m_sqrt_s: float
    """How fast eddies carry it away, m per sqrt(s), per axis."""
    buoyancy_bias_kg: float
    """What the feedback of the pump says too much."""
    mass_position_bias_m: float
    """What the feedback of the sliding mass says too much."""
    noise_share: float
    """Standard deviation of the sensors' noise, as a share of the usual one."""
    capacity_wh: float
    """Of the full battery."""
    battery: float = 1.0
    """Charge at the start, 0..1."""
    flow_share: float = 1.0
    """Factor of the current that is told by place and time."""
    settling_s: float = SETTLING_S
    """Time at the surface before the start."""
    belief: CurrentBelief | None = None
    """What the robot believes of the current when it is there; ``None`` as when it is switched on.
    """
