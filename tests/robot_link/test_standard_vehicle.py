"""What vehicles of other makers say in standard messages, and nothing that they did not say."""

import math
from datetime import UTC, datetime, timedelta

import pytest

from autonomy.site import LAKE
from robot_link.mavlink.codec import Codec
from robot_link.mavlink.standard_vehicle import StandardVehicle
from robot_link.mavlink.wire import grace
from robot_link.messages import RobotId, RobotMode, Sample, StateReport, SystemId
from robot_link.report import Reading, VehicleReport, VehicleWord

SUB = RobotId("sub-1")
START = datetime(2026, 7, 1, 12, 0, tzinfo=UTC)
ORIGIN = (LAKE.origin_latitude_deg, LAKE.origin_longitude_deg)
ARMED = grace.MAV_MODE_FLAG_SAFETY_ARMED | grace.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
NOT_TOLD = 2**16 - 1


class Talk:
    """A vehicle that says one thing a second."""

    def __init__(self, origin=ORIGIN):
        self.vehicle = StandardVehicle(SUB, origin)
        self.codec = Codec(SystemId(9), 1)
        self.now = START
        self.told = []

    def say(self, *messages, after_s=1.0, component=1):
        codec = self.codec if component == 1 else Codec(SystemId(9), component)
        for message in messages:
            self.now += timedelta(seconds=after_s)
            (heard,) = codec.unpack(codec.pack(message)).messages
            self.told += self.vehicle.hear(heard, self.now)
        return self

    def newest(self, kind):
        return next((one for one in reversed(self.told) if isinstance(one, kind)), None)

    @property
    def report(self):
        return self.newest(VehicleReport)

    def value(self, key):
        told = self.report.values.get(key)
        return None if told is None else told.value


def heartbeat(
    custom=0, *, kind=grace.MAV_TYPE_SUBMARINE, autopilot=grace.MAV_AUTOPILOT_ARDUPILOTMEGA, base=1
):
    return grace.MAVLink_heartbeat_message(kind, autopilot, base, custom, 4, 3)


def position(relative_m, latitude=ORIGIN[0], longitude=ORIGIN[1], heading=NOT_TOLD):
    return grace.MAVLink_global_position_int_message(
        0, round(latitude * 1e7), round(longitude * 1e7), 300_000, round(relative_m * 1e3),
        10, 0, 0, heading,
    )  # fmt: skip


def gps(fix=3, h_acc=0, eph=NOT_TOLD, satellites=255):
    return grace.MAVLink_gps_raw_int_message(
        0, fix, 0, 0, 0, eph, NOT_TOLD, NOT_TOLD, NOT_TOLD, satellites, 0, h_acc
    )


def sys_status(voltage=NOT_TOLD, current=-1, remaining=-1, *, present=0, health=0):
    return grace.MAVLink_sys_status_message(
        present, present, health, 0, voltage, current, remaining, 0, 0, 0, 0, 0, 0
    )


@pytest.mark.parametrize(
    ("beat", "mode", "words"),
    [
        (heartbeat(2, base=ARMED), "ALT_HOLD", "holds its depth"),
        (heartbeat(9, base=ARMED), "SURFACE", "comes up"),
        (heartbeat(77, base=ARMED), "mode 77", ""),
        (
            heartbeat(4 << 16 | 4 << 24, autopilot=grace.MAV_AUTOPILOT_PX4, base=ARMED),
            "AUTO.MISSION",
            "flies its mission",
        ),
        (
            heartbeat(autopilot=grace.MAV_AUTOPILOT_GENERIC, base=grace.MAV_MODE_FLAG_AUTO_ENABLED),
            "AUTO",
            "flies its mission",
        ),
    ],
)
def test_mode_is_said_in_the_autopilots_name_and_in_words(beat, mode, words):
    report = Talk().say(beat).report
    assert (report.mode, report.mode_words) == (mode, words)
    assert report.is_armed is bool(beat.base_mode & grace.MAV_MODE_FLAG_SAFETY_ARMED)


def test_heartbeats_of_cameras_and_stations_say_nothing_of_the_vehicle():
    talk = Talk().say(heartbeat(2, base=ARMED)).say(heartbeat(9, base=ARMED), component=100)
    assert talk.report.mode == "ALT_HOLD"
    gcs = heartbeat(kind=grace.MAV_TYPE_GCS, autopilot=grace.MAV_AUTOPILOT_INVALID)
    assert talk.say(gcs).report.kind == "submarine"


@pytest.mark.parametrize(("relative_m", "depth_m"), [(-4.2, 4.2), (0.4, 0.0), (-0.0, 0.0)])
def test_depth_is_positive_down_and_never_negative(relative_m, depth_m):
    talk = Talk().say(heartbeat(base=ARMED), position(relative_m))
    assert talk.value("depth_m") == pytest.approx(depth_m)
    assert talk.report.depth_source == "GLOBAL_POSITION_INT"
    assert talk.newest(StateReport).position_ned == pytest.approx((0.0, 0.0, depth_m), abs=0.02)


