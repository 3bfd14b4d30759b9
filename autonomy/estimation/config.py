"""Settings of the onboard estimators, and presets per vehicle."""

from autonomy.configuration import Configuration, quantity


class EstimatorConfig(Configuration):
    """Noise that the position filter assumes, and the velocity observer's gains."""

    surface_depth_m: float = quantity(0.05, "m", title="Fix depth", gt=0.0, le=2.0)
    """At this depth or above, the horizontal position can be fixed from outside."""
    fix_std_m: float = quantity(0.01, "m", title="Fix noise", gt=0.0, le=100.0)
    """Standard deviation of one horizontal position fix, per axis."""
    depth_std_m: float = quantity(0.003, "m", title="Depth noise", gt=0.0, le=5.0)
    """Standard deviation of one depth measurement."""
    drift_m_sqrt_s: float = quantity(0.02, "m/s^0.5", title="Drift", ge=0.001, le=10.0)
    """Growth of the dead-reckoned position's standard deviation, per axis, per root second under
    water; the velocity's noise at period dt is this divided by the root of dt."""
    acceleration_density: float = quantity(
        1e-5, "m^2/s^3", title="Acceleration noise", gt=0.0, le=1.0, advanced=True
    )
    """Spectral density of the white acceleration that lets the velocity change."""
    observer_velocity_gain: float = quantity(
        0.25, "1/s^2", title="Observer gain K1", ge=0.0, le=25.0, advanced=True
    )
    """How strongly the depth error corrects the velocity observer's body velocity."""
    observer_depth_gain: float = quantity(
        1.0, "1/s", title="Observer gain K2", ge=0.0, le=10.0, advanced=True
    )
    """How strongly the depth error corrects the velocity observer's depth."""


ESTIMATOR_PRESETS: dict[str, EstimatorConfig] = {
    "miniglider": EstimatorConfig(),
    "grace3": EstimatorConfig(
        surface_depth_m=0.3,
        fix_std_m=1.5,
        depth_std_m=0.01,
        drift_m_sqrt_s=0.3,
        acceleration_density=1e-3,
    ),
}
"""Settings by vehicle: cameras over a tank, and a differential GPS (3 m at 95 %) on a lake with a
current of a few centimetres a second that dead reckoning does not see."""
