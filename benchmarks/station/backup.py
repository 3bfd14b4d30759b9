"""How long the station's writer waits while it is backed up: commits one after another, SQLite.

The database is filled with rows that do not compress. ``BACKUP_MB`` tells how large it is.
"""

import os
import sqlite3
import subprocess
import sys
import tempfile
import time
from contextlib import closing
from pathlib import Path

from benchmarks.calibration import NotMeasuredError
from benchmarks.field.field import at_most
from db.query.station.settings import put_setting
from db.store import Store

AREA = "backup"
SIZE_MB = int(os.environ.get("BACKUP_MB", "1000"))
WAIT_MAX_MS = 500.0
_COMMITS_QUIET = 200
_MAKE = (
    "import os, sys; os.nice(10)\n"
    "from pathlib import Path\n"
    "from server.backup.making import BackupOrder, make_backup\n"
    "data, target = map(Path, sys.argv[1:])\n"
    "make_backup(BackupOrder(data, f'sqlite:///{data}/station.sqlite3', target))\n"
)


def measure() -> list[dict[str, object]]:
    """Return the longest commit during a backup, beside a quiet station's, and the pace of it."""
    with tempfile.TemporaryDirectory() as name:
        data = Path(name)
        file = data / "station.sqlite3"
        store = Store.open(f"sqlite:///{file}")
        try:
            _fatten(file)
            quiet = [_commit_ms(store, number) for number in range(_COMMITS_QUIET)]
            begun = time.perf_counter()
            command = [sys.executable, "-c", _MAKE, str(data), str(data / "lake.tar.gz")]
            busy: list[float] = []
            with subprocess.Popen(command) as maker:
                while maker.poll() is None:
                    busy.append(_commit_ms(store, len(busy)))
            took_s = time.perf_counter() - begun
            if maker.returncode != 0:
                raise NotMeasuredError("the backup failed")
        finally:
            store.close()
    what = f"a backup of {SIZE_MB} MB, {len(busy)} commits meanwhile"
    return [
        at_most(AREA, f"longest commit during {what}", max(busy), "ms", WAIT_MAX_MS),
        at_most(AREA, f"longest of {_COMMITS_QUIET} commits before", max(quiet), "ms", None),
        at_most(AREA, f"{what}: time for 100 MB", took_s * 100.0 / SIZE_MB, "s", 30.0),
    ]


def _commit_ms(store: Store, number: int) -> float:
    begun = time.perf_counter()
    store.change(lambda session: put_setting(session, "bench", {"number": number})).result(60)
    return 1e3 * (time.perf_counter() - begun)


def _fatten(file: Path) -> None:
    with closing(sqlite3.connect(file, timeout=60)) as base:
        base.execute("CREATE TABLE ballast (content BLOB)")
        for _ in range(SIZE_MB):
            with base:
                base.execute("INSERT INTO ballast VALUES (?)", (os.urandom(1 << 20),))
