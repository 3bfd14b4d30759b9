"""What a robot's electronics and actuators draw from its battery (thesis Eq. 5.20)."""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.configuration import Configuration, quantity
from autonomy.vehicle.limits import ActuatorLimits


class EnergyPrices(Configuration):
    """Electrical power of a robot: a constant, and each actuator's by its squared rate.

    The thesis leaves the constants of Eq. 5.20 open. They are estimated from the components of
    Table 2.3, each actuator's as the power that it takes at its greatest rate; the defaults are
    the Miniglider's. A measured current replaces them.
    """

    electronics_w: float = quantity(3.0, "W", title="Electronics", ge=0.0)
    """Power of everything that is always on (d_c); estimated."""
    pump_full_w: float = quantity(6.0, "W", title="Pump at full rate", ge=0.0)
    """Power of the buoyancy pump at its greatest rate; estimated."""
    mass_full_w: float = quantity(3.0, "W", title="Sliding mass at full rate", ge=0.0)
    """Power of the sliding mass's actuator at its greatest rate; estimated."""
    tail_full_w: float = quantity(2.5, "W", title="Tail at full rate", ge=0.0)
    """Power of the tail servo at its greatest rate; estimated."""

    def packed(self, limits: ActuatorLimits) -> FloatArray:
        """Return d_c W, d_m W s2/kg2, d_r W s2/m2 and d_delta W s2/rad2, shape ``(4,)``."""
        return np.array(
            [
                self.electronics_w,
                self.pump_full_w / limits.m0_rate_kg_s**2,
                self.mass_full_w / limits.rp1_rate_m_s**2,
                self.tail_full_w / limits.delta_rate_rad_s**2,
            ]
        )

    def power_w(
        self, limits: ActuatorLimits, m0_rate_kg_s: float, rp1_rate_m_s: float, delta_rad_s: float
    ) -> float:
        """Electrical power at given rates of the actuators (Eq. 5.20).

        Args:
            limits: Greatest rates that the prices refer to.
            m0_rate_kg_s: Rate of the net mass.
            rp1_rate_m_s: Speed of the sliding mass.
            delta_rad_s: Rate of the tail.
        """
        squared = np.array([1.0, m0_rate_kg_s**2, rp1_rate_m_s**2, delta_rad_s**2])
        return float(self.packed(limits) @ squared)
