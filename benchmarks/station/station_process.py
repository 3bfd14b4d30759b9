"""A real station process on a data folder of its own, for as long as something is measured."""

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import httpx

from benchmarks.calibration import NotMeasuredError
from db.store import Store
from server.access.register import create_token
from server.access.role import Role
from server.base.settings import Settings

START_LIMIT_S = 300.0


class StationProcess:
    """A station process with its address, its data folder and a viewer's token."""

    def __init__(self, process: subprocess.Popen[bytes], port: int, token: str, data: Path) -> None:
        self.process = process
        self.url = f"127.0.0.1:{port}"
        self.token = token
        self.data = data
        self._client = httpx.Client(
            base_url=f"http://{self.url}", headers={"Authorization": f"Bearer {token}"}, timeout=60
        )

    def get(self, path: str) -> httpx.Response:
        """Ask as a browser does, over one connection that stays open.

        Raises:
            httpx.HTTPStatusError: If the station refuses.
        """
        return self._client.get(path).raise_for_status()

    def post(self, path: str, body: Any) -> httpx.Response:
        """Send a JSON body as a browser does, over the same connection.

        Raises:
            httpx.HTTPStatusError: If the station refuses.
        """
        return self._client.post(path, json=body).raise_for_status()

    def cpu_s(self) -> float:
        """Return the processor time that the process has used."""
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(") ", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def memory_mb(self) -> float:
        """Return the resident memory of the process."""
        pages = int(Path(f"/proc/{self.process.pid}/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") / 1e6

    def wait_until_ready(self) -> None:
        """Wait for the health page.

        Raises:
            NotMeasuredError: If the station ended, or is not ready in time.
        """
        limit_s = time.monotonic() + START_LIMIT_S
        while time.monotonic() < limit_s:
            if self.process.poll() is not None:
                raise NotMeasuredError(f"the station ended by itself ({self.process.returncode})")
            with suppress(httpx.TransportError):
                if self._client.get("/api/health").json()["ready"]:
                    return
            time.sleep(0.1)
        raise NotMeasuredError(f"the station was not ready in {START_LIMIT_S:g} s")

    def close(self) -> None:
        """Close the connection."""
        self._client.close()


@contextmanager
def station_process() -> Iterator[StationProcess]:
    """Serve an empty folder."""
    with tempfile.TemporaryDirectory() as folder:
        store = Store.open(Settings(data_dir=Path(folder)).resolved_database_url)
        try:
            token = store.change(viewer_token).result()
        finally:
            store.close()
        with served(Path(folder), token) as station:
            yield station


def viewer_token(session) -> str:
    """Make a token in a change of the store; return its secret."""
    at = datetime.now(UTC)
    issued = create_token(
        session, "benchmark", Role.VIEWER, timedelta(hours=1), at=at, by="benchmark"
    )
    return issued.secret


@contextmanager
def served(folder: Path, token: str, port: int = 0) -> Iterator[StationProcess]:
    """Serve a folder, at a free port unless one is named, and wait until the station answers.

    Raises:
        NotMeasuredError: If it does not.
    """
    if not port:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
    command = [sys.executable, "-m", "server.cli", "serve", "--data", str(folder)]
    with (folder / "station.log").open("wb") as log:
        process = subprocess.Popen([*command, "--port", str(port)], stdout=log, stderr=log)
    with ended(process):
        station = StationProcess(process, port, token, folder)
        try:
            station.wait_until_ready()
            yield station
        finally:
            station.close()


@contextmanager
def ended(process: subprocess.Popen[Any]) -> Iterator[None]:
    """End a process with the context."""
    try:
        yield
    finally:
        process.send_signal(signal.SIGTERM)
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
