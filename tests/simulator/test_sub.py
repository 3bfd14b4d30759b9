"""The submarine that is not ours, called by our own station over UDP."""

import asyncio
import math
import socket
from contextlib import asynccontextmanager
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from autonomy.frames import wgs84_from_ned
from autonomy.site import LAKE
from robot_link.clock import ScaledClock
from robot_link.drive import Stick
from robot_link.mavlink.wire import grace
from robot_link.messages import (
    CommandKind,
    CommandLevel,
    CommandNumber,
    CommandReport,
    RobotId,
    StateReport,
)
from robot_link.report import VehicleReport, VehicleWord
from robot_link.service.standard_item import StandardItem
from robot_link.standard_config import StandardCommandConfig
from robot_link.station.command_client import StandardCommand
from robot_link.station.error import ServiceRefusedError
from robot_link.station.link import RadioPath, RobotEndpoint, StationLink
from robot_link.transport.opening import open_transport
from simulator.fleet import FLEET, SUBS, fleet_of, robots_named, sub_definition
from simulator.sub.autopilot import MODES
from simulator.sub.definition import SUB_1
from simulator.sub.endpoint import PERIOD_S, SubVehicle
from simulator.water_field import WaterField
from tests.free_port import free_port
from tests.server.conftest import until

SUB = SUB_1.robot
SPEED = 20.0


def depth_m(report):
    """Return the depth that a vehicle says; not a number where it has said none yet."""
    said = report.values.get("depth_m")
    return math.nan if said is None else said.value


def item(north_m, east_m, depth_m, command=grace.MAV_CMD_NAV_WAYPOINT):
    origin = (LAKE.origin_latitude_deg, LAKE.origin_longitude_deg)
    place = wgs84_from_ned((north_m, east_m), *origin)
    latitude, longitude = (round(float(one) * 1e7) for one in place)
    frame = grace.MAV_FRAME_GLOBAL_RELATIVE_ALT
    return StandardItem(command, frame, latitude, longitude, -depth_m)


class Rig:
    """A submarine and our station."""

    def __init__(self, vehicle, link, told):
        self.vehicle, self.link, self.told = vehicle, link, told

    def newest(self, kind):
        return next((one for one in reversed(self.told) if isinstance(one, kind)), None)

    async def report(self, holds):
        def found():
            report = self.newest(VehicleReport)
            return report if report is not None and holds(report) else None

        return await until(found)

    async def say(self, code, *parameters):
        await self.link.services(SUB).commands.send(StandardCommand(code, parameters))

    async def arm(self):
        await self.say(grace.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)

    async def enter(self, mode):
        await self.say(grace.MAV_CMD_DO_SET_MODE, 1.0, float(MODES[mode]))

    def levels(self, number):
        reports = (one for one in self.told if isinstance(one, CommandReport))
        return [one.level for one in reports if one.number == number]


@asynccontextmanager
async def rig(config=None):
    port, now = free_port(socket.SOCK_DGRAM), datetime.now(UTC)
    clock = ScaledClock(now, now, SPEED)
    vehicle = SubVehicle(SUB_1, open_transport(f"udp://127.0.0.1:{port}?listen=1"), clock)
    uri = f"udp://127.0.0.1:{port}"
    endpoint = RobotEndpoint(
        SUB_1.system_id,
        (RadioPath(uri),),
        standard=config or StandardCommandConfig(),
        origin_deg=(LAKE.origin_latitude_deg, LAKE.origin_longitude_deg),
    )
    told = []
    link = StationLink({uri: open_transport(uri)}, {SUB: endpoint}, clock, told.append)
    tasks = [asyncio.create_task(vehicle.run()), asyncio.create_task(link.run())]
    try:
        yield Rig(vehicle, link, told)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def test_our_station_sees_it_once_it_has_asked_for_its_telemetry():
    async with rig() as sub:
        report = await sub.report(lambda one: "depth_m" in one.values and one.place is not None)
        assert (report.autopilot, report.kind, report.mode) == ("ArduSub", "submarine", "MANUAL")
        assert report.is_armed is False
        assert report.place.position_ned == pytest.approx((150.0, 110.0, 0.0), abs=0.05)
        report = await sub.report(lambda one: {"internal_pressure", "humidity"} <= set(one.values))
        report = await sub.report(
            lambda one: (
                one.place is not None
                and one.place.has_fix
                and {"temperature", "water_depth"} <= set(one.values)
            )
        )
        assert report.place.std_m == 1.2
        here = np.array([report.place.position_ned])
        water_c = WaterField(LAKE).truth("temperature", here)[0]
        assert report.values["temperature"].value == pytest.approx(water_c, abs=0.1)
        await sub.report(lambda one: {"salinity", "turbidity", "ph"} <= set(one.values))
        floor_m = float(LAKE.floor_m(150.0, 110.0))
        assert report.values["water_depth"].value == pytest.approx(floor_m, abs=0.3)
        assert sub.newest(StateReport).battery_fraction > 0.9


