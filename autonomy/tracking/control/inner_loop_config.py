"""Settings of the loops that make a tail-beating robot move like a unicycle."""

import math

from autonomy.configuration import Configuration, quantity
from autonomy.vehicle.config import GRACE3, MINIGLIDER


class InnerLoopConfig(Configuration):
    """How turn rate and acceleration become bias and amplitude of the tail (thesis section 4.5).

    The frequency is held constant. Every measured signal is averaged over whole beats of the tail,
    because within a beat the robot swings more than it turns.
    """

    frequency_hz: float = quantity(0.4, "Hz", title="Tail frequency", gt=0.0, le=10.0)
    """Beats per second, held constant."""
    beats: int = quantity(1, "", title="Beats averaged over", ge=1, le=10, advanced=True)
    """Turn rate, speed and acceleration are means over so many beats of the tail."""
    current_time_s: float = quantity(
        1.0, "s", title="Current averaged over", gt=0.0, le=3600.0, advanced=True
    )
    """Time over which fixes are compared with the velocity through the water to learn the current
    that carries the robot; as short as the fixes are good."""
    amplitude_min_rad: float = quantity(
        0.03, "rad", title="Least tail amplitude", ge=0.0, le=math.pi / 2.0, display_unit="deg"
    )
    """Only a beating tail turns the robot, so it never rests; a small beat lets drag slow it."""
    amplitude_max_rad: float = quantity(
        0.40, "rad", title="Most tail amplitude", gt=0.0, le=math.pi / 2.0, display_unit="deg"
    )
    """Greatest amplitude that the servo can follow at the frequency."""
    bias_max_rad: float = quantity(
        1.0, "rad", title="Most tail bias", gt=0.0, le=math.pi / 2.0, display_unit="deg"
    )
    """Greatest bias; more turns the robot on the spot and stops it."""
    bias_hard_rad: float = quantity(
        1.2, "rad", title="Tail bias off a wall", gt=0.0, le=math.pi / 2.0, display_unit="deg"
    )
    """Bias that turns the robot off a wall: so hard that it loses speed."""
    hard_turn_rad_s: float = quantity(0.11, "rad/s", title="Hardest turn", gt=0.0, le=10.0)
    """Turn rate that it brings about."""
    hard_speed_m_s: float = quantity(0.03, "m/s", title="Speed in the hardest turn", gt=0.0, le=5.0)
    """Speed that it leaves."""
    hard_lag_s: float = quantity(4.0, "s", title="Lag of the hardest turn", ge=0.0, le=100.0)
    """Time constant with which both come about."""
    speed_floor_m_s: float = quantity(0.01, "m/s", title="Speed floor", gt=0.0, le=5.0)
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


INNER_LOOP_PRESETS: dict[str, InnerLoopConfig] = {
    "miniglider": InnerLoopConfig(
        frequency_hz=MINIGLIDER.swim.frequency_hz, amplitude_max_rad=MINIGLIDER.swim.amplitude_rad
    ),
    "grace3": InnerLoopConfig(
        frequency_hz=GRACE3.swim.frequency_hz,
        amplitude_max_rad=GRACE3.swim.amplitude_rad,
        current_time_s=15.0,
        speed_floor_m_s=0.02,
        # a hard turn costs more speed than it gains direction
        bias_max_rad=0.5,
        bias_hard_rad=0.8,
        hard_turn_rad_s=0.10,
        hard_speed_m_s=0.077,
        hard_lag_s=3.0,
        turn_feedforward_s=8.0,
        turn_gain_s=2.0,
        turn_integral_gain=0.2,
    ),
}
"""Settings by vehicle, found on the simulated robots; the thesis prints none of its gains."""
