"""Settings of the loops that make a tail-beating robot move like a unicycle."""

import math

from autonomy.configuration import Configuration, quantity
from autonomy.vehicle.config import VEHICLES


class InnerLoopConfig(Configuration):
    """How turn rate and acceleration become bias and amplitude of the tail (thesis section 4.5).

    The frequency is held constant. Every measured signal is averaged over whole beats of the tail,
    because within a beat the robot swings more than it turns.
    """

    frequency_hz: float = quantity(0.4, "Hz", title="Tail frequency", gt=0.0, le=10.0)
    """Beats per second, held constant."""
    beats: int = quantity(1, "", title="Beats averaged over", ge=1, le=10, advanced=True)
    """Turn rate, speed and acceleration are means over so many beats of the tail."""
    amplitude_min_rad: float = quantity(
        0.15, "rad", title="Least tail amplitude", gt=0.0, le=math.pi / 2.0, display_unit="deg"
    )
    """Only a beating tail turns the robot, so it never rests."""
    amplitude_max_rad: float = quantity(
        0.40, "rad", title="Most tail amplitude", gt=0.0, le=math.pi / 2.0, display_unit="deg"
    )
    """Greatest amplitude that the servo can follow at the frequency."""
    bias_max_rad: float = quantity(
        1.0, "rad", title="Most tail bias", gt=0.0, le=math.pi / 2.0, display_unit="deg"
    )
    """Greatest bias; more turns the robot on the spot and stops it."""
    speed_floor_m_s: float = quantity(0.02, "m/s", title="Speed floor", gt=0.0, le=5.0)
    """A slower robot beats as hard as it can and steers less until it has this speed again."""
    turn_feedforward_s: float = quantity(
        9.0, "s", title="Tail bias by wanted turn rate", ge=0.0, le=100.0
    )
    """Bias that a turn rate is known to need at full amplitude."""
    turn_gain_s: float = quantity(4.0, "s", title="Tail bias by turn rate error", ge=0.0, le=100.0)
    """Proportional gain of the turn rate's loop."""
    turn_integral_gain: float = quantity(
        0.6, "", title="Tail bias by heading error", ge=0.0, le=100.0
    )
    """Integral gain of the turn rate's loop: bias by the heading that was not turned."""
    acceleration_gain_s2_m: float = quantity(
        4.0, "s2/m", title="Tail amplitude by acceleration error", ge=0.0, le=1e4
    )
    """Proportional gain of the acceleration's loop."""
    acceleration_integral_gain_s_m: float = quantity(
        6.0, "s/m", title="Tail amplitude by speed error", ge=0.0, le=1e4
    )
    """Integral gain of the acceleration's loop: amplitude by the speed that was not gained."""


def _preset(key: str) -> InnerLoopConfig:
    gait = VEHICLES[key].swim
    return InnerLoopConfig(frequency_hz=gait.frequency_hz, amplitude_max_rad=gait.amplitude_rad)


INNER_LOOP_PRESETS: dict[str, InnerLoopConfig] = {key: _preset(key) for key in VEHICLES}
"""Settings by vehicle, found on the simulated robots; the thesis prints none of its gains."""