async def test_it_holds_a_depth_and_comes_up_by_our_order_proved_by_its_mode():
    async with rig() as sub:
        await sub.report(lambda one: one.place is not None)
        await sub.arm()
        sub.vehicle.autopilot.enter(MODES["GUIDED"])
        sub.vehicle.autopilot.go_to(155.0, 112.0, 4.0)
        await sub.report(lambda one: depth_m(one) > 3.5)
        expires = datetime.now(UTC) + timedelta(days=30)
        sub.link.send_command(SUB, CommandKind.SURFACE, CommandNumber(7), expires)
        await until(lambda: CommandLevel.APPLIED in sub.levels(7))
        assert sub.levels(7) == [CommandLevel.QUEUED, CommandLevel.RADIO, CommandLevel.APPLIED]
        assert sub.vehicle.autopilot.mode_name == "SURFACE"
        await sub.report(lambda one: depth_m(one) < 0.3)


async def test_a_hold_that_it_refuses_is_refused_with_its_own_words():
    async with rig() as sub:
        await sub.report(lambda one: one.place is not None)
        expires = datetime.now(UTC) + timedelta(days=30)
        sub.link.send_command(SUB, CommandKind.HOLD, CommandNumber(3), expires)
        await until(lambda: CommandLevel.REFUSED in sub.levels(3))
        assert sub.newest(CommandReport).reason.startswith("the vehicle refuses to do this")
        assert sub.vehicle.autopilot.mode_name == "MANUAL"


async def test_it_is_armed_and_disarmed_by_our_orders_proved_by_its_heartbeat():
    async with rig() as sub:
        await sub.report(lambda one: one.is_armed is False)
        expires = datetime.now(UTC) + timedelta(days=30)
        sub.link.send_command(SUB, CommandKind.ARM, CommandNumber(3), expires)
        await until(lambda: CommandLevel.APPLIED in sub.levels(3))
        assert sub.vehicle.autopilot.is_armed
        sub.link.send_command(SUB, CommandKind.DISARM, CommandNumber(4), expires)
        await until(lambda: CommandLevel.APPLIED in sub.levels(4))
        assert not sub.vehicle.autopilot.is_armed


async def test_arming_that_it_refuses_is_refused():
    async with rig() as sub:
        sub.vehicle.plant.charge = 0.01
        await sub.report(lambda one: one.place is not None)
        expires = datetime.now(UTC) + timedelta(days=30)
        sub.link.send_command(SUB, CommandKind.ARM, CommandNumber(3), expires)
        await until(lambda: CommandLevel.REFUSED in sub.levels(3))
        assert not sub.vehicle.autopilot.is_armed


async def test_a_disarmed_vehicle_in_the_surface_mode_proves_nothing_until_it_rises():
    async with rig() as sub:
        await sub.report(lambda one: one.place is not None)

        def is_deep(report):
            sub.vehicle.plant.depth_m = began_m  # it rises by itself until the station has seen it
            return depth_m(report) > 8.0

        began_m = 9.0
        await sub.report(is_deep)
        expires = datetime.now(UTC) + timedelta(days=30)
        sub.link.send_command(SUB, CommandKind.SURFACE, CommandNumber(3), expires)
        await until(lambda: CommandLevel.APPLIED in sub.levels(3))
        assert sub.vehicle.plant.depth_m < began_m - 0.2
        assert not sub.vehicle.autopilot.is_armed


async def test_a_command_that_it_does_not_know_is_refused():
    async with rig(StandardCommandConfig(surface_by="command", surface_number=21)) as sub:
        await sub.report(lambda one: one.place is not None)
        expires = datetime.now(UTC) + timedelta(days=30)
        sub.link.send_command(SUB, CommandKind.SURFACE, CommandNumber(3), expires)
        await until(lambda: CommandLevel.REFUSED in sub.levels(3))


async def test_it_flies_a_mission_of_waypoints_and_surfaces_at_the_end():
    items = [item(0, 0, 0), item(170, 125, 3.0), item(200, 125, 5.0)]
    async with rig() as sub:
        await sub.report(lambda one: one.place is not None)
        await sub.link.services(SUB).missions.upload(items)
        held = await sub.link.services(SUB).missions.download()
        assert [one.is_same(sent) for one, sent in zip(held, items, strict=True)] == [
            False,  # its home is its own
            True,
            True,
        ]
        await sub.arm()
        await sub.enter("AUTO")
        report = await sub.report(lambda one: one.mission_item == 2)
        assert report.mission_items == 2

        def words():
            return [one.text for one in sub.told if isinstance(one, VehicleWord)]

        await until(lambda: "Mission complete" in words())
        await sub.report(lambda one: one.mode == "SURFACE" and depth_m(one) < 0.3)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (item(150, 112, -10.0), "item 3: altitude 10 m is above the surface"),
        (item(150, 112, 60.0), "item 3: 60 m is deeper than 20 m"),
        (item(150, 112, 2.0, grace.MAV_CMD_NAV_LAND), "item 3: command 21 is not supported"),
    ],
)
async def test_a_mission_that_it_cannot_fly_is_refused_at_its_item_in_words(wrong, words):
    async with rig() as sub:
        await sub.report(lambda one: one.place is not None)
        items = [item(0, 0, 0), item(150, 112, 3.0), item(151, 112, 3.0), wrong]
        with pytest.raises(ServiceRefusedError):
            await sub.link.services(SUB).missions.upload(items)
        await until(lambda: sub.newest(VehicleWord))
        assert sub.newest(VehicleWord).text == words


