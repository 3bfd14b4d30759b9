"""Sensors of a simulated robot: the truth, with the errors of real instruments."""

from dataclasses import dataclass, replace

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field.synthetic import measure
from autonomy.frames import TrueNorth
from onboard.flight.hardware import Readings, SetPoints
from simulator.battery import Battery


@dataclass(frozen=True, slots=True)
class SensorModel:
    """Errors of one robot's sensors; all noise is white and Gaussian."""

    depth_std_m: float
    tilt_std_rad: float
    """Of roll and pitch."""
    heading_std_rad: float
    gyro_std_rad_s: float
    buoyancy_bias_kg: float
    """Standard deviation of the net buoyancy's constant error: ballast is never exact."""
    buoyancy_std_kg: float
    mass_position_bias_m: float
    """Standard deviation of the constant error of the sliding mass's position."""
    mass_position_std_m: float
    tail_std_rad: float
    battery_std_v: float
    fix_std_m: float
    """Of one position fix, per horizontal axis."""
    fix_depth_m: float
    """True depth below which no fix is possible; minus infinity for a robot without that sensor."""
    fix_period_s: float


class Sensors:
    """Reads the truth with errors drawn from a generator of its own.

    Args:
        model: Size of the errors.
        variable: Field that the science sensor measures, a key of ``autonomy.channel``.
        generator: Source of randomness.
        north: True north, from which the compass counts; None where it is the frame's.
    """

    def __init__(
        self,
        model: SensorModel,
        variable: str,
        generator: np.random.Generator,
        north: TrueNorth | None = None,
    ) -> None:
        self._model = model
        self._north = north
        self._variable = variable
        self._generator = generator
        self.buoyancy_bias_kg = model.buoyancy_bias_kg * generator.standard_normal()
        """What the feedback of the pump is wrong by, for good."""
        # a generator of its own, so that this error leaves the noise of a seed as it was
        self.mass_position_bias_m = (
            model.mass_position_bias_m * generator.spawn(1)[0].standard_normal()
        )
        """What the feedback of the sliding mass is wrong by, for good."""
        self._noise_std = np.array(
            [
                model.depth_std_m,
                *(model.tilt_std_rad, model.tilt_std_rad, model.heading_std_rad),
                *(model.gyro_std_rad_s,) * 3,
                *(model.buoyancy_std_kg, model.mass_position_std_m, model.tail_std_rad),
                model.battery_std_v,
                *(model.fix_std_m,) * 2,
            ]
        )
        self._next_fix_s = 0.0

    def read(self, time_s: float, state: FloatArray, battery: Battery) -> Readings:
        """Return one set of readings.

        Args:
            time_s: Time of the robot, which paces the fixes.
            state: True state, shape ``(15,)``, as in ``Plant``.
            battery: True charge and voltage.
        """
        noise = (self._noise_std * self._generator.standard_normal(13)).tolist()
        x = state.tolist()
        has_fix = x[2] <= self._model.fix_depth_m and time_s >= self._next_fix_s - 1e-6
        if has_fix:
            self._next_fix_s = time_s + self._model.fix_period_s
        north = 0.0 if self._north is None else self._north.convergence_rad(x[0], x[1])
        return Readings(
            depth_m=x[2] + noise[0],
            roll_rad=x[3] + noise[1],
            pitch_rad=x[4] + noise[2],
            heading_rad=x[5] + north + noise[3],
            gyro_rad_s=(x[9] + noise[4], x[10] + noise[5], x[11] + noise[6]),
            net_buoyancy_kg=x[12] + noise[7] + self.buoyancy_bias_kg,
            mass_position_m=x[13] + noise[8] + self.mass_position_bias_m,
            tail_rad=x[14] + noise[9],
            battery_fraction=battery.fraction,
            battery_v=battery.voltage_v + noise[10],
            fix_ne_m=(x[0] + noise[11], x[1] + noise[12]) if has_fix else None,
        )

    def driven_to(self, command: SetPoints) -> SetPoints:
        """Return where the actuators' own servos really go: they close on their feedback."""
        return replace(
            command,
            net_buoyancy_kg=command.net_buoyancy_kg - self.buoyancy_bias_kg,
            mass_position_m=command.mass_position_m - self.mass_position_bias_m,
        )

    def measure_field(self, position_ned: tuple[float, float, float]) -> float:
        """Return one noisy measurement of the field at a true position, in its unit."""
        return float(measure(self._variable, np.array([position_ned]), self._generator)[0])
