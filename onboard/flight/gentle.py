"""How gently a robot must fly, for what its sliding mass can follow."""

from autonomy.vehicle.config import Vehicle
from onboard.flight.actuator_watch import ActuatorBelief
from onboard.flight.maneuver import Gait
from onboard.profile import FlightProfile

_RATE_USE = 0.8
"""Part of the mass's speed that a change of the wanted pitch may take."""
_FLOW = 1.3
"""Way of the mass for a change of pitch, relative to that without flow."""
SPEEDING_UP_S = 3.0
"""Time in which the wanted pitch begins to change at its full speed."""
_BEHIND_RAD = 0.04
"""How far the pitch may move before the mass begins to answer."""
SLOWEST_SHARE = 0.4
"""A glide that is slower yet is ruled by what the ballast has wrong."""


def gait_for(
    vehicle: Vehicle, profile: FlightProfile, mass: ActuatorBelief, *, is_swinging: bool
) -> Gait:
    """Return the gait that the sliding mass can follow; the gentlest for a robot that swings.

    A turn from dive to climb takes the mass a certain way. Where it takes longer than the profile
    plans, the legs are slowed as much, so that the turn stays the same part of a leg.

    Args:
        vehicle: The robot.
        profile: Its manners.
        mass: How its sliding mass follows commands.
        is_swinging: Whether pitch and mass chase each other.
    """
    if is_swinging:
        pitch_rate = SLOWEST_SHARE * profile.pitch_rate_rad_s
        return Gait(SLOWEST_SHARE, pitch_rate, pitch_rate / SPEEDING_UP_S)
    if not mass.is_off:
        return Gait()
    p = vehicle.parameters
    hang_m = p.offset_mass_kg * p.offset_mass_depth_m / p.sliding_mass_kg
    rate_m_s = mass.rate_share * vehicle.limits.rp1_rate_m_s
    pitch_rate = _RATE_USE * rate_m_s / (_FLOW * hang_m)
    if mass.delay_s > 0.0:
        pitch_rate = min(pitch_rate, _BEHIND_RAD / mass.delay_s)
    share = min(pitch_rate / profile.pitch_rate_rad_s, 1.0)
    pitch_rate = share * profile.pitch_rate_rad_s
    return Gait(max(share, SLOWEST_SHARE), pitch_rate, pitch_rate / SPEEDING_UP_S)
