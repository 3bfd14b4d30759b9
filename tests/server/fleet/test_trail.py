from robot_link.messages import RobotMode
from server.fleet.fleet import Fleet
from server.fleet.trail import Track
from tests.server.conftest import MINI, open_station, until
from tests.server.fake_link import state_report


def norths(track):
    return track.since(0).position_ned[:, 0].tolist()


def test_points_of_the_past_lie_before_those_that_came_since():
    track = Track(0.5, (0.5,))
    track.add((10.0, 0.0, 1.0), 0.1, RobotMode.IDLE)
    before = track.since(0)
    track.begin_with([((float(n), 0.0, 1.0), 0.1, None) for n in range(3)])
    assert norths(track) == [0.0, 1.0, 2.0, 10.0]
    assert track.since(0).is_adrift.tolist() == [False, False, False, True]
    assert track.since(before.cursor).restarted


def test_a_point_that_the_past_ends_with_is_not_drawn_twice():
    track = Track(0.5, (0.5,))
    track.add((2.1, 0.0, 1.0), 0.1, None)
    track.begin_with([((float(n), 0.0, 1.0), 0.1, None) for n in range(3)])
    assert norths(track) == [0.0, 1.0, 2.0]


async def test_a_started_station_draws_where_a_robot_was(tmp_path, world):
    async with open_station(tmp_path, world) as station:
        world.hear(MINI)
        for north_m in (1.0, 2.0, 3.0):
            world.tell(state_report(MINI, (north_m, 0.5, 0.0)))
        fleet = station.foundation.services.get(Fleet)
        await until(lambda: norths(fleet.status(MINI).track)[-1:] == [3.0])
        drawn = norths(fleet.status(MINI).track)
    async with open_station(tmp_path, world) as station:
        fleet = station.foundation.services.get(Fleet)
        await until(lambda: norths(fleet.status(MINI).track) == drawn)
