from sqlalchemy import select
from sqlalchemy.engine.interfaces import CacheStats

from db.engine import READERS, read_engine, write_engine
from db.query.fleet.robots import add_robot
from db.store import Store
from db.tables import Robot
from tests.db.conftest import robot_record


def names_and_cache(engine):
    with engine.connect() as connection:
        result = connection.execute(select(Robot.id).order_by(Robot.id))
        return result.scalars().all(), result.context.cache_hit


def test_what_one_engine_has_compiled_is_known_to_engines_of_other_files(tmp_path):
    seen = []
    for name in ("mini-1", "mini-2"):
        url = f"sqlite:///{tmp_path / name}"
        store = Store.open(url)
        store.change(lambda session, name=name: add_robot(session, robot_record(name))).result(60)
        store.close()
        for engine in (write_engine(url), read_engine(url)):
            names, hit = names_and_cache(engine)
            engine.dispose()
            assert names == [name]
            seen.append(hit)
    assert seen[1:] == [CacheStats.CACHE_HIT] * 3


def test_the_connection_that_was_used_last_is_used_next(tmp_path):
    url = f"sqlite:///{tmp_path / 'station'}"
    Store.open(url).close()
    engine = read_engine(url)
    crowd = [engine.connect() for _ in range(READERS)]
    opened = [one.connection.driver_connection for one in crowd]
    assert len(set(map(id, opened))) == READERS
    for one in crowd:
        one.close()
    for _ in range(READERS):
        with engine.connect() as connection:
            assert connection.connection.driver_connection is opened[-1]
    engine.dispose()
