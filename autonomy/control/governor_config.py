"""Settings of the robust controller, which learns offsets and knows a slow, late mass actuator."""

from autonomy.configuration import quantity
from autonomy.control.integral_config import (
    INTEGRAL_PRESETS,
    INTEGRAL_SIMULATION,
    IntegralConfig,
)

MOST_DELAY_CALLS = 255
"""Commands that may be on their way to the sliding mass; a longer delay is taken as this long."""


class GovernorConfig(IntegralConfig):
    """Backstepping that learns its offsets, for an actuator with a delay and a small rate.

    Rate and delay of the sliding mass are those that are told here until its feedback refutes them;
    from then on they are what the feedback says (``actuator_kernel``).

    The pitch law works on the state that the model predicts for the moment at which a command
    takes effect, and its bandwidth is lowered to what the mass actuator can follow: at bandwidth
    w an error e asks for a growth of the angular acceleration of w^3 e, which the actuator's rate
    bounds. The three pitch gains are those of the greatest bandwidth, and fall with w, w^2 and
    w^3. What is learned, as in integral backstepping, corrects the model that predicts; with
    integral gains of 0 nothing is.
    """

    k_along_integral: float = quantity(
        0.0, "1/s", title="Distance integral gain", ge=0.0, advanced=True
    )
    """Growth of the added distance by the distance to the target ahead; learning it gives up more
    pitch, which a slow actuator has to follow."""
    mass_rate_share: float = quantity(
        1.0, "", title="Known rate of the sliding mass", gt=0.0, le=2.0
    )
    """Greatest speed of the sliding mass as a share of the vehicle's nominal one, as far as its
    feedback says nothing else."""
    mass_delay_s: float = quantity(
        0.0, "s", title="Known delay of the sliding mass", ge=0.0, le=2.0
    )
    """Time between a command and the beginning of the sliding mass's answer, as far as its feedback
    says nothing else."""
    rate_use: float = quantity(4.0, "", title="Use of the rate", gt=0.0, le=100.0, advanced=True)
    """Growth of the angular acceleration that is asked for, as a multiple of what the sliding
    mass's rate gives. At 1 the mass keeps up with every error; above, it lags behind large ones."""
    error_floor_rad: float = quantity(
        0.02,
        "rad",
        title="Error that is taken for noise",
        gt=0.0,
        le=0.5,
        display_unit="deg",
        advanced=True,
    )
    """Below this error the bandwidth is not raised any more."""
    delay_margin: float = quantity(0.5, "", title="Delay margin", gt=0.0, le=3.0, advanced=True)
    """Greatest product of bandwidth and delay, for a model that predicts only so well."""

    def delay_calls(self, dt_s: float) -> int:
        """How many calls, ``dt_s`` apart, a command of the sliding mass is taken to be late."""
        return min(round(self.mass_delay_s / dt_s), MOST_DELAY_CALLS) if dt_s > 0.0 else 0


GOVERNOR_EXPERIMENT = GovernorConfig()
"""Gains of the thesis's experiments as the greatest bandwidth; nominal actuator."""
GOVERNOR_SIMULATION = GovernorConfig.model_validate(
    {**INTEGRAL_SIMULATION.model_dump(), "k_along_integral": 0.0}
)
"""Gains of the thesis's simulation as the greatest bandwidth; nominal actuator."""
GOVERNOR_PRESETS: dict[str, GovernorConfig] = {
    key: GovernorConfig.model_validate({**preset.model_dump(), "k_along_integral": 0.0})
    for key, preset in INTEGRAL_PRESETS.items()
}
"""Settings a robot starts with, by vehicle; bandwidth follows from the model's own actuator."""
