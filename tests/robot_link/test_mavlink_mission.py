"""Standard missions: both ends of the protocol, and waypoints as legs of a glider."""

import math
from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from autonomy.planner.plan import PrimitiveKind
from onboard.link.mission_server import Asker, MissionServer, MissionVerdict
from onboard.link.status_text import status_texts
from onboard.link.waypoint_mission import (
    WaypointRefusal,
    WaypointRules,
    mission_of_waypoints,
    waypoints_of_mission,
)
from robot_link.clock import monotonic_s
from robot_link.mavlink.codec import STATION_COMPONENT, STATION_SYSTEM, WireMessage
from robot_link.mavlink.wire import grace
from robot_link.service.standard_item import StandardItem
from robot_link.station.error import NoAnswerError, ServiceRefusedError
from robot_link.station.mission_client import MissionClient
from tests.robot_link.service_pair import HASTY, Wire

RULES = WaypointRules(origin_latitude_deg=43.0, origin_longitude_deg=-84.0)
WAYPOINT, LOCAL = grace.MAV_CMD_NAV_WAYPOINT, grace.MAV_FRAME_LOCAL_NED
HERE = (0.0, 0.0, 0.0)
ASKS_AGAIN_S = 0.01


def local(north_m: float, east_m: float, depth_m: float, command: int = WAYPOINT) -> StandardItem:
    return StandardItem(command, LOCAL, round(north_m * 1e4), round(east_m * 1e4), depth_m)


ITEMS = tuple(local(n, 2.0 * n, 1.5 * (n % 2)) for n in range(30))


class Vehicle:
    """The robot's end with a mission on board."""

    def __init__(self, verdict: MissionVerdict | None = None) -> None:
        self.held: tuple[StandardItem, ...] = ()
        self.verdict = verdict or MissionVerdict()
        self.taken = 0
        self.server = self.fresh()

    def fresh(self) -> MissionServer:
        asker = Asker(STATION_SYSTEM, STATION_COMPONENT)
        return MissionServer(asker, self.take, lambda: self.held, answer_s=ASKS_AGAIN_S)

    def take(self, items: Sequence[StandardItem]) -> MissionVerdict:
        self.taken += 1
        if self.verdict.result == grace.MAV_MISSION_ACCEPTED:
            self.held = tuple(items)
        return self.verdict

    def hear(self, message: WireMessage) -> list[WireMessage]:
        return self.server.hear(message, monotonic_s())


def pair(vehicle: Vehicle, **conditions: float) -> tuple[MissionClient, Wire]:
    wire = Wire(vehicle.hear, **conditions)
    client = MissionClient(wire, patience=HASTY)
    wire.client = client.hear
    return client, wire


async def test_thirty_items_go_up_and_come_back_though_a_third_is_lost():
    vehicle = Vehicle()
    client, _ = pair(vehicle, loss=0.33, duplication=0.2)
    told: list[tuple[int, int]] = []
    await client.upload(ITEMS, report=lambda *at: told.append(at))
    assert vehicle.held == ITEMS
    assert vehicle.taken == 1
    assert told[-1] == (30, 30)
    assert await client.download() == ITEMS
    await client.verify(ITEMS)


async def test_an_upload_outlives_a_restart_of_the_vehicle():
    vehicle = Vehicle()
    client, _ = pair(vehicle)

    def restart(sent: int, _count: int) -> None:
        if sent == 15 and vehicle.taken == 0:
            vehicle.taken = -1
            vehicle.server = vehicle.fresh()

    await client.upload(ITEMS, report=restart)
    assert vehicle.held == ITEMS
    assert vehicle.taken == 0


async def test_a_refused_mission_leaves_the_one_on_board_and_says_why():
    vehicle = Vehicle(MissionVerdict(grace.MAV_MISSION_DENIED, "not from you"))
    client, wire = pair(vehicle)
    texts: list[str] = []
    hear = client.hear
    wire.client = lambda message: (texts.append(getattr(message, "text", "")), hear(message))[1]
    with pytest.raises(ServiceRefusedError, match="it does not take missions from this station"):
        await client.upload(ITEMS)
    assert vehicle.held == ()
    assert "not from you" in texts


async def test_another_mission_on_board_is_found_by_reading_it_back():
    vehicle = Vehicle()
    client, _ = pair(vehicle)
    await client.upload(ITEMS)
    with pytest.raises(ServiceRefusedError, match="holds 30 items, not 29"):
        await client.verify(ITEMS[:-1])
    changed = (*ITEMS[:7], local(1.0, 1.0, 9.0), *ITEMS[8:])
    with pytest.raises(ServiceRefusedError, match="item 7 on board"):
        await client.verify(changed)