def test_an_altitude_above_the_surface_is_no_depth():
    talk = Talk().say(heartbeat(base=ARMED), position(10.0))
    assert talk.value("depth_m") is None
    assert talk.report.depth_source == ""
    assert talk.report.place is None


@pytest.mark.parametrize(
    ("message", "depth_m", "source"),
    [
        (grace.MAVLink_ahrs2_message(0, 0, 0, -3.0, 0, 0), 3.0, "AHRS2"),
        (grace.MAVLink_vfr_hud_message(0, 0, 90, 0, -2.5, 0), 2.5, "VFR_HUD"),
        (
            grace.MAVLink_local_position_ned_message(0, 1, 2, 6.0, 0, 0, 0),
            6.0,
            "LOCAL_POSITION_NED",
        ),
        (grace.MAVLink_scaled_pressure2_message(0, 1503.0, 0, 0), 5.0, "SCALED_PRESSURE2"),
    ],
)
def test_depth_comes_from_whatever_an_ardusub_sends(message, depth_m, source):
    report = Talk().say(heartbeat(base=ARMED), message).say(heartbeat(base=ARMED)).report
    assert report.values["depth_m"].value == pytest.approx(depth_m, abs=0.01)
    assert report.depth_source == source


def test_a_stale_source_gives_way_to_a_fresh_one():
    talk = Talk().say(heartbeat(base=ARMED), position(-4.0))
    talk.say(grace.MAVLink_ahrs2_message(0, 0, 0, -7.0, 0, 0), after_s=10.0)
    assert talk.say(heartbeat(base=ARMED)).report.depth_source == "AHRS2"


def test_an_aeroplanes_height_over_the_sea_is_no_depth():
    beat = heartbeat(kind=grace.MAV_TYPE_QUADROTOR, autopilot=grace.MAV_AUTOPILOT_PX4)
    hud = grace.MAVLink_vfr_hud_message(0, 0, 90, 0, -2.5, 0)
    assert Talk().say(beat, hud, beat).value("depth_m") is None


def test_latitude_and_longitude_of_zero_are_no_place():
    talk = Talk().say(heartbeat(base=ARMED), position(-3.0, 0.0, 0.0))
    assert talk.report.place is None
    state = talk.newest(StateReport)
    assert math.isnan(state.position_ned[0])
    assert state.position_ned[2] == 3.0


def test_a_local_frame_counts_once_the_vehicle_said_where_it_lies():
    local = grace.MAVLink_local_position_ned_message(0, 10, 20, 6.0, 0, 0, 0)
    talk = Talk().say(heartbeat(base=ARMED), local)
    assert talk.report.place is None
    place = [round(one * 1e7) for one in ORIGIN]
    talk.say(grace.MAVLink_gps_global_origin_message(*place, 0), local)
    assert talk.report.place.position_ned == pytest.approx((10.0, 20.0, 6.0), abs=0.02)


@pytest.mark.parametrize(
    ("message", "std_m", "source"),
    [
        (gps(h_acc=1_700), 1.7, "GPS_RAW_INT"),
        (gps(eph=120), 3.0, "GPS HDOP"),
        (gps(fix=1, h_acc=1_700), None, ""),
        (grace.MAVLink_estimator_status_message(0, 0, 0, 0, 0, 0, 0, 0, 2.5, 1), 2.5,
         "ESTIMATOR_STATUS"),
    ],
)  # fmt: skip
def test_uncertainty_is_what_the_vehicle_says_or_not_known(message, std_m, source):
    talk = Talk().say(heartbeat(base=ARMED), message, position(-1.0))
    assert talk.report.std_source == source
    assert talk.report.place.std_m == std_m
    told = talk.newest(StateReport).position_std_m
    assert told == (math.inf if std_m is None else std_m)


def test_what_is_marked_as_not_known_is_absent_and_never_zero():
    talk = Talk().say(heartbeat(base=ARMED), sys_status(), gps(fix=0), heartbeat(9, base=ARMED))
    assert not talk.report.values
    assert talk.newest(StateReport) is None
    talk.say(position(-1.0))
    state = talk.newest(StateReport)
    assert math.isnan(state.battery_fraction)
    assert math.isnan(state.roll_rad)
    assert math.isnan(state.tail_rad)


def test_each_value_has_its_own_age():
    talk = Talk().say(heartbeat(base=ARMED), sys_status(15_800, 350, 77))
    talk.say(*[position(-1.0)] * 5)
    told = talk.report.values
    assert told["battery_v"].value == 15.8
    assert told["battery_fraction"].at == START + timedelta(seconds=2)
    assert told["depth_m"].at == talk.now


