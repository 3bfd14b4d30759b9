"""Slows down whoever guesses, and nobody else.

A try is counted before the slow check of its password begins, so that many at once are no way
around. It counts against its name from its address, and against its address; a browser that has
signed a person in before counts by itself, so that nobody else's tries keep that person out.
"""

import asyncio
import hashlib
import hmac
import secrets
from collections.abc import Callable
from dataclasses import dataclass
from http import HTTPStatus
from ipaddress import ip_address, ip_network
from typing import Final, TypeAlias, TypeVar

from robot_link.clock import monotonic_s
from server.base.problem import Problem

FREE_FAILURES: Final = 5
FREE_FAILURES_OF_ADDRESS: Final = 20
"""With any names: several people may sit behind one address."""
PAUSE_S: Final = 30.0
FORGOTTEN_S: Final = 15 * 60.0
"""A count to which nothing was added for so long is none."""
_KEPT_MAX: Final = 10_000
HASHES_AT_ONCE: Final = 2
HASHES_WAITING: Final = 8
Key: TypeAlias = tuple[str, ...]
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Origin:
    """Where a try comes from."""

    address: str
    """Of the other machine; a network of IPv6 counts as one."""
    browser: str | None = None
    """Mark of a browser that has signed this person in before."""

    @classmethod
    def of(cls, host: str | None, browser: str | None = None) -> "Origin":
        """Return the origin of a connection from a host."""
        try:
            address = ip_address(host or "")
        except ValueError:
            return cls(host or "here", browser)
        if address.version == 6 and not address.is_loopback:
            return cls(str(ip_network((address, 64), strict=False)), browser)
        return cls(str(address), browser)

    def keys(self, name: str) -> dict[Key, int]:
        """Return what a try of a name counts against, each with how many failures are free."""
        if self.browser is not None:
            return {("browser", name, self.browser): FREE_FAILURES}
        return {
            ("name", name, self.address): FREE_FAILURES,
            ("address", self.address): FREE_FAILURES_OF_ADDRESS,
        }


@dataclass(frozen=True, slots=True)
class Reservation:
    """One try, counted as failed for as long as nothing else is known of it."""

    at_s: float
    """When it was counted, by the monotonic clock."""
    earlier_s: dict[Key, float]
    """What it counts against, each with the moment of the try before."""


class Throttle:
    """Counts tries, and pauses after too many that failed."""

    def __init__(self) -> None:
        self._tries: dict[Key, tuple[int, float]] = {}

    def reserve(self, keys: dict[Key, int]) -> Reservation:
        """Count a try as failed until it is known to have succeeded, or was not judged at all.

        Raises:
            Problem: 429 while a pause lasts.
        """
        now_s = monotonic_s()
        for key, free in keys.items():
            tries, last_s = self._count(key, now_s)
            left_s = last_s + PAUSE_S - now_s
            if tries >= free and left_s > 0:
                raise Problem(
                    HTTPStatus.TOO_MANY_REQUESTS,
                    f"Too many failed tries; wait {left_s:.0f} s.",
                    headers={"Retry-After": str(int(left_s) + 1)},
                )
        earlier_s: dict[Key, float] = {}
        for key in keys:
            tries, earlier_s[key] = self._count(key, now_s)
            self._tries.pop(key, None)
            self._tries[key] = (tries + 1, now_s)
        while len(self._tries) > _KEPT_MAX:
            del self._tries[next(iter(self._tries))]
        return Reservation(now_s, earlier_s)

    def give_back(self, reservation: Reservation) -> None:
        """Forget this try alone: it proved nothing, or it succeeded."""
        for key, earlier_s in reservation.earlier_s.items():
            tries, last_s = self._tries.get(key, (0, 0.0))
            if tries > 1:
                is_last = last_s == reservation.at_s
                self._tries[key] = (tries - 1, earlier_s if is_last else last_s)
            else:
                self._tries.pop(key, None)

    def succeeded(self, reservation: Reservation) -> None:
        """Forget the tries of a name from here; of an address, this one alone."""
        self.give_back(reservation)
        for key in reservation.earlier_s:
            if key[0] != "address":
                self._tries.pop(key, None)

    def _count(self, key: Key, now_s: float) -> tuple[int, float]:
        """Return how many tries count against a key, and when the last of them was."""
        tries, last_s = self._tries.get(key, (0, 0.0))
        return (tries, last_s) if now_s - last_s <= FORGOTTEN_S else (0, 0.0)


class HashGate:
    """Lets few slow checks run at once, each of which takes 64 MB, and few wait.

    Belongs to one event loop.
    """

    def __init__(self) -> None:
        self._running = asyncio.Semaphore(HASHES_AT_ONCE)
        self._inside = 0

    async def run(self, work: Callable[[], T]) -> T:
        """Run the work in a thread.

        Raises:
            Problem: 503 if too many wait already.
        """
        if self._inside >= HASHES_AT_ONCE + HASHES_WAITING:
            raise Problem(
                HTTPStatus.SERVICE_UNAVAILABLE,
                "Too many sign in at once; try again soon.",
                headers={"Retry-After": "2"},
            )
        self._inside += 1
        try:
            async with self._running:
                return await asyncio.to_thread(work)
        finally:
            self._inside -= 1


class KnownBrowsers:
    """Marks browsers that have signed a person in; the mark opens nothing."""

    def __init__(self, key: bytes) -> None:
        self._key = key

    def mark(self, name: str) -> str:
        """Return a new mark of a browser of this person."""
        identity = secrets.token_urlsafe(12)
        return f"{identity}.{self._seal(identity, name)}"

    def identity(self, mark: str | None, name: str) -> str | None:
        """Return which browser a mark stands for, ``None`` if it is none of this person's."""
        identity, _, seal = (mark or "").partition(".")
        fits = hmac.compare_digest(seal.encode(), self._seal(identity, name).encode())
        return identity if fits else None

    def _seal(self, identity: str, name: str) -> str:
        said = f"{identity} {name}".encode(errors="surrogatepass")
        return hmac.new(self._key, said, hashlib.sha256).hexdigest()
