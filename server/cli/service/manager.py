"""What a service manager is told: the notification protocol of systemd, over its socket.

A station that runs under none says nothing. Source: sd_notify(3) and sd_watchdog_enabled(3).
"""

import asyncio
import contextlib
import os
import socket
import time
from collections.abc import Mapping
from typing import Final

from db.fault import StoreError
from db.store import Store

OF_ONE_PROCESS: Final = ("WATCHDOG_PID", "LISTEN_PID", "LISTEN_FDS", "LISTEN_FDNAMES")
"""What a service manager says to one process alone; another must not believe it."""
_FIRST_PASSED: Final = 3
"""Descriptor of the first socket that a service manager hands over."""


class ServiceManager:
    """Speaks to whoever started this process, if that wants to be spoken to.

    Args:
        environment: Where it said so.
    """

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        address = environment.get("NOTIFY_SOCKET", "")
        self._address = f"\0{address[1:]}" if address.startswith("@") else address
        is_for_us = environment.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        microseconds = environment.get("WATCHDOG_USEC", "") if is_for_us else ""
        self.watchdog_s = int(microseconds) / 1e6 if microseconds else None
        """Longest time between two signs of life, s; none where nobody watches."""
        passed = environment.get("LISTEN_PID") == str(os.getpid())
        self.listener = _FIRST_PASSED if passed and environment.get("LISTEN_FDS") == "1" else None
        """Descriptor of the listening socket that it holds for the station; none if it has none."""

    def ready(self, status: str) -> None:
        """Say that the station serves, and in which process."""
        self._tell("READY=1", f"MAINPID={os.getpid()}", f"STATUS={status}")

    def succeeded_by(self, process: int) -> None:
        """Say that another process is the service from now on, and serves."""
        self._tell(f"MAINPID={process}", "READY=1", "STATUS=Serving")

    def reloading(self, status: str) -> None:
        """Say that ``ready`` will be said anew."""
        now_us = time.clock_gettime_ns(time.CLOCK_MONOTONIC) // 1000
        self._tell("RELOADING=1", f"MONOTONIC_USEC={now_us}", f"STATUS={status}")

    def stopping(self) -> None:
        """Say that the station ends in order."""
        self._tell("STOPPING=1", "STATUS=Stopping")

    def alive(self) -> None:
        """Give a sign of life."""
        self._tell("WATCHDOG=1")

    def _tell(self, *lines: str) -> None:
        """Send one datagram; a manager that has gone away hinders nobody."""
        if not self._address:
            return
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as speaker:
            speaker.settimeout(1.0)
            try:
                speaker.sendto("\n".join(lines).encode(), self._address)
            except OSError:
                return


async def keep_alive(manager: ServiceManager, store: Store) -> None:
    """Give signs of life while the event loop runs and the database's writer answers.

    A writer that says that its disk is full, or its server away, has answered: to start anew would
    cure neither. One that hangs is waited for without end, and so no sign is given.
    """
    if manager.watchdog_s is None:
        return
    while True:
        with contextlib.suppress(StoreError):
            await store.write(lambda _session: None)
        manager.alive()
        await asyncio.sleep(manager.watchdog_s / 3)