def test_ardusub_has_its_first_barometer_inside_of_the_hull():
    talk = Talk().say(
        heartbeat(base=ARMED),
        grace.MAVLink_scaled_pressure_message(0, 1003.0, 0, 2450),
        grace.MAVLink_scaled_pressure2_message(0, 1513.25, 0, 1210),
        grace.MAVLink_hygrometer_sensor_message(0, 2450, 3800),
        heartbeat(9, base=ARMED),
    )
    assert {key: talk.value(key) for key in ("internal_pressure", "internal_temperature")} == {
        "internal_pressure": 1003.0,
        "internal_temperature": 24.5,
    }
    assert talk.value("pressure") == pytest.approx(5.0)
    assert (talk.value("temperature"), talk.value("humidity")) == (12.1, 38.0)


def test_other_standard_messages_are_channels():
    talk = Talk().say(
        heartbeat(base=ARMED),
        position(-2.0),
        grace.MAVLink_distance_sensor_message(0, 10, 5000, 640, 2, 0, 25, 0),
        grace.MAVLink_battery_status_message(
            0, 0, 0, 32767, [15800, *[NOT_TOLD] * 9], 420, -1, -1, 60
        ),
        grace.MAVLink_named_value_float_message(0, b"turbidity", 3.5),
        grace.MAVLink_named_value_int_message(0, b"leak", 1),
        grace.MAVLink_named_value_float_message(0, b"spin", 3.5),
        heartbeat(9, base=ARMED),
    )
    assert talk.value("water_depth") == pytest.approx(8.4)
    assert (talk.value("battery_current"), talk.value("battery_fraction")) == (4.2, 0.6)
    assert (talk.value("turbidity"), talk.value("leak")) == (3.5, 1.0)
    assert talk.value("spin") == 3.5


def test_what_is_no_number_is_left_out():
    nan = grace.MAVLink_named_value_float_message(0, b"turbidity", math.nan)
    assert Talk().say(heartbeat(base=ARMED), nan, heartbeat(9)).value("turbidity") is None


def test_a_measurement_of_the_water_is_a_sample_where_the_place_is_known():
    warm = grace.MAVLink_scaled_pressure3_message(0, 0, 0, 1210)
    talk = Talk().say(heartbeat(base=ARMED), position(-2.0), warm)
    assert talk.newest(Sample) is None
    talk.say(gps(h_acc=900), position(-2.0), warm, warm)
    samples = [one for one in talk.told if isinstance(one, Sample)]
    assert [one.sequence for one in samples] == [0, 1]
    assert (samples[0].variable, samples[0].value, samples[0].position_std_m) == (
        "temperature",
        12.1,
        0.9,
    )


def piece(text, number, id=7):
    return grace.MAVLink_statustext_message(3, text.encode(), id, number)


def test_sentences_in_pieces_are_put_together():
    talk = Talk().say(piece("x" * 50, 0), piece("and the end", 1))
    words = [one.text for one in talk.told if isinstance(one, VehicleWord)]
    assert words == ["x" * 50 + "and the end"]


def test_a_lost_piece_leaves_a_mark():
    talk = Talk().say(piece("x" * 50, 0), piece("and the end", 2))
    talk.say(heartbeat(), after_s=5.0)
    (word,) = [one for one in talk.told if isinstance(one, VehicleWord)]
    assert word.text == "x" * 50 + "[...]and the end"
    assert word.severity == 3


def test_sensors_that_are_not_well_are_named():
    there = grace.MAV_SYS_STATUS_SENSOR_3D_GYRO | grace.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
    bad = sys_status(present=there, health=grace.MAV_SYS_STATUS_SENSOR_3D_GYRO)
    assert Talk().say(heartbeat(), bad, heartbeat(9)).report.unhealthy == ("absolute_pressure",)


def test_mission_item_is_told():
    talk = Talk().say(
        heartbeat(3, base=ARMED), grace.MAVLink_mission_current_message(4, 12), heartbeat(3)
    )
    assert (talk.report.mission_item, talk.report.mission_items) == (4, 12)


def test_the_mode_that_the_stations_rules_go_by_is_idle_only_at_the_surface():
    talk = Talk().say(heartbeat(), position(-5.0))
    assert talk.newest(StateReport).mode is RobotMode.SWIMMING
    assert talk.say(position(0.0)).newest(StateReport).mode is RobotMode.IDLE
    talk.say(heartbeat(9, base=ARMED), position(-5.0))
    assert talk.newest(StateReport).mode is RobotMode.ABORTING


def esc_status(rpm, current, index=0):
    return grace.MAVLink_esc_status_message(index, 0, rpm, [16.0, 16.0, 0.0, 0.0], current)