async def test_its_parameters_are_cast_as_those_of_ardupilot():
    async with rig() as sub:
        await sub.report(lambda one: one.place is not None)
        values = {one.name: one.value for one in await sub.link.read_parameters(SUB)}
        assert (values["SYSID_THISMAV"], values["WPNAV_SPEED"]) == (4, 60.0)
        await sub.link.write_parameter(SUB, "SIM_LEAK", 1)
        await sub.report(lambda one: one.values.get("leak") is not None and one.is_critical)
        word = await until(lambda: sub.newest(VehicleWord))
        assert word.text == "Leak Detected"


def test_it_stays_in_the_water_and_its_battery_empties():
    now = datetime.now(UTC)
    sub = SubVehicle(SUB_1, open_transport("udp://127.0.0.1:1"), ScaledClock(now, now, 1.0))
    sub.autopilot.arm(True)
    sub.autopilot.enter(MODES["GUIDED"])
    sub.autopilot.go_to(200.0, 200.0, 500.0)
    for _ in range(round(600 / PERIOD_S)):
        sub.step()
    assert sub.plant.depth_m <= sub.plant.floor_m
    assert math.hypot(sub.plant.north_m - 200.0, sub.plant.east_m - 200.0) < 3.0
    assert 0.5 < sub.plant.charge < 0.99


def test_robots_are_named_by_kind_and_number():
    names = robots_named(["miniglider:4", "grace3:3", "sub:2"])
    assert names == (
        *(f"mini-{number}" for number in range(1, 5)),
        *(f"grace-{number}" for number in range(1, 4)),
        "sub-1",
        "sub-2",
    )
    own = [FLEET[name] for name in names[:7]]
    every = [*own, *map(sub_definition, names[7:])]
    assert len({one.system_id for one in every}) == len(names)
    assert len({one.radio_address for one in own} | {one.station_address for one in own}) == 14
    assert len({one.link_name for one in own}) == len(own)
    assert len({one.start_ne_m for one in every}) == len(every)
    for robot in every:
        assert robot.site.clearance_m(*robot.start_ne_m) > 0.0
        assert robot.site.water.contains(*robot.start_ne_m, 0.0)


def test_several_robots_are_named_by_their_first_and_last_number():
    assert robots_named(["mini-9..11", "mini-10", "sub-2..2"]) == (
        "mini-9",
        "mini-10",
        "mini-11",
        "sub-2",
    )


@pytest.mark.parametrize(("count", "minis", "graces"), [(1, 1, 0), (5, 3, 2), (50, 25, 25)])
def test_a_fleet_is_half_in_the_tank_and_half_in_the_lake(count, minis, graces):
    fleet = fleet_of(count)
    assert len(set(fleet)) == count
    prefixes = [name.split("-")[0] for name in fleet]
    assert (prefixes.count("mini"), prefixes.count("grace")) == (minis, graces)


@pytest.mark.parametrize("count", [0, 101])
def test_a_fleet_that_cannot_be_is_refused_with_the_limits(count):
    with pytest.raises(ValueError, match="there are 1 to 100"):
        fleet_of(count)


@pytest.mark.parametrize(
    "wrong", ["mini-49..51", "nautilus", "miniglider:99", "mini-0", "mini-01", "sub-51", ""]
)
def test_a_robot_that_cannot_be_is_refused_with_what_can(wrong):
    with pytest.raises(ValueError, match=r"there are mini-1, .*sub-1, and miniglider:N"):
        robots_named([wrong])


def test_the_first_submarine_has_a_name_of_its_own():
    assert SUBS[RobotId("sub-1")] is sub_definition("sub-1")


async def test_it_is_driven_by_hand_and_stands_still_without_a_stick():
    async with rig() as sub:
        await sub.report(lambda one: one.mode == "MANUAL")
        pilot = sub.link.drive(SUB)
        await pilot.begin()
        await sub.report(lambda one: one.is_armed)
        vehicle = sub.vehicle.autopilot

        async def steered():  # a stick of three seconds ago, soon over at this speed, is none
            demand = vehicle.demand()
            if demand.forward == pytest.approx(0.5):
                return demand
            return await pilot.steer(Stick(forward=0.5, turn=-0.25, up=-1.0), 1)

        demand = await until(steered)
        assert (demand.turn, demand.down) == pytest.approx((-0.25, 1.0))
        # nobody speaks any more
        await until(lambda: vehicle.demand().effort == 0.0)
        assert vehicle.is_armed
        await pilot.end()
        await sub.report(lambda one: one.is_armed is False)
