"""Settings of the planner that the two vehicles can really fly."""

import math

from autonomy.estimation.config import estimator_preset
from autonomy.planner.config import (
    EnergyConfig,
    ErgodicConfig,
    MissionConfig,
    PlannerConfig,
    PrimitiveConfig,
    SearchConfig,
)
from autonomy.site import LAKE, TANK

MINIGLIDER = PlannerConfig(
    domain=TANK.domain,
    max_uncertainty_m=0.35,
    fidelity_thresholds_m=(0.05, 0.12),
    primitives=PrimitiveConfig(
        glide_speed_m_s=0.025,
        glide_angle_min_rad=math.radians(42.0),
        glide_angle_max_rad=math.radians(55.0),
        spiral_speed_m_s=0.02,
        spiral_radius_min_m=0.3,
        spiral_radius_max_m=0.5,
        spiral_rise_min_m_rad=0.45,
        spiral_rise_max_m_rad=0.6,
        dive_speed_m_s=0.012,
        swim_speed_m_s=0.06,
        swim_length_min_m=0.3,
        swim_length_max_m=0.6,
        swims_under_water=False,
        depth_change_min_m=0.25,
        bearing_noise_rad=0.4,
    ),
    energy=EnergyConfig(swim_factor=0.5, tail_amplitude_rad=0.40, tail_frequency_hz=0.40),
    position_filter=estimator_preset("miniglider", TANK.kind),
)
"""Miniglider in the tank's exploration domain.

From its polar (``autonomy.vehicle.steady``): it glides down at 35 to 55 degrees and up at 40 to 60,
the sliding mass ending the steep side; 0.025 m/s takes 1 to 4 g of net mass either way, which the
pump changes over in 4 s. A flat dive at 0.012 m/s takes 10 g, changed over in 12 s. With 35 to 55
degrees of tail it spirals at radii of 0.3 to 0.55 m, 0.42 to 0.65 m deep a radian. The tail's rate
of 1.05 rad/s allows 0.40 rad at 0.40 Hz, which brings it from rest to 0.07 m/s within 20 s. This
gait does a fifth of the work of 0.35 rad at 1 Hz, so the swim factor is 0.5 where the thesis has
0.2: a metre then costs 4 units, several times that of a glide, as the thesis intends.

A dive of 45 s in a current of which nothing is known but that it is about 1 cm/s loses the position
by 0.35 m at the end, so such dives can still be planned; one to the floor and back, 52 s and more,
can once a minute of floating, or a dive, has told the current to 4 mm/s.
"""

GRACE3 = PlannerConfig(
    domain=LAKE.domain,
    total_budget=240.0,
    round_budget=40.0,
    max_uncertainty_m=20.0,
    fidelity_thresholds_m=(3.0, 8.0),
    margin_m=10.0,
    floor_margin_m=2.0,
    primitives=PrimitiveConfig(
        glide_speed_m_s=0.06,
        glide_angle_min_rad=math.radians(42.0),
        glide_angle_max_rad=math.radians(50.0),
        spiral_speed_m_s=0.05,
        spiral_radius_min_m=1.2,
        spiral_radius_max_m=2.0,
        spiral_rise_min_m_rad=1.4,
        spiral_rise_max_m_rad=2.0,
        dive_speed_m_s=0.015,
        swim_speed_m_s=0.12,
        swim_length_min_m=5.0,
        swim_length_max_m=20.0,
        keep_radius_min_m=6.0,
        swims_under_water=False,
        depth_change_min_m=5.0,
        bearing_noise_rad=0.3,
        point_interval_s=10.0,
    ),
    energy=EnergyConfig(swim_factor=0.5, tail_amplitude_rad=0.40, tail_frequency_hz=0.25),
    position_filter=estimator_preset("grace3", LAKE.kind),
    mission=MissionConfig(turn_time_s=25.0, draft_distance_m=40.0),
    ergodic=ErgodicConfig(reach_north_m=40.0, reach_east_m=40.0, reach_depth_m=2.0),
    search=SearchConfig(step_m=40.0, near_radius_m=40.0, nearest_radius_m=32.0, transects=12),
)
"""GRACE 3 in the lake's exploration domain; its model is scaled, not identified.

From the scaled polar: at 0.06 m/s both down and up can be flown at 42 to 50 degrees, with 60 to
125 g of net mass, which the pump changes over in 25 s or 1.5 m. So one dive to 16 m and back covers
27 to 36 m in 9 minutes for 5.7 energy units. It spirals at radii of 1.2 to 2 m, 1.4 to 2 m deep a
radian, with 25 to 35 degrees of tail, and swims at 0.15 m/s.

The lake is a dozen dives wide, so a search begins with transects. A round of 40 units is seven
dives and 210 m in an hour, which a dry run can fly ahead in time; six rounds, six hours in all,
come within one length scale of the field to all the water, within half of one to nine tenths of it.

A dive of 6 minutes in a current of which nothing is known but that it is about 5 cm/s loses the
position by 20 m; the first such dive tells the current to 2 cm/s, in which 9 minutes do.
"""

PLANNER_PRESETS: dict[str, PlannerConfig] = {"miniglider": MINIGLIDER, "grace3": GRACE3}
"""Default of each vehicle, by the vehicle's key."""


def planner_preset(vehicle: str, water: str) -> PlannerConfig:
    """Return the settings of a vehicle in a kind of water, as delivered.

    Args:
        vehicle: Key of the vehicle.
        water: ``Site.kind``.
    """
    preset = PLANNER_PRESETS.get(vehicle, PlannerConfig())
    return preset.model_copy(update={"position_filter": estimator_preset(vehicle, water)})
