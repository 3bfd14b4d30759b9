"""A real PostgreSQL server for tests, in a folder of its own, reached by a Unix socket alone."""

import os
import pwd
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

PACKAGED = "/usr/lib/postgresql"
"""Where Debian keeps the programs, out of everybody's path."""


def program(name: str) -> str | None:
    """Return where a program of the server is, or None."""
    packaged = sorted(Path(PACKAGED).glob(f"*/bin/{name}"))
    return shutil.which(name) or (str(packaged[-1]) if packaged else None)


class PostgresqlServer:
    """One running server; it refuses to run as root, so that it then runs as somebody else."""

    def __init__(self, folder: Path, user: str | None) -> None:
        self._folder = folder
        self._user = user
        self._names = 0
        self._process: subprocess.Popen[bytes] | None = None
        self._run("initdb", "-D", str(folder / "data"), "-U", "grace", "-A", "trust",
                  "-E", "UTF8", "--no-sync")  # fmt: skip
        self.start()

    def start(self) -> None:
        """Start, and wait until it takes connections."""
        self._process = subprocess.Popen(
            [_program("postgres"), "-D", str(self._folder / "data"), "-k", str(self._folder),
             "-h", "", "-F", "-c", "max_connections=60"],
            user=self._user, cwd=self._folder, env=_environment(),
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
        )  # fmt: skip
        while self._ask("SELECT 1").returncode != 0:
            assert self._process.poll() is None, "the server ended"

    def stop(self) -> None:
        """Stop as an administrator does who does not wait for clients."""
        if self._process is not None:
            self._process.send_signal(signal.SIGINT)
            self._process.wait()

    def kill(self) -> None:
        """Kill the server with all its processes, as a machine does that loses its power."""
        assert self._process is not None
        first = self._process.pid
        os.kill(first, signal.SIGSTOP)  # so that it starts no further process meanwhile
        others = Path(f"/proc/{first}/task/{first}/children").read_text().split()
        for pid in map(int, (*others, first)):
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self._process.wait()
        while any(_is_alive(pid) for pid in others):  # they hold on to the shared memory
            time.sleep(0.01)

    @contextmanager
    def down(self) -> Generator[None]:
        """Have no server for a while."""
        self.stop()
        try:
            yield
        finally:
            self.start()

    def database(self, template: str = "template0") -> str:
        """Make a database, as a copy of another that nobody uses; return its name."""
        self._names += 1
        name = f"station{self._names}"
        done = self._ask(f"CREATE DATABASE {name} TEMPLATE {template}")
        assert done.returncode == 0, done.stderr
        return name

    def drop(self, name: str) -> None:
        """Drop a database, whoever is still connected."""
        self._ask(f"DROP DATABASE {name} WITH (FORCE)")

    def url(self, name: str) -> str:
        """Return the URL by which a station opens a database."""
        return f"postgresql://grace@/{name}?host={self._folder}"

    def _ask(self, statement: str) -> "subprocess.CompletedProcess[bytes]":
        return subprocess.run(
            [_program("psql"), "-h", str(self._folder), "-U", "grace", "-d", "postgres",
             "-X", "-q", "-c", statement],
            capture_output=True, check=False, env=_environment(),
        )  # fmt: skip

    def _run(self, name: str, *options: str) -> None:
        subprocess.run(
            [_program(name), *options], user=self._user, cwd=self._folder, env=_environment(),
            check=True, capture_output=True,
        )  # fmt: skip


@contextmanager
def postgresql_server() -> Generator[PostgresqlServer | None]:
    """Run a server for as long as it is used; None where this machine has none."""
    if not all(program(name) for name in ("initdb", "postgres", "psql")):
        yield None
        return
    # The path of a socket is short.
    folder = Path(tempfile.mkdtemp(prefix="grace-pg-", dir="/tmp"))
    user = _somebody() if os.geteuid() == 0 else None
    if user is not None:
        shutil.chown(folder, user)
    server: PostgresqlServer | None = None
    try:
        server = PostgresqlServer(folder, user)
        yield server
    finally:
        if server is not None:
            server.stop()
        shutil.rmtree(folder)


def _is_alive(pid: str) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except OSError:
        return False
    return state != "Z"


def _somebody() -> str:
    known = {entry.pw_name for entry in pwd.getpwall()}
    return "postgres" if "postgres" in known else "nobody"


def _program(name: str) -> str:
    found = program(name)
    assert found is not None
    return found


def _environment() -> dict[str, str]:
    """Return the environment without anybody's own settings of PostgreSQL."""
    return {name: value for name, value in os.environ.items() if not name.startswith("PG")}
