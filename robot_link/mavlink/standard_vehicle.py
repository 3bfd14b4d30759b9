"""A vehicle of another maker: its standard messages put together to what the fleet shows.

Nothing is made up: what the vehicle does not say is absent, and each value carries when it came.
Depth is positive down, from the first source that is fresh; an altitude above the surface is none.
The position is that in the water's frame, if the vehicle says a place on Earth.
"""

import math
from collections import deque
from collections.abc import Iterator
from datetime import datetime, timedelta
from typing import Final

from autonomy.channel import CHANNELS
from autonomy.frames import ned_from_wgs84, wrap_angle
from robot_link.mavlink import flight_mode
from robot_link.mavlink.codec import ROBOT_COMPONENT, WireMessage
from robot_link.mavlink.standard_motor import Motors
from robot_link.mavlink.standard_reading import battery, finite, readings
from robot_link.mavlink.status_text import StatusTexts
from robot_link.mavlink.wire import grace
from robot_link.messages import LogId, RobotId, RobotMode, Sample, StateReport
from robot_link.report import Reading, VehiclePlace, VehicleReport, VehicleValue, VehicleWord

VehicleEvent = StateReport | VehicleReport | VehicleWord | Sample | Reading

_FRESH_S: Final = 3.0
_BATTERY_FRESH_S: Final = 60.0
_PERIOD_S: Final = 0.2
_SAMPLE_PERIOD_S: Final = 1.0
_READING_PERIOD_S: Final = 5.0
"""Of what belongs to no place, unless a switch turns."""
_ABOVE_MAX_M: Final = 1.0
"""A depth is taken for zero so far above the surface, and for none beyond."""
_HPA_OF_METRE: Final = 97.9
"""Of fresh water."""
_SURFACE_M: Final = 0.3
_WORDS_KEPT: Final = 10
_VALUES_MAX: Final = 256
"""Of different names, however many a vehicle makes up."""
_FIX_3D: Final = 3
_METRES_OF_HDOP: Final = 2.5
"""Error of a GPS range, by which a dilution of precision becomes an error of position."""
_UNKNOWN_UINT16: Final = 2**16 - 1
_UNKNOWN_HEADING: Final = _UNKNOWN_UINT16
_STATIC: Final = frozenset(("battery_fraction", "battery_v"))
_SUB_SOURCES: Final = (
    "GLOBAL_POSITION_INT",
    "AHRS2",
    "VFR_HUD",
    "LOCAL_POSITION_NED",
    "ALTITUDE",
    "SCALED_PRESSURE2",
)
_OTHER_SOURCES: Final = ("GLOBAL_POSITION_INT", "LOCAL_POSITION_NED", "ALTITUDE")
_STD_SOURCES: Final = ("LOCAL_POSITION_NED_COV", "ESTIMATOR_STATUS", "GPS_RAW_INT", "GPS HDOP")
_AUTOPILOT_NONE: Final = grace.MAV_AUTOPILOT_INVALID


def _is_switch(key: str) -> bool:
    channel = CHANNELS.get(key)
    return channel is not None and channel.kind == "switch"


def _has_place(key: str) -> bool:
    """Tell whether a value belongs where it was taken; one of a team's own channel may."""
    channel = CHANNELS.get(key)
    return channel is None or channel.can_map


