"""Settings of the swimming controller."""

import math

from autonomy.configuration import quantity
from autonomy.control.integral_config import INTEGRAL_PRESETS, IntegralConfig
from autonomy.vehicle.config import VEHICLES

SLOWEST_M_S = 0.01
"""Below this forward speed the pitch no longer decides where the robot goes."""
TURNING_SHARE = 0.5
"""Least speed as a share of the wanted one: only a flapping tail turns a robot that stands."""


class SwimmingConfig(IntegralConfig):
    """How a robot swims along a reference with its tail (thesis section 5.3).

    The tail's bias steers, its amplitude sets the speed at a fixed frequency, and depth is held by
    pitch and net buoyancy, both by the integral backstepping law. The pitch of the reference is
    not tracked. An amplitude that the servo cannot follow at the frequency is cut: its angular
    velocity, 2 pi x frequency x amplitude, stays below the servo's rate.
    """

    pitch_trade_rad: float = quantity(
        0.0,
        "rad",
        title="Pitch given up for position",
        ge=0.0,
        lt=math.pi / 2.0,
        display_unit="deg",
        advanced=True,
    )
    """Pitch that wins back distance in a glide; a swimming robot has its tail for that."""
    k_along_integral: float = quantity(
        0.0, "1/s", title="Distance integral gain", ge=0.0, advanced=True
    )
    """Growth of the added distance by the distance to the target ahead."""
    position_gain: float = quantity(0.1, "1/s", title="Position gain", gt=0.0, le=5.0)
    """Horizontal velocity by horizontal error."""
    speed_gain: float = quantity(1.0, "", title="Speed gain", ge=0.0, le=10.0)
    """Speed that the tail is set for above the wanted one, by the speed that is missing."""
    heading_gain: float = quantity(2.0, "", title="Tail bias by heading error", gt=0.0, le=10.0)
    """Bias of the tail by error of the heading."""
    heading_rate_gain: float = quantity(1.0, "s", title="Tail bias by turn rate", ge=0.0, le=20.0)
    """Bias of the tail against the rate of the heading."""
    bias_most_rad: float = quantity(
        1.2, "rad", title="Most tail bias", gt=0.0, le=math.pi / 2.0, display_unit="deg"
    )
    """Greatest bias of the tail."""
    amplitude_most_rad: float = quantity(
        0.40, "rad", title="Most tail amplitude", gt=0.0, le=math.pi / 2.0, display_unit="deg"
    )
    """Greatest amplitude of the tail."""
    frequency_hz: float = quantity(0.40, "Hz", title="Tail frequency", gt=0.0, le=10.0)
    """Frequency of the flap."""
    depth_gain: float = quantity(0.1, "1/s", title="Depth by pitch gain", ge=0.0, le=5.0)
    """Rate of depth by depth error, which the pitch is set for."""
    pitch_most_rad: float = quantity(
        math.radians(20.0),
        "rad",
        title="Most pitch",
        gt=0.0,
        le=math.radians(60.0),
        display_unit="deg",
    )
    """Greatest pitch, either way."""


def _preset(key: str) -> SwimmingConfig:
    learning = INTEGRAL_PRESETS[key].model_dump()
    learning |= {"pitch_trade_rad": 0.0, "k_along_integral": 0.0}
    gait = VEHICLES[key].swim
    return SwimmingConfig(
        **learning, amplitude_most_rad=gait.amplitude_rad, frequency_hz=gait.frequency_hz
    )


SWIMMING_PRESETS: dict[str, SwimmingConfig] = {key: _preset(key) for key in INTEGRAL_PRESETS}
"""Settings a robot starts with, by vehicle, with that vehicle's own gait."""
SWIMMING_SIMULATION = SWIMMING_PRESETS["miniglider"]
"""Settings for exact states: those of the Miniglider; the thesis prints none."""
