"""Settings of the estimators, and presets per vehicle."""

import math
from typing import Literal

from pydantic.json_schema import SkipJsonSchema

from autonomy.configuration import Configuration, quantity

FASTEST_CURRENT_M_S = 3.0
"""No current of a water that is surveyed is taken to be faster."""
MOST_DOUBT = 10.0
"""A robot whose fixes surprise it more than this is lost, whatever it states."""


class EstimatorConfig(Configuration):
    """Which filter tells the position, the noise that it assumes, the velocity observer's gains."""

    method: Literal["model", "position", "tags"] = quantity(
        "model", title="Position by", advanced=True
    )
    """``model``: one filter on the vehicle's model that learns current and ballast error from fixes
    and depth. ``position``: velocity observer and position filter, which learn no current; their
    uncertainty allows for one. ``tags``: poses by cameras, which must see the robot everywhere;
    without them it goes on as it went."""
    steady_current_m_s: float = quantity(
        0.01, "m/s", title="Unknown current", ge=0.0, le=FASTEST_CURRENT_M_S
    )
    """Standard deviation per axis of the current that stays for many dives, before any fix has told
    it; as delivered that of the kind of water. A plan reckons with the planner's copy until the
    robot has said what it knows; a map reckons with the field's; the robot begins with its own,
    which nothing that is set at the station changes."""
    untold_current_m_s: SkipJsonSchema[float | None] = quantity(
        None, "m/s", title="Unknown current that nobody told of", ge=0.0, le=FASTEST_CURRENT_M_S
    )
    """The same where nothing is told; what was told is forgotten towards it. The station writes it
    where ``steady_current_m_s`` is how well a robot knows the current now; None is that."""
    current_memory_s: float = quantity(
        36000.0, "s", title="Current stays for", ge=60.0, le=1e7, advanced=True
    )
    """Time over which that current changes: what fixes told of it is believed for so long."""
    surface_depth_m: float = quantity(0.05, "m", title="Fix depth", gt=0.0, le=2.0)
    """At this depth or above, the horizontal position can be fixed from outside."""
    fix_std_m: float = quantity(0.01, "m", title="Fix noise", gt=0.0, le=100.0)
    """Standard deviation of one horizontal position fix, per axis."""
    depth_std_m: float = quantity(0.003, "m", title="Depth noise", gt=0.0, le=5.0)
    """Standard deviation of one depth measurement."""
    drift_m_sqrt_s: float = quantity(0.02, "m/s^0.5", title="Drift", ge=0.001, le=10.0)
    """Growth of the dead-reckoned position's standard deviation, per axis, per root second under
    water; the velocity's noise at period dt is this divided by the root of dt."""
    doubt: float = quantity(1.0, title="Doubt", ge=1.0, le=MOST_DOUBT, advanced=True)
    """How many times larger positions' standard deviations are stated than by the other settings.
    The robot raises it where its fixes surprise it, and plans take over what it says."""
    acceleration_density: float = quantity(
        1e-5, "m^2/s^3", title="Acceleration noise", gt=0.0, le=1.0, advanced=True
    )
    """Spectral density of the white acceleration that lets the velocity change, over the ground and
    so with the eddies too: ``2 (drift / eddy correlation time)^2`` follows eddies that add up to
    the drift. Much less takes their velocity for noise, and the position for too certain."""
    observer_velocity_gain: float = quantity(
        0.25, "1/s^2", title="Observer gain K1", ge=0.0, le=25.0, advanced=True
    )
    """How strongly the depth error corrects the velocity observer's body velocity."""
    observer_depth_gain: float = quantity(
        1.0, "1/s", title="Observer gain K2", ge=0.0, le=10.0, advanced=True
    )
    """How strongly the depth error corrects the velocity observer's depth."""

    @property
    def usual_current_m_s(self) -> float:
        """Standard deviation per axis of the current that stays where nothing is told of it."""
        untold = self.untold_current_m_s
        return self.steady_current_m_s if untold is None else untold

    def current_std_after(self, std_m_s: float, age_s: float) -> float:
        """Return how well a steady current is known that was known to ``std_m_s`` a while ago."""
        kept = math.exp(-2.0 * age_s / self.current_memory_s)
        return math.sqrt(kept * std_m_s**2 + (1.0 - kept) * self.usual_current_m_s**2)


ESTIMATOR_PRESETS: dict[str, EstimatorConfig] = {
    "miniglider": EstimatorConfig(acceleration_density=9e-5),
    "grace3": EstimatorConfig(
        surface_depth_m=0.3,
        fix_std_m=1.5,
        depth_std_m=0.01,
        drift_m_sqrt_s=0.3,
        acceleration_density=1e-3,
        steady_current_m_s=0.05,
    ),
}
"""Settings by vehicle: cameras over a tank, and a differential GPS (3 m at 95 %) on a lake with a
current of a few centimetres a second. The tank's eddies, 0.02 m/s^0.5 in 3 s, ask for the 9e-5;
with a ninth of it the normalized error squared is 2.7, not 2."""

_STEADY_CURRENT_M_S = {"tank": 0.01, "lake": 0.05, "sea": 0.20}
_CURRENT_MEMORY_S = {"sea": 7200.0}
"""A half-day tide turns by a radian in two hours."""


def estimator_preset(vehicle: str, water: str) -> EstimatorConfig:
    """Return the settings of a vehicle in a kind of water, as delivered.

    This is the one place that says how strong an unknown current is where: robot, planner and
    field map take their own copies from here.

    Args:
        vehicle: Key of the vehicle; one without settings of its own has the general ones.
        water: ``Site.kind``.
    """
    return ESTIMATOR_PRESETS.get(vehicle, EstimatorConfig()).model_copy(
        update={
            "steady_current_m_s": _STEADY_CURRENT_M_S[water],
            "current_memory_s": _CURRENT_MEMORY_S.get(water, 36000.0),
        }
    )