async def test_a_silent_vehicle_and_an_endless_mission_end_with_a_sentence():
    vehicle = Vehicle()
    client, wire = pair(vehicle)
    with pytest.raises(ServiceRefusedError, match="too many items"):
        await client.upload(ITEMS * 20)
    wire.is_cut = True
    with pytest.raises(NoAnswerError):
        await client.download()
    with pytest.raises(NoAnswerError):
        await client.upload(ITEMS)


def test_a_server_asks_again_for_an_item_that_stays_away_and_forgets_who_went_silent():
    vehicle = Vehicle()
    count = grace.MAVLink_mission_count_message(1, 1, 3, 0)
    (asked,) = vehicle.server.hear(count, 0.0)
    assert asked.seq == 0
    assert vehicle.server.tick(0.9 * ASKS_AGAIN_S) == []
    (again,) = vehicle.server.tick(1.1 * ASKS_AGAIN_S)
    assert again.seq == 0
    (following,) = vehicle.server.hear(ITEMS[0].message(0, 1, 1), 2.0)
    assert following.seq == 1
    assert vehicle.server.tick(40.0) == []
    assert vehicle.server.hear(ITEMS[1].message(1, 1, 1), 41.0) == []


def test_fences_and_rally_points_are_empty_and_a_plan_is_never_wiped():
    vehicle = Vehicle()
    vehicle.held = ITEMS
    fence = grace.MAV_MISSION_TYPE_FENCE
    (none,) = vehicle.hear(grace.MAVLink_mission_request_list_message(1, 1, fence))
    assert (none.count, none.mission_type) == (0, fence)
    (refused,) = vehicle.hear(grace.MAVLink_mission_count_message(1, 1, 4, fence))
    assert refused.type == grace.MAV_MISSION_UNSUPPORTED
    denied, _ = vehicle.hear(grace.MAVLink_mission_clear_all_message(1, 1, 0))
    assert denied.type == grace.MAV_MISSION_DENIED
    (beyond,) = vehicle.hear(grace.MAVLink_mission_request_int_message(1, 1, 30, 0))
    assert beyond.type == grace.MAV_MISSION_INVALID_SEQUENCE
    assert vehicle.held == ITEMS


def test_waypoints_become_swims_glides_and_dives_that_join():
    items = (
        local(10, 0, 0),
        local(14, 0, 2),
        StandardItem(grace.MAV_CMD_DO_CHANGE_SPEED, 2, 0, 0, 0.0, (0.0, 0.4, 0.0, 0.0)),
        local(14, 6, 2),
        local(14, 6, 5),
        local(20, 6, 1),
    )
    mission = mission_of_waypoints(items, HERE, RULES)
    kinds = [leg.kind for leg in mission.legs]
    swim, glide, dive = PrimitiveKind.SWIM, PrimitiveKind.GLIDE, PrimitiveKind.DIVE
    assert kinds == [swim, glide, swim, dive, glide, dive]
    for before, after in zip(mission.legs, mission.legs[1:], strict=False):
        assert after.start_ned == before.end_ned
    assert mission.legs[-1].end_ned == (20.0, 6.0, 0.0)
    assert mission.legs[0].duration_s == pytest.approx(10 / 0.2)
    assert mission.legs[2].speed_m_s == pytest.approx(0.4)
    assert mission.settings.timeout_s > sum(leg.duration_s for leg in mission.legs)


def test_a_slope_that_no_glide_has_becomes_the_nearest_that_can_be_flown():
    told: list[str] = []
    items = (local(100, 0, 1), local(101, 0, 5), local(105, 0, 1), local(205, 0, 2))
    legs = mission_of_waypoints(items, HERE, RULES, told.append).legs
    swim, glide, dive = PrimitiveKind.SWIM, PrimitiveKind.GLIDE, PrimitiveKind.DIVE
    assert [leg.kind for leg in legs] == [glide, swim, dive, glide, glide, glide, swim, dive]
    ends = [leg.end_ned for leg in legs]
    for waypoint in ((100.0, 0.0, 1.0), (101.0, 0.0, 5.0), (105.0, 0.0, 1.0), (205.0, 0.0, 2.0)):
        assert any(math.dist(waypoint, end) < 0.01 for end in ends)
    for leg in legs:
        if leg.kind is glide:
            along = math.dist(leg.start_ned[:2], leg.end_ned[:2])
            slope = math.degrees(math.atan2(abs(leg.end_ned[2] - leg.start_ned[2]), along))
            assert 9.8 <= slope <= 60.2
    assert told == [
        "items 0, 3: too flat for one glide, a swim is added",
        "item 1: too steep, a dive is added",
    ]


