"""What the submarine says of itself, message by message, in the way of ArduSub."""

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

import numpy as np

from autonomy.frames import wgs84_from_ned
from robot_link.mavlink.codec import WireMessage
from robot_link.mavlink.wire import grace
from simulator.instrument import Instruments
from simulator.sub.autopilot import MODES, SubAutopilot
from simulator.sub.definition import SubDefinition
from simulator.sub.plant import SubPlant
from simulator.water_field import WaterField

PERIODS_S: Final[Mapping[str, float]] = MappingProxyType(
    {
        "attitude": 0.25,
        "global_position": 0.25,
        "local_position": 0.5,
        "vfr_hud": 0.5,
        "ahrs2": 0.5,
        "gps": 1.0,
        "internal_pressure": 1.0,
        "external_pressure": 0.5,
        "humidity": 2.0,
        "sys_status": 1.0,
        "battery": 2.0,
        "floor": 1.0,
        "mission": 1.0,
        "named_values": 2.0,
    }
)
"""How often each is said to a station that asked for telemetry, wall seconds."""
FIX_DEPTH_M: Final = 0.3
"""Deeper than this it hears no GPS, and nobody reaches it."""
_NO_UINT16: Final = 2**16 - 1
_NO_INT16: Final = 2**15 - 1
_SENSORS: Final = (
    grace.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | grace.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | grace.MAV_SYS_STATUS_SENSOR_3D_MAG
    | grace.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
    | grace.MAV_SYS_STATUS_SENSOR_BATTERY
    | grace.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
)