class WaterMotionConfig(Configuration):
    """How the water moves where the robot works, as far as nobody knows better.

    Eddies are forgotten within a dive and add up to the estimator's drift; the steady part stays
    for many dives, so that fixes can tell it.
    """

    eddy_correlation_s: float = quantity(3.0, "s", title="Eddy correlation time", gt=0.0, le=3600.0)
    """Time over which an eddy remembers itself."""
    steady_std_m_s: float = quantity(0.0, "m/s", title="Unknown current", ge=0.0, le=3.0)
    """Standard deviation per axis of the current that stays."""
    steady_correlation_s: float = quantity(
        36000.0, "s", title="Change of the steady current", gt=0.0, le=1e7, advanced=True
    )
    """Time over which the steady current changes."""

    def eddy_std_m_s(self, drift_m_sqrt_s: float) -> float:
        """Return the standard deviation of the eddies that add up to a drift, per axis."""
        return drift_m_sqrt_s / math.sqrt(2.0 * self.eddy_correlation_s)


class OutlierConfig(Configuration):
    """When a measurement from outside is refused, and when the filter doubts itself instead."""

    limit: float = quantity(20.0, title="Outlier limit", gt=1.0, le=1e6, advanced=True)
    """Squared distance from the prediction, in standard deviations, beyond which a measurement is
    refused. Two true coordinates exceed 20 once in 20 000 times, four once in 2000."""
    patience: int = quantity(10, title="Patience with outliers", ge=1, le=10_000, advanced=True)
    """So many depths refused in a row, and the next is believed: the filter was lost."""
    fix_patience: int = quantity(3, title="Patience with fixes", ge=2, le=100, advanced=True)
    """So many refused fixes in a row that agree with each other re-open the question."""


class ModelFilterConfig(Configuration):
    """Noise of the filter on the vehicle's model, beyond what ``EstimatorConfig`` says."""

    current: WaterMotionConfig = quantity(WaterMotionConfig(), title="Current")
    """Motion of the water."""
    buoyancy_bias_kg: float = quantity(
        0.0003, "kg", title="Ballast error", ge=0.0, le=1.0, display_unit="g"
    )
    """Standard deviation of what the feedback of the net buoyancy says too much."""
    buoyancy_correlation_s: float = quantity(
        86400.0, "s", title="Change of the ballast error", gt=0.0, le=1e7, advanced=True
    )
    """Time over which the ballast error changes."""
    model_error: float = quantity(0.1, title="Error of the model", ge=0.0, le=0.3)
    """Standard deviation of each of the model's coefficients of drag, side force and lift, as a
    share of it. The filter learns from depth and fixes how far they are off."""
    model_error_correlation_s: float = quantity(
        100.0, "s", title="Correlation of that error", gt=0.0, le=1e7, advanced=True
    )
    """Time over which one share fits: part of the force changes with the angle of attack and the
    tail, by coefficients with errors of their own, so a glide's share is not the next one's."""
    acceleration_density: float = quantity(
        1.5e-10, "m^2/s^3", title="Acceleration noise", gt=0.0, le=1.0, advanced=True
    )
    """Spectral density per body axis of accelerations that no coefficient explains. It does not
    stand for a wrong model, whose error lasts; that is "Error of the model"."""
    rate_noise_rad_sqrt_s: float = quantity(
        0.0016, "rad/s^0.5", title="Gyro noise", ge=0.0, le=1.0, advanced=True
    )
    """Root density of the angular velocity's noise: the gyro's deviation by the root of its
    period. With the robot's speed it is a Coriolis acceleration."""
    heading_std_rad: float = quantity(
        0.008, "rad", title="Heading error", ge=0.0, le=0.5, display_unit="deg", advanced=True
    )
    """Standard deviation of the filtered heading; turns the way made aside."""
    tilt_std_rad: float = quantity(
        0.0025, "rad", title="Tilt error", ge=0.0, le=0.5, display_unit="deg", advanced=True
    )
    """Standard deviation of the filtered roll and pitch; adds to the vertical speed."""
    attitude_correlation_s: float = quantity(
        1.0, "s", title="Attitude correlation", gt=0.0, le=3600.0, advanced=True
    )
    """Time over which the attitude's error stays."""
    greatest_speed_m_s: float = quantity(
        0.25, "m/s", title="Greatest speed", gt=0.0, le=5.0, advanced=True
    )
    """How fast the robot may have moved while nothing was measured."""
    outlier: OutlierConfig = quantity(OutlierConfig(), title="Outliers", advanced=True)
    """When a fix or a depth is refused."""


MODEL_FILTER_PRESETS: dict[str, ModelFilterConfig] = {
    "miniglider": ModelFilterConfig(),
    "grace3": ModelFilterConfig(
        current=WaterMotionConfig(eddy_correlation_s=20.0),
        buoyancy_bias_kg=0.002,
        model_error=0.15,
        rate_noise_rad_sqrt_s=0.00063,
        heading_std_rad=0.006,
        tilt_std_rad=0.0015,
        greatest_speed_m_s=0.5,
    ),
}
"""Settings by vehicle, for the waters of ``ESTIMATOR_PRESETS``. Miniglider's coefficients are
identified, each within a tenth or so; GRACE 3's are scaled from them and nobody has measured one.
"""
