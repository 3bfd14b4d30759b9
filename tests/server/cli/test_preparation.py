"""What a new version finds out about a database before it takes over from a running station."""

import pytest
from alembic import command

from db.engine import write_engine
from db.migrate import configuration, migrate, schema_version
from server.base.settings import Settings
from server.cli.service.preparation import FOLDER, prepare
from server.cli.service.succession import SuccessionError


def database(settings, revision):
    engine = write_engine(settings.resolved_database_url)
    with engine.begin() as connection:
        command.upgrade(configuration(connection), revision)
    engine.dispose()


def schema(settings):
    engine = write_engine(settings.resolved_database_url)
    with engine.connect() as connection:
        found = schema_version(connection)
    engine.dispose()
    return found


@pytest.fixture
def settings(tmp_path):
    folder = tmp_path / "data"
    folder.mkdir()
    return Settings(data_dir=folder)


async def test_a_database_that_fits_is_left_alone(settings):
    database(settings, "head")
    await prepare(settings)
    assert not (settings.data_dir / FOLDER).exists()


async def test_a_database_of_an_older_schema_is_backed_up_and_not_changed_yet(settings):
    database(settings, "0040")
    await prepare(settings)
    (backup,) = (settings.data_dir / FOLDER).iterdir()
    assert backup.stat().st_mode & 0o077 == 0
    assert schema(settings) == "0040"
    engine = write_engine(settings.resolved_database_url)
    migrate(engine)
    engine.dispose()
    await prepare(settings)
    assert list((settings.data_dir / FOLDER).iterdir()) == [backup]


async def test_a_backup_tells_how_far_it_is_and_takes_away_what_a_killed_one_left(settings):
    database(settings, "0040")
    left = settings.data_dir / FOLDER / ".grace-by-hand-killed"
    left.mkdir(parents=True)
    (left / "station.sqlite3").write_text("all secrets")
    told = []
    await prepare(settings, lambda share, words: told.append((share, words)))
    (backup,) = (settings.data_dir / FOLDER).iterdir()
    assert backup.suffix == ".gz"
    shares = [share for share, _ in told]
    assert shares == sorted(shares)
    assert shares[-1] > 0.5


async def test_a_database_of_a_newer_schema_keeps_a_version_from_taking_over(settings):
    database(settings, "head")
    engine = write_engine(settings.resolved_database_url)
    with engine.begin() as connection:
        connection.exec_driver_sql("UPDATE alembic_version SET version_num = '9999'")
    engine.dispose()
    with pytest.raises(SuccessionError, match="has schema 9999, which this version does not know"):
        await prepare(settings)


async def test_a_backup_that_cannot_be_made_keeps_a_version_from_taking_over(settings):
    database(settings, "0040")
    (settings.data_dir / FOLDER).write_text("no folder")
    with pytest.raises(SuccessionError):
        await prepare(settings)


async def test_a_certificate_that_cannot_be_used_keeps_a_version_from_taking_over(settings):
    database(settings, "head")
    named = settings.data_dir / "key.pem"
    named.write_text("no key")
    wrong = settings.model_copy(update={"tls_certificate": named, "tls_key": named})
    with pytest.raises(SuccessionError, match=r"key\.pem"):
        await prepare(wrong)