def esc_info(temperature, failures=(0, 0, 0, 0), index=0):
    return grace.MAVLink_esc_info_message(
        index, 0, 1, 4, 0, 0b0011, list(failures), [0] * 4, temperature
    )


def test_a_channel_of_motors_has_the_one_that_deserves_most_attention():
    talk = Talk().say(
        heartbeat(),
        esc_status([-900, 300, 0, 0], [2.0, 3.5, 99.0, 99.0]),
        esc_status([1200, 0, 0, 0], [1.0, 0.5, 0.0, 0.0], index=4),
        esc_info([4120, 2**15 - 1, 9900, 0]),
    )
    assert talk.value("motor_speed") == 1200.0
    assert talk.value("motor_current") == 3.5, "a motor without voltage is not there"
    assert talk.value("motor_temperature") == 41.2, "what is not online has no temperature"


def test_motors_of_ardupilot_and_shafts_are_understood():
    of_ardupilot = grace.MAVLink_esc_telemetry_5_to_8_message(
        [31, 0, 55, 0], [0] * 4, [420, 0, 90, 0], [0] * 4, [800, 0, 1500, 0], [7, 0, 9, 0]
    )
    talk = Talk().say(heartbeat(), of_ardupilot)
    told = {key: talk.value(f"motor_{key}") for key in ("speed", "current", "temperature")}
    assert told == {"speed": 1500.0, "current": 4.2, "temperature": 55.0}
    shafts = Talk().say(heartbeat(), grace.MAVLink_rpm_message(-640.0, -1.0))
    assert shafts.value("motor_speed") == 640.0


def test_a_motor_that_fails_is_named_and_one_that_recovers_is_not():
    talk = Talk().say(heartbeat(), esc_info([4000] * 4, (0, 0b100001, 0, 0), index=4))
    assert talk.report.unhealthy == ("motor 6 (over current, stuck)",)
    assert talk.say(esc_info([4000] * 4, index=4)).report.unhealthy == ()


def test_whether_it_stands_is_told_only_where_it_says_so():
    talk = Talk().say(heartbeat())
    assert talk.report.landed == ""
    talk.say(grace.MAVLink_extended_sys_state_message(0, grace.MAV_LANDED_STATE_ON_GROUND))
    assert talk.report.landed == "on the ground"
    talk.say(grace.MAVLink_extended_sys_state_message(0, grace.MAV_LANDED_STATE_UNDEFINED))
    assert talk.report.landed == ""


def test_housekeeping_is_read_now_and_then_and_a_switch_at_once():
    talk = Talk().say(heartbeat())
    for _ in range(12):
        talk.say(grace.MAVLink_hygrometer_sensor_message(0, 2640, 3100))
    humid = [one for one in talk.told if isinstance(one, Reading) and one.channel == "humidity"]
    assert [one.value for one in humid] == [31.0] * 3
    assert humid[1].measured_at - humid[0].measured_at == timedelta(seconds=5)
    for value in (0.0, 0.0, 1.0, 1.0):
        talk.say(grace.MAVLink_named_value_float_message(0, b"leak", value))
    leaks = [one for one in talk.told if isinstance(one, Reading) and one.channel == "leak"]
    assert [one.value for one in leaks] == [0.0, 1.0]


def test_a_measurement_without_a_place_is_a_reading_and_with_one_a_sample():
    water = grace.MAVLink_scaled_pressure3_message(0, 1100.0, 0.0, 1250)
    talk = Talk().say(heartbeat(), water)
    told = {one.channel: one.value for one in talk.told if isinstance(one, Reading)}
    assert told["temperature"] == 12.5
    assert not [one for one in talk.told if isinstance(one, Sample)]
    placed = Talk().say(heartbeat(), gps(h_acc=1200), position(-3.0), water)
    (sample,) = [one for one in placed.told if isinstance(one, Sample)]
    assert (sample.variable, sample.value) == ("temperature", 12.5)
    read = {one.channel for one in placed.told if isinstance(one, Reading)}
    assert "temperature" not in read
    assert "pressure" in read


def test_frames_of_messages_that_we_do_not_know_are_counted_apart():
    codec = Codec(SystemId(9), 1)
    known = codec.pack(heartbeat())
    strange = bytearray(codec.pack(heartbeat()))
    strange[7:10] = (12_345).to_bytes(3, "little")
    corrupt = bytearray(known)
    corrupt[-3] ^= 0xFF
    assert codec.unknown(known + bytes(strange) + known + bytes(strange)) == 2
    assert codec.unpack(known + bytes(strange)).bad == 1
    assert codec.unknown(known + bytes(corrupt)) == 0
    assert codec.unknown(b"\xfd\x00") == 0
