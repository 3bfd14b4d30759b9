"""A robot's state in the messages that ground stations of other makers understand."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from autonomy.frames import convergence_rad, wgs84_from_ned
from onboard.link.waypoint_mission import WaypointRules
from robot_link.mavlink.codec import WireMessage
from robot_link.mavlink.wire import grace
from robot_link.messages import StateReport, SystemId

_SENSORS = (
    grace.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | grace.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | grace.MAV_SYS_STATUS_SENSOR_3D_MAG
    | grace.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
    | grace.MAV_SYS_STATUS_SENSOR_BATTERY
    | grace.MAV_SYS_STATUS_AHRS
)
"""What every robot flies with: one whose sensor is dead says so by its own reports."""
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_SURFACE_HPA = 1013.25
_HPA_PER_M = 98.0665
"""Fresh water of 1000 kg/m^3."""
_UNKNOWN_16 = 2**16 - 1
_LONGEST_MS = 2**32

CAPABILITIES = (
    grace.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    | grace.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
    | grace.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
    | grace.MAV_PROTOCOL_CAPABILITY_FTP
    | grace.MAV_PROTOCOL_CAPABILITY_MAVLINK2
)


@dataclass(frozen=True, slots=True)
class TelemetrySource:
    """What standard messages are made of."""

    state: StateReport
    began_at: datetime
    """When the robot was switched on, by its own clock."""
    rules: WaypointRules

    @property
    def boot_ms(self) -> int:
        """Milliseconds since the robot was switched on."""
        elapsed = self.state.measured_at - self.began_at
        return max(0, elapsed // timedelta(milliseconds=1)) % _LONGEST_MS

    @property
    def unix_us(self) -> int:
        """Microseconds since 1970 of the robot's clock."""
        return max(0, (self.state.measured_at - _EPOCH) // timedelta(microseconds=1))

    @property
    def latitude_longitude_e7(self) -> tuple[int, int]:
        """Place on the globe, 1e-7 deg."""
        place = wgs84_from_ned(
            self.state.position_ned[:2],
            self.rules.origin_latitude_deg,
            self.rules.origin_longitude_deg,
        )
        latitude, longitude = place.tolist()
        return round(latitude * 1e7), round(longitude * 1e7)

    @property
    def convergence_rad(self) -> float:
        """What is added to a heading from the site's north to have the true one."""
        place = self.state.position_ned[:2]
        return float(convergence_rad(place, self.rules.origin_latitude_deg))


def telemetry_message(message_id: int, source: TelemetrySource) -> WireMessage | None:
    """Return a standard message of a state; None for one that robots here do not have."""
    made = _MAKERS.get(message_id)
    return None if made is None else made(source)


def autopilot_version(system: SystemId) -> grace.MAVLink_autopilot_version_message:
    """Return what the robot can do, as other makers' ground stations ask for it."""
    return grace.MAVLink_autopilot_version_message(
        capabilities=CAPABILITIES,
        flight_sw_version=0,
        middleware_sw_version=0,
        os_sw_version=0,
        board_version=0,
        flight_custom_version=bytes(8),
        middleware_custom_version=bytes(8),
        os_custom_version=bytes(8),
        vendor_id=0,
        product_id=0,
        uid=int(system),
    )


def _attitude(source: TelemetrySource) -> WireMessage:
    state = source.state
    return grace.MAVLink_attitude_message(
        time_boot_ms=source.boot_ms,
        roll=state.roll_rad,
        pitch=state.pitch_rad,
        yaw=math.remainder(state.heading_rad + source.convergence_rad, math.tau),
        rollspeed=0.0,
        pitchspeed=0.0,
        yawspeed=0.0,
    )


def _local_position(source: TelemetrySource) -> WireMessage:
    north, east, down = source.state.position_ned
    velocity = source.state.velocity_ned
    return grace.MAVLink_local_position_ned_message(
        source.boot_ms, north, east, down, velocity[0], velocity[1], velocity[2]
    )


def _global_position(source: TelemetrySource) -> WireMessage:
    latitude, longitude = source.latitude_longitude_e7
    state = source.state
    height_mm = _clipped(-max(0.0, state.position_ned[2]) * 1e3, 31)
    lead_rad = source.convergence_rad
    north, east = state.velocity_ned[:2]
    return grace.MAVLink_global_position_int_message(
        time_boot_ms=source.boot_ms,
        lat=latitude,
        lon=longitude,
        alt=height_mm,
        relative_alt=height_mm,
        vx=_clipped((north * math.cos(lead_rad) - east * math.sin(lead_rad)) * 100, 15),
        vy=_clipped((north * math.sin(lead_rad) + east * math.cos(lead_rad)) * 100, 15),
        vz=_clipped(state.velocity_ned[2] * 100, 15),
        hdg=_course_cdeg(state.heading_rad + lead_rad),
    )


def _satellite_fix(source: TelemetrySource) -> WireMessage:
    latitude, longitude = source.latitude_longitude_e7
    state = source.state
    speed = math.hypot(*state.velocity_ned[:2])
    has_fix = state.has_fix
    return grace.MAVLink_gps_raw_int_message(
        time_usec=source.unix_us,
        fix_type=grace.GPS_FIX_TYPE_3D_FIX if has_fix else grace.GPS_FIX_TYPE_NO_FIX,
        lat=latitude,
        lon=longitude,
        alt=_clipped(-state.position_ned[2] * 1e3, 31),
        eph=_UNKNOWN_16,
        epv=_UNKNOWN_16,
        vel=min(_UNKNOWN_16 - 1, round(speed * 100)),
        cog=_UNKNOWN_16,
        satellites_visible=255,
    )


def _pressure(source: TelemetrySource) -> WireMessage:
    return grace.MAVLink_scaled_pressure_message(
        time_boot_ms=source.boot_ms,
        press_abs=_SURFACE_HPA + _HPA_PER_M * source.state.position_ned[2],
        press_diff=0.0,
        temperature=0,
    )


def _system_status(source: TelemetrySource) -> WireMessage:
    gps = grace.MAV_SYS_STATUS_SENSOR_GPS if source.state.has_fix else 0
    return grace.MAVLink_sys_status_message(
        onboard_control_sensors_present=_SENSORS | grace.MAV_SYS_STATUS_SENSOR_GPS,
        # Under water there is no GPS to be ill.
        onboard_control_sensors_enabled=_SENSORS | gps,
        # There is no fence; without this bit MAVProxy calls it breached.
        onboard_control_sensors_health=_SENSORS | gps | grace.MAV_SYS_STATUS_GEOFENCE,
        load=0,
        voltage_battery=_battery_mv(source),
        current_battery=-1,
        battery_remaining=_percent(source.state.battery_fraction),
        drop_rate_comm=0,
        errors_comm=0,
        errors_count1=0,
        errors_count2=0,
        errors_count3=0,
        errors_count4=0,
    )


def _battery_mv(source: TelemetrySource) -> int:
    return min(_UNKNOWN_16 - 1, max(0, round(source.state.battery_v * 1e3)))


def _battery(source: TelemetrySource) -> WireMessage:
    return grace.MAVLink_battery_status_message(
        id=0,
        battery_function=grace.MAV_BATTERY_FUNCTION_ALL,
        type=grace.MAV_BATTERY_TYPE_UNKNOWN,
        temperature=2**15 - 1,
        voltages=[_battery_mv(source), *[_UNKNOWN_16] * 9],
        current_battery=-1,
        current_consumed=-1,
        energy_consumed=-1,
        battery_remaining=_percent(source.state.battery_fraction),
    )


def _head_up(source: TelemetrySource) -> WireMessage:
    state = source.state
    true_rad = state.heading_rad + source.convergence_rad
    return grace.MAVLink_vfr_hud_message(
        airspeed=0.0,
        groundspeed=math.hypot(*state.velocity_ned[:2]),
        heading=round(math.degrees(true_rad)) % 360,
        throttle=0,
        alt=-max(0.0, state.position_ned[2]),
        climb=-state.velocity_ned[2],
    )


def _estimator(source: TelemetrySource) -> WireMessage:
    good = grace.ESTIMATOR_ATTITUDE | grace.ESTIMATOR_POS_VERT_ABS | grace.ESTIMATOR_POS_HORIZ_REL
    return grace.MAVLink_estimator_status_message(
        time_usec=source.unix_us,
        flags=good | (grace.ESTIMATOR_POS_HORIZ_ABS if source.state.has_fix else 0),
        vel_ratio=0.0,
        pos_horiz_ratio=0.0,
        pos_vert_ratio=0.0,
        mag_ratio=0.0,
        hagl_ratio=0.0,
        tas_ratio=0.0,
        pos_horiz_accuracy=source.state.position_std_m,
        pos_vert_accuracy=0.0,
    )


def _system_time(source: TelemetrySource) -> WireMessage:
    return grace.MAVLink_system_time_message(
        time_unix_usec=source.unix_us, time_boot_ms=source.boot_ms
    )


_MAKERS: dict[int, Callable[[TelemetrySource], WireMessage]] = {
    grace.MAVLINK_MSG_ID_ATTITUDE: _attitude,
    grace.MAVLINK_MSG_ID_LOCAL_POSITION_NED: _local_position,
    grace.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: _global_position,
    grace.MAVLINK_MSG_ID_GPS_RAW_INT: _satellite_fix,
    grace.MAVLINK_MSG_ID_SCALED_PRESSURE: _pressure,
    grace.MAVLINK_MSG_ID_SYS_STATUS: _system_status,
    grace.MAVLINK_MSG_ID_BATTERY_STATUS: _battery,
    grace.MAVLINK_MSG_ID_SYSTEM_TIME: _system_time,
    grace.MAVLINK_MSG_ID_VFR_HUD: _head_up,
    grace.MAVLINK_MSG_ID_ESTIMATOR_STATUS: _estimator,
}


def _clipped(value: float, bits: int) -> int:
    return max(-(2**bits), min(2**bits - 1, round(value)))


def _percent(fraction: float) -> int:
    return max(0, min(100, round(fraction * 100)))


def _course_cdeg(heading_rad: float) -> int:
    return round(math.degrees(heading_rad) * 100) % 36000
