from sqlalchemy import select
from sqlalchemy.engine.interfaces import CacheStats

from db.engine import read_engine, write_engine
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
