"""How each kind of robot is flown: distances and times that its size sets."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class FlightProfile:
    """Manners of the mission executive for one vehicle."""

    surfaced_m: float
    """At this depth or above the robot lies at the surface, waves and noise allowed for."""
    reversal_m_s2: float
    """Vertical acceleration that the pump brings about; sets how early a dive is turned around."""
    depth_leash_m: float
    """How far the depth reference may run ahead of the robot."""
    pitch_rate_rad_s: float
    """How fast the wanted pitch may change."""
    swimming_speed_m_s: float
    """Speed with the full gait."""
    entry_speed_m_s: float
    """A glide begins with this speed from swimming."""
    turn_s: float
    """How long it turns at the surface before a dive, about."""
    coast_s: float
    """When its tail stops it glides on along the surface as far as in this time at that speed."""
    near_m: float
    """Within this distance a target's direction means nothing any more."""
    aim_m: float
    """A dive's first leg is turned to only if it ends farther away; else to its planned course."""
    arrival_m: float
    """A swim has arrived within this distance."""
    start_tolerance_m: float
    """A dive begins within this distance of its planned start; else the robot swims there."""
    floor_margin_m: float
    """It comes up when the floor is nearer than this."""
    shore_margin_m: float
    """It comes up when walls or shore are nearer than this."""
    surface_min_s: float
    """Shortest stay at the surface between two dives."""
    surface_max_s: float
    """Longest wait for the station to acknowledge samples."""


FLIGHT_PROFILES: dict[str, FlightProfile] = {
    "miniglider": FlightProfile(
        surfaced_m=0.03,
        reversal_m_s2=0.004,
        depth_leash_m=0.06,
        pitch_rate_rad_s=0.10,
        swimming_speed_m_s=0.088,
        entry_speed_m_s=0.015,
        turn_s=15.0,
        coast_s=12.0,
        near_m=0.10,
        aim_m=0.35,
        arrival_m=0.3,
        start_tolerance_m=0.6,
        floor_margin_m=0.15,
        shore_margin_m=0.30,
        surface_min_s=3.0,
        surface_max_s=30.0,
    ),
    "grace3": FlightProfile(
        surfaced_m=0.12,
        reversal_m_s2=0.008,
        depth_leash_m=0.3,
        pitch_rate_rad_s=0.065,
        swimming_speed_m_s=0.150,
        entry_speed_m_s=0.05,
        turn_s=25.0,
        coast_s=15.0,
        near_m=2.0,
        aim_m=4.0,
        arrival_m=4.0,
        start_tolerance_m=20.0,
        floor_margin_m=1.5,
        shore_margin_m=8.0,
        surface_min_s=10.0,
        surface_max_s=60.0,
    ),
}
"""By the vehicle's key."""