def test_return_to_launch_comes_up_and_swims_back():
    items = (local(4, 0, 2), local(0, 0, 0, grace.MAV_CMD_NAV_RETURN_TO_LAUNCH))
    legs = mission_of_waypoints(items, HERE, RULES).legs
    assert [leg.end_ned for leg in legs] == [(4.0, 0.0, 2.0), (4.0, 0.0, 0.0), HERE]


@pytest.mark.parametrize(
    ("item", "result", "why"),
    [
        (local(1, 1, 0, 18), grace.MAV_MISSION_UNSUPPORTED, "command 18 cannot be flown"),
        (local(60, 0, 51), grace.MAV_MISSION_INVALID_PARAM7, "deeper than 50 m"),
        (local(1, 0, math.nan), grace.MAV_MISSION_INVALID_PARAM7, "no altitude"),
        (StandardItem(16, 99, 0, 0, 0.0), grace.MAV_MISSION_UNSUPPORTED_FRAME, "frame 99"),
        (
            StandardItem(16, 6, 910_000_000, 0, 0.0),
            grace.MAV_MISSION_INVALID_PARAM5_X,
            "no such place",
        ),
        (
            StandardItem(16, 6, 430_000_000, -840_000_000, 10.0),
            grace.MAV_MISSION_INVALID_PARAM7,
            "10.0 m above the water",
        ),
        (
            local(1.0, 0, -0.6),
            grace.MAV_MISSION_INVALID_PARAM7,
            "0.6 m above the water",
        ),
        (
            StandardItem(178, 2, 0, 0, 0.0, (0.0, -3.0, 0.0, 0.0)),
            grace.MAV_MISSION_INVALID_PARAM2,
            "no speed",
        ),
        (StandardItem(16, 6, 10, 0, 0.0), grace.MAV_MISSION_INVALID, "out of the wire's range"),
        (
            StandardItem(16, 6, 0, 0, 0.0),
            grace.MAV_MISSION_INVALID_PARAM5_X,
            "latitude 0, longitude 0 stands for no place",
        ),
        (
            StandardItem(16, 10, 430_000_000, -840_000_000, 10.0),
            grace.MAV_MISSION_UNSUPPORTED_FRAME,
            "above the floor cannot be planned",
        ),
    ],
)
def test_what_a_glider_cannot_fly_is_refused_by_the_items_number(
    item: StandardItem, result: int, why: str
):
    with pytest.raises(WaypointRefusal, match=why) as refusal:
        mission_of_waypoints((local(0.1, 0, 0), item), HERE, RULES)
    assert refusal.value.result == result
    assert str(refusal.value).startswith("item 1: " if result != 5 else "item 0: ")


def test_a_mission_that_leads_nowhere_is_refused():
    with pytest.raises(WaypointRefusal, match="leads nowhere"):
        mission_of_waypoints((local(0, 0, 0),), HERE, RULES)


@given(
    st.lists(
        st.tuples(st.floats(-400, 400), st.floats(-400, 400)), min_size=1, max_size=8, unique=True
    )
)
def test_a_mission_read_back_as_waypoints_is_the_same_way(places: list[tuple[float, float]]):
    items = tuple(local(north, east, 0.0) for north, east in places)
    try:
        mission = mission_of_waypoints(items, (500.0, 500.0, 0.0), RULES)
    except WaypointRefusal:
        return
    again = mission_of_waypoints(waypoints_of_mission(mission, RULES), (500.0, 500.0, 0.0), RULES)
    ends, back = ([leg.end_ned for leg in one.legs] for one in (mission, again))
    if len(ends) == len(back):
        assert all(math.dist(*pair) < 0.05 for pair in zip(ends, back, strict=True))
    else:  # a leg too short to fly is left out; its end lies by another's
        for some, others in ((ends, back), (back, ends)):
            assert all(min(math.dist(one, other) for other in others) < 0.1 for one in some)


@given(st.text(st.characters(codec="ascii", exclude_characters="\0"), max_size=180))
def test_a_long_sentence_is_whole_when_its_pieces_are_joined(text: str):
    pieces = status_texts(text)
    assert "".join(piece.text for piece in pieces) == text
    assert all(len(piece.text) <= 50 for piece in pieces)
    assert len({piece.id for piece in pieces}) <= 1
    assert [piece.chunk_seq for piece in pieces] == list(range(len(pieces)))