class SubTelemetry:
    """Makes messages of what is so now; it changes nothing."""

    def __init__(self, definition: SubDefinition, plant: SubPlant, autopilot: SubAutopilot) -> None:
        self._site = definition.site
        self._field = WaterField(definition.site)
        self._instruments = Instruments(
            definition.instruments, self._field, np.random.default_rng(definition.system_id)
        )
        self.faults = definition.faults
        """What is wrong; it may change as the vehicle lives."""
        self._plant = plant
        self._autopilot = autopilot
        self._make: Mapping[str, Callable[[], WireMessage]] = {
            "attitude": self._attitude,
            "global_position": self._global_position,
            "local_position": self._local_position,
            "vfr_hud": self._vfr_hud,
            "ahrs2": self._ahrs2,
            "gps": self._gps,
            "internal_pressure": self._internal_pressure,
            "external_pressure": self._external_pressure,
            "humidity": self._humidity,
            "sys_status": self._sys_status,
            "battery": self._battery,
            "floor": self._floor,
            "mission": self._mission,
        }

    def messages(self, name: str) -> list[WireMessage]:
        """Return what is to be said of one of ``PERIODS_S``."""
        return self._named_values() if name == "named_values" else [self._make[name]()]

    def _named_values(self) -> list[WireMessage]:
        """Return what its science instruments say; nothing of dead ones."""
        if self._plant.time_s >= self.faults.sensor_dies_s:
            return []
        measured = self._instruments.measure(self._instruments.periods_s, self._position)
        return [
            grace.MAVLink_named_value_float_message(self._ms, key.encode(), value)
            for key, value in measured.items()
        ]

    def heartbeat(self) -> WireMessage:
        """Return what it says of its presence."""
        pilot = self._autopilot
        base = grace.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        if pilot.is_armed:
            base |= grace.MAV_MODE_FLAG_SAFETY_ARMED
        state = grace.MAV_STATE_ACTIVE if pilot.is_armed else grace.MAV_STATE_STANDBY
        if pilot.is_leaking:
            state = grace.MAV_STATE_CRITICAL
        return grace.MAVLink_heartbeat_message(
            grace.MAV_TYPE_SUBMARINE, grace.MAV_AUTOPILOT_ARDUPILOTMEGA, base, pilot.mode, state, 3
        )

    @property
    def _ms(self) -> int:
        return round(1e3 * self._plant.time_s) % 2**32

    @property
    def _position(self) -> tuple[float, float, float]:
        plant = self._plant
        return plant.north_m, plant.east_m, plant.depth_m

    def _place(self) -> tuple[int, int]:
        plant, site = self._plant, self._site
        place = wgs84_from_ned(
            (plant.north_m, plant.east_m), site.origin_latitude_deg, site.origin_longitude_deg
        )
        return round(float(place[0]) * 1e7), round(float(place[1]) * 1e7)

    def _attitude(self) -> WireMessage:
        plant = self._plant
        return grace.MAVLink_attitude_message(
            self._ms,
            plant.roll_rad,
            plant.pitch_rad,
            plant.heading_rad,
            0.0,
            0.0,
            plant.turn_rad_s,
        )

    def _global_position(self) -> WireMessage:
        plant = self._plant
        up_mm = round(-1e3 * plant.depth_m)
        north, east, down = (round(100.0 * one) for one in plant.velocity_ned)
        heading = round(math.degrees(plant.heading_rad) % 360.0 * 100.0) % 36_000
        return grace.MAVLink_global_position_int_message(
            self._ms, *self._place(), up_mm, up_mm, north, east, down, heading
        )

    def _local_position(self) -> WireMessage:
        plant = self._plant
        return grace.MAVLink_local_position_ned_message(
            self._ms, plant.north_m, plant.east_m, plant.depth_m, *plant.velocity_ned
        )

    def _vfr_hud(self) -> WireMessage:
        plant = self._plant
        speed = math.hypot(*plant.velocity_ned[:2])
        heading = round(math.degrees(plant.heading_rad)) % 360
        down = plant.velocity_ned[2]
        return grace.MAVLink_vfr_hud_message(0.0, speed, heading, 0, -plant.depth_m, -down)

    def _ahrs2(self) -> WireMessage:
        plant = self._plant
        return grace.MAVLink_ahrs2_message(
            plant.roll_rad, plant.pitch_rad, plant.heading_rad, -plant.depth_m, *self._place()
        )

    def _gps(self) -> WireMessage:
        plant = self._plant
        is_fixed = plant.depth_m <= FIX_DEPTH_M and plant.time_s < self.faults.gps_lost_s
        place = self._place() if is_fixed else (0, 0)
        return grace.MAVLink_gps_raw_int_message(
            0,
            grace.GPS_FIX_TYPE_3D_FIX if is_fixed else grace.GPS_FIX_TYPE_NO_FIX,
            *place,
            0,
            90 if is_fixed else _NO_UINT16,
            _NO_UINT16,
            _NO_UINT16,
            _NO_UINT16,
            11 if is_fixed else 0,
            0,
            1_200 if is_fixed else 0,
        )

    def _internal_pressure(self) -> WireMessage:
        return grace.MAVLink_scaled_pressure_message(self._ms, 1006.0, 0.0, 2640)

    def _external_pressure(self) -> WireMessage:
        celsius = float(self._field.truth("temperature", np.array([self._position]))[0])
        return grace.MAVLink_scaled_pressure2_message(
            self._ms, 1013.25 + 97.9 * self._plant.depth_m, 0.0, round(100.0 * celsius)
        )

    def _humidity(self) -> WireMessage:
        percent = 92 if self._autopilot.is_leaking else 31
        return grace.MAVLink_hygrometer_sensor_message(0, 2640, 100 * percent)

    def _sys_status(self) -> WireMessage:
        plant = self._plant
        return grace.MAVLink_sys_status_message(
            _SENSORS,
            _SENSORS,
            _SENSORS,
            210,
            round(1e3 * plant.voltage_v),
            round(100.0 * plant.current_a),
            round(100.0 * plant.charge),
            0,
            0,
            0,
            0,
            0,
            0,
        )

    def _battery(self) -> WireMessage:
        plant = self._plant
        cells = [round(1e3 * plant.voltage_v), *[_NO_UINT16] * 9]
        return grace.MAVLink_battery_status_message(
            0,
            0,
            0,
            _NO_INT16,
            cells,
            round(100.0 * plant.current_a),
            -1,
            -1,
            round(100.0 * plant.charge),
        )

    def _floor(self) -> WireMessage:
        above_cm = round(100.0 * max(0.0, self._plant.floor_m - self._plant.depth_m))
        return grace.MAVLink_distance_sensor_message(
            self._ms,
            30,
            10_000,
            above_cm,
            grace.MAV_DISTANCE_SENSOR_ULTRASOUND,
            0,
            grace.MAV_SENSOR_ROTATION_PITCH_270,
            _NO_UINT16 % 256,
        )

    def _mission(self) -> WireMessage:
        pilot = self._autopilot
        is_flying = pilot.mode == MODES["AUTO"]
        state = grace.MISSION_STATE_ACTIVE if is_flying else grace.MISSION_STATE_NOT_STARTED
        if not pilot.items:
            state = grace.MISSION_STATE_NO_MISSION
        total = max(0, len(pilot.items) - 1)
        return grace.MAVLink_mission_current_message(pilot.item, total, state)