class StandardVehicle:
    """Belongs to one event loop.

    Args:
        robot: Its name.
        origin_deg: Latitude and longitude of its water's origin; None where that is not known.
        speed: Seconds of the station's clock per second of the wall.
    """

    def __init__(
        self, robot: RobotId, origin_deg: tuple[float, float] | None = None, speed: float = 1.0
    ) -> None:
        self._robot = robot
        self._origin_deg = origin_deg
        self._speed = max(1.0, speed)
        self._texts = StatusTexts()
        self._newest_words: deque[str] = deque(maxlen=_WORDS_KEPT)
        self._words_said = 0
        self._heartbeat: grace.MAVLink_heartbeat_message | None = None
        self._values: dict[str, VehicleValue] = {}
        self._depths: dict[str, VehicleValue] = {}
        self._stds: dict[str, VehicleValue] = {}
        self._velocity: tuple[tuple[float, float, float], datetime] | None = None
        self._places: dict[str, tuple[float, float, datetime]] = {}
        """North and east by their source."""
        self._own_origin: tuple[float, float] | None = None
        """North and east of the vehicle's own local frame."""
        self._fix_at: datetime | None = None
        self._mission_item: int | None = None
        self._mission_items: int | None = None
        self._unhealthy: tuple[str, ...] = ()
        self._motors = Motors(self._speed)
        self._landed = ""
        self._told_at: datetime | None = None
        self._sampled_at: dict[str, datetime] = {}
        self._read: dict[str, VehicleValue] = {}
        """What was told last of each channel that belongs to no place."""
        self._log: LogId | None = None
        self._sequence = 0

    @property
    def is_ardusub(self) -> bool:
        """Whether it said that it is ArduSub."""
        beat = self._heartbeat
        return (
            beat is not None
            and beat.autopilot == grace.MAV_AUTOPILOT_ARDUPILOTMEGA
            and beat.type == grace.MAV_TYPE_SUBMARINE
        )

    @property
    def mode_number(self) -> int | None:
        """Its custom mode; None before its first heartbeat."""
        return None if self._heartbeat is None else self._heartbeat.custom_mode

    @property
    def is_armed(self) -> bool | None:
        """Whether its motors may turn; None before its first heartbeat."""
        beat = self._heartbeat
        return None if beat is None else bool(beat.base_mode & grace.MAV_MODE_FLAG_SAFETY_ARMED)

    @property
    def is_ardupilot(self) -> bool:
        """Whether its missions begin with its home, as those of ArduPilot do."""
        beat = self._heartbeat
        return beat is not None and beat.autopilot == grace.MAV_AUTOPILOT_ARDUPILOTMEGA

    @property
    def mission_item(self) -> int | None:
        """The item that it flies to; None until it said so."""
        return self._mission_item

    @property
    def depth_m(self) -> float | None:
        """How deep it said last to be; None where it did not."""
        known = self._values.get("depth_m")
        return None if known is None else known.value

    @property
    def last_word(self) -> str:
        """The newest sentence that it said; empty if there was none."""
        return self._newest_words[-1] if self._newest_words else ""

    @property
    def words(self) -> int:
        """How many sentences it said so far."""
        return self._words_said

    def words_since(self, words: int) -> list[str]:
        """Return the sentences of late that it said after so many."""
        new = self._words_said - words
        return list(self._newest_words)[-new:] if new > 0 else []

    def hear(self, message: WireMessage, at: datetime) -> list[VehicleEvent]:
        """Take a message; return what it leads to, in order.

        Args:
            message: A valid frame's content, of whatever component of the vehicle.
            at: The station's clock when it came.
        """
        told: list[VehicleEvent] = []
        if isinstance(message, grace.MAVLink_statustext_message):
            told += self._words(self._texts.hear(message, at))
        else:
            told += self._words(self._texts.overdue(at))
        is_news = self._take(message, at)
        depth = self._depth(at)
        depth_m = None if depth is None else depth[1]
        found = readings(message, is_ardusub=self.is_ardusub, depth_m=depth_m)
        for key, value in (*found, *finite(self._motors.hear(message, at))):
            if key not in self._values and len(self._values) >= _VALUES_MAX:
                continue
            self._values[key] = VehicleValue(value, at)
            told += self._sample(key, value, at) or self._reading(key, value, at)
        if is_news or self._is_due(at):
            told += self._reports(at)
        return told

    def _words(self, whole: list[tuple[int, str, datetime]]) -> Iterator[VehicleWord]:
        for severity, text, at in whole:
            if text:
                self._words_said += 1
                self._newest_words.append(text)
                yield VehicleWord(self._robot, severity, text, at)

    def _is_due(self, at: datetime) -> bool:
        period = timedelta(seconds=_PERIOD_S * self._speed)
        return self._told_at is None or at - self._told_at >= period

    def _is_fresh(self, moment: datetime, at: datetime, limit_s: float = _FRESH_S) -> bool:
        return at - moment <= timedelta(seconds=limit_s * self._speed)

    def _take(self, message: WireMessage, at: datetime) -> bool:
        """Remember what a message says; tell whether it must be told at once."""
        for key, value in battery(message):
            self._values[key] = VehicleValue(value, at)
        match message:
            case grace.MAVLink_heartbeat_message():
                return self._take_heartbeat(message)
            case grace.MAVLink_attitude_message():
                self._note("roll_rad", message.roll, at)
                self._note("pitch_rad", message.pitch, at)
                self._note("heading_rad", float(wrap_angle(message.yaw)), at)
            case grace.MAVLink_global_position_int_message():
                self._take_global(message, at)
            case grace.MAVLink_local_position_ned_message():
                self._depths["LOCAL_POSITION_NED"] = VehicleValue(message.z, at)
                self._take_local(message.x, message.y, at)
                self._move((message.vx, message.vy, message.vz), at)
            case grace.MAVLink_local_position_ned_cov_message():
                self._take_covariance(message, at)
            case grace.MAVLink_gps_raw_int_message():
                self._take_gps(message, at)
            case grace.MAVLink_gps_global_origin_message():
                self._own_origin = self._ned(message.latitude, message.longitude)
            case grace.MAVLink_estimator_status_message():
                if 0.0 < message.pos_horiz_accuracy < math.inf:
                    std = VehicleValue(message.pos_horiz_accuracy, at)
                    self._stds["ESTIMATOR_STATUS"] = std
            case grace.MAVLink_altitude_message():
                self._depths["ALTITUDE"] = VehicleValue(-message.altitude_relative, at)
            case grace.MAVLink_vfr_hud_message():
                self._depths["VFR_HUD"] = VehicleValue(-message.alt, at)
                if "heading_rad" not in self._values:
                    self._note("heading_rad", float(wrap_angle(math.radians(message.heading))), at)
            case grace.MAVLink_ahrs2_message():
                self._depths["AHRS2"] = VehicleValue(-message.altitude, at)
            case grace.MAVLink_scaled_pressure2_message():
                above_hpa = message.press_abs - 1013.25
                self._depths["SCALED_PRESSURE2"] = VehicleValue(above_hpa / _HPA_OF_METRE, at)
            case grace.MAVLink_mission_current_message():
                self._mission_item = message.seq
                if message.total not in (0, _UNKNOWN_UINT16):
                    self._mission_items = message.total
            case grace.MAVLink_sys_status_message():
                self._unhealthy = _unhealthy(message)
            case grace.MAVLink_extended_sys_state_message():
                self._landed = flight_mode.landed_words(message.landed_state)
            case _:
                pass
        return False

    def _note(self, key: str, value: float, at: datetime) -> None:
        if math.isfinite(value):
            self._values[key] = VehicleValue(value, at)

    def _take_heartbeat(self, message: grace.MAVLink_heartbeat_message) -> bool:
        is_vehicle = message.type != grace.MAV_TYPE_GCS and message.autopilot != _AUTOPILOT_NONE
        if message.get_srcComponent() != ROBOT_COMPONENT or not is_vehicle:
            return False
        before, self._heartbeat = self._heartbeat, message
        return before is None or (
            (before.base_mode, before.custom_mode, before.system_status)
            != (message.base_mode, message.custom_mode, message.system_status)
        )

    def _take_global(
        self, message: grace.MAVLink_global_position_int_message, at: datetime
    ) -> None:
        self._depths["GLOBAL_POSITION_INT"] = VehicleValue(-message.relative_alt / 1000.0, at)
        if (place := self._ned(message.lat, message.lon)) is not None:
            self._places["GLOBAL_POSITION_INT"] = (*place, at)
            north, east, down = message.vx / 100.0, message.vy / 100.0, message.vz / 100.0
            self._move((north, east, down), at)
        if message.hdg != _UNKNOWN_HEADING and "heading_rad" not in self._values:
            heading_rad = float(wrap_angle(math.radians(message.hdg / 100.0)))
            self._note("heading_rad", heading_rad, at)

    def _take_local(self, north_m: float, east_m: float, at: datetime) -> None:
        """Take a place in the vehicle's own frame, where it said where that lies."""
        if self._own_origin is not None and math.isfinite(north_m + east_m):
            north, east = self._own_origin
            self._places["LOCAL_POSITION_NED"] = (north + north_m, east + east_m, at)

    def _take_covariance(
        self, message: grace.MAVLink_local_position_ned_cov_message, at: datetime
    ) -> None:
        self._depths["LOCAL_POSITION_NED"] = VehicleValue(message.z, at)
        self._take_local(message.x, message.y, at)
        variance = max(message.covariance[0], message.covariance[9])
        if math.isfinite(variance) and variance > 0.0:
            self._stds["LOCAL_POSITION_NED_COV"] = VehicleValue(math.sqrt(variance), at)

    def _take_gps(self, message: grace.MAVLink_gps_raw_int_message, at: datetime) -> None:
        if message.fix_type < _FIX_3D:
            return
        self._fix_at = at
        if (place := self._ned(message.lat, message.lon)) is not None:
            self._places["GPS_RAW_INT"] = (*place, at)
        if message.h_acc:
            self._stds["GPS_RAW_INT"] = VehicleValue(message.h_acc / 1000.0, at)
        elif message.eph != _UNKNOWN_UINT16:
            std_m = _METRES_OF_HDOP * message.eph / 100.0
            self._stds["GPS HDOP"] = VehicleValue(std_m, at)

    def _ned(self, latitude: int, longitude: int) -> tuple[float, float] | None:
        """Return north and east of a place in 1e-7 deg; zero on both is a place not known."""
        if self._origin_deg is None or (latitude == 0 and longitude == 0):
            return None
        ned = ned_from_wgs84(latitude / 1e7, longitude / 1e7, *self._origin_deg)
        return float(ned[0]), float(ned[1])

    def _move(self, velocity_ned: tuple[float, float, float], at: datetime) -> None:
        if all(map(math.isfinite, velocity_ned)):
            self._velocity = (velocity_ned, at)
            self._note("speed_m_s", math.hypot(*velocity_ned), at)

    def _depth(self, at: datetime) -> tuple[str, float, datetime] | None:
        """Return source, depth and time of the best fresh depth."""
        for source in _SUB_SOURCES if self.is_ardusub else _OTHER_SOURCES:
            known = self._depths.get(source)
            if known is None or not self._is_fresh(known.at, at):
                continue
            if math.isfinite(known.value) and known.value >= -_ABOVE_MAX_M:
                return source, max(0.0, known.value), known.at
        beat = self._heartbeat
        if beat is not None and beat.type == grace.MAV_TYPE_SURFACE_BOAT:
            return "it floats", 0.0, at
        return None

    def _std(self, at: datetime) -> tuple[str, float] | None:
        for source in _STD_SOURCES:
            known = self._stds.get(source)
            if known is not None and self._is_fresh(known.at, at):
                return source, known.value
        return None

    def _place(self, at: datetime) -> VehiclePlace | None:
        depth, std = self._depth(at), self._std(at)
        newest = max(self._places.values(), key=lambda one: one[2], default=None)
        for source in ("GLOBAL_POSITION_INT", "LOCAL_POSITION_NED", "GPS_RAW_INT"):
            known = self._places.get(source)
            if known is not None and self._is_fresh(known[2], at):
                newest = known
                break
        if newest is None or depth is None:
            return None
        has_fix = self._fix_at is not None and self._is_fresh(self._fix_at, at)
        north, east, place_at = newest
        std_m = None if std is None else std[1]
        return VehiclePlace((north, east, depth[1]), std_m, has_fix, min(place_at, depth[2]))

    def _reading(self, key: str, value: float, at: datetime) -> list[Reading]:
        """Make a reading of what is no sample, now and then; of a switch at once when it turns."""
        last = self._read.get(key)
        period = timedelta(seconds=_READING_PERIOD_S * self._speed)
        has_turned = last is not None and _is_switch(key) and last.value != value
        if last is not None and at - last.at < period and not has_turned:
            return []
        self._read[key] = VehicleValue(value, at)
        return [Reading(self._robot, key, value, at, at)]

    def _sample(self, key: str, value: float, at: datetime) -> list[Sample]:
        """Make a sample of what can be mapped, where the vehicle knows how well it knows where."""
        place, last = self._place(at), self._sampled_at.get(key)
        period = timedelta(seconds=_SAMPLE_PERIOD_S * self._speed)
        if place is None or place.std_m is None or not _has_place(key):
            return []
        if not self._is_fresh(place.at, at) or (last is not None and at - last < period):
            return []
        if self._log is None:
            self._log = LogId(int(at.timestamp()) & 0x7FFFFFFF)
        self._sampled_at[key] = at
        self._read[key] = VehicleValue(value, at)
        sample = Sample(
            robot=self._robot,
            log=self._log,
            sequence=self._sequence,
            variable=key,
            value=value,
            position_ned=place.position_ned,
            position_std_m=place.std_m,
            measured_at=at,
            received_at=at,
        )
        self._sequence += 1
        return [sample]

    def _reports(self, at: datetime) -> list[VehicleEvent]:
        self._told_at = at
        place, depth, std = self._place(at), self._depth(at), self._std(at)
        if depth is not None:
            self._values["depth_m"] = VehicleValue(depth[1], depth[2])
        if std is not None and place is not None:
            self._values["position_std_m"] = VehicleValue(std[1], place.at)
        beat = self._heartbeat
        name, words = "", ""
        if beat is not None:
            name = flight_mode.mode_name(
                beat.autopilot, beat.type, beat.base_mode, beat.custom_mode
            )
            words = flight_mode.mode_words(beat.autopilot, name)
        report = VehicleReport(
            robot=self._robot,
            measured_at=at,
            received_at=at,
            autopilot=""
            if beat is None
            else flight_mode.autopilot_title(beat.autopilot, beat.type),
            kind="" if beat is None else flight_mode.kind_title(beat.type),
            mode=name,
            mode_number=0 if beat is None else beat.custom_mode,
            mode_words=words,
            is_armed=self.is_armed,
            is_critical=beat is not None and beat.system_status >= grace.MAV_STATE_CRITICAL,
            values=dict(self._values),
            place=place,
            depth_source="" if depth is None else depth[0],
            std_source="" if std is None else std[0],
            mission_item=self._mission_item,
            mission_items=self._mission_items,
            unhealthy=(*self._unhealthy, *self._motors.failures),
            landed=self._landed,
        )
        state = self._state(report, at)
        return [report] if state is None else [report, state]

    def _state(self, report: VehicleReport, at: datetime) -> StateReport | None:
        """Return what is fresh as a state, NaN where it is not told; None if nothing is."""
        place = report.place

        def fresh(key: str) -> float:
            known = self._values.get(key)
            limit_s = _BATTERY_FRESH_S if key in _STATIC else _FRESH_S
            is_known = known is not None and self._is_fresh(known.at, at, limit_s)
            return known.value if known is not None and is_known else math.nan

        is_placed = place is not None and self._is_fresh(place.at, at)
        north, east, _ = place.position_ned if place is not None and is_placed else [math.nan] * 3
        depth_m, velocity = fresh("depth_m"), self._velocity
        is_moving = velocity is not None and self._is_fresh(velocity[1], at)
        state = StateReport(
            robot=self._robot,
            measured_at=at,
            received_at=at,
            position_ned=(north, east, depth_m),
            position_std_m=math.inf if place is None or place.std_m is None else place.std_m,
            velocity_ned=velocity[0]
            if velocity is not None and is_moving
            else (math.nan, math.nan, math.nan),
            roll_rad=fresh("roll_rad"),
            pitch_rad=fresh("pitch_rad"),
            heading_rad=fresh("heading_rad"),
            net_buoyancy_kg=math.nan,
            mass_position_m=math.nan,
            tail_rad=math.nan,
            battery_fraction=fresh("battery_fraction"),
            battery_v=fresh("battery_v"),
            energy_used=math.nan,
            mode=_robot_mode(report, depth_m),
            has_fix=place is not None and is_placed and place.has_fix,
        )
        told = (north, depth_m, state.heading_rad, state.battery_v, state.battery_fraction)
        return None if all(map(math.isnan, told)) else state


def _robot_mode(report: VehicleReport, depth_m: float) -> RobotMode:
    """Return the nearest mode of our own: what the station's rules go by, not what is shown."""
    is_up = depth_m <= _SURFACE_M
    if report.is_armed is False and is_up:
        return RobotMode.IDLE
    if report.mode == "SURFACE" and not is_up:
        return RobotMode.ABORTING
    return RobotMode.SWIMMING


def _unhealthy(message: grace.MAVLink_sys_status_message) -> tuple[str, ...]:
    """Return the sensors that are there, switched on and not well, by their names."""
    bad = (
        message.onboard_control_sensors_present
        & message.onboard_control_sensors_enabled
        & ~message.onboard_control_sensors_health
    )
    names = grace.enums["MAV_SYS_STATUS_SENSOR"]
    return tuple(
        names[1 << bit].name.removeprefix("MAV_SYS_STATUS_").removeprefix("SENSOR_").lower()
        for bit in range(32)
        if bad >> bit & 1 and 1 << bit in names
    )
