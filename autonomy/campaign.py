"""Many pieces of work that do not depend on one another, on every core or on many machines.

Flights of a comparison, candidates of a swarm and trials of a reproduction are campaigns. Where
they are worked out is one address, ``GRACE_CLUSTER``:

- unset: threads of this process, for compiled kernels release the interpreter's lock. Work that
  holds the lock goes to a local cluster where there are cores for one, and Dask is installed;
- ``threads``: always threads;
- ``local``: a Dask cluster of processes on this machine;
- ``tls://HOST:PORT``, or ``tcp://`` on this machine: the scheduler of a Dask cluster. Whoever
  reaches a scheduler runs code on its machines, so another machine's must prove itself by TLS.

The numbers do not depend on it: each piece is a pure function of what it is given.
"""

import importlib
import os
import time
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from ipaddress import ip_address
from typing import Any, Final, Protocol, TypeVar
from urllib.parse import urlsplit

ADDRESS_VARIABLE: Final = "GRACE_CLUSTER"
CORES_OF_A_LOCAL_CLUSTER: Final = 4
"""With fewer, its processes and their scheduler take what they bring."""
_PATIENCE_S: Final = 10.0
_LOOK_S: Final = 0.1
_DISTRIBUTION: Final = "grace-ground-station"

S = TypeVar("S")
T = TypeVar("T")
R = TypeVar("R")
S_contra = TypeVar("S_contra", contravariant=True)


class CampaignCancelledError(Exception):
    """The campaign was called off before it was done."""


class ClusterError(Exception):
    """The cluster cannot be used; the sentence says why, and what to do."""


class Spread(Protocol):
    """Where the pieces of a campaign are worked out."""

    places: int
    """So many pieces at once."""

    def run(
        self,
        work: Callable[[S, T], R],
        shared: S,
        items: Sequence[T],
        *,
        on_done: Callable[[int], None] = ...,
        is_cancelled: Callable[[], bool] = ...,
    ) -> list[R]:
        """Return ``work(shared, item)`` of each item, in their order.

        Args:
            work: A function of a module, for it may be sent to another machine.
            shared: What every piece needs; sent once.
            items: What makes the pieces differ.
            on_done: Told how many are done, in the caller's thread.
            is_cancelled: Asked a few times a second.

        Raises:
            CampaignCancelledError: It was called off; what had begun is finished or left.
            ClusterError: The cluster went away.
            Exception: What a piece raised.
        """
        ...


class Threads:
    """Threads of this process."""

    def __init__(self, places: int | None = None) -> None:
        self.places = places or os.cpu_count() or 1

    def run(
        self,
        work: Callable[[S, T], R],
        shared: S,
        items: Sequence[T],
        *,
        on_done: Callable[[int], None] = lambda _: None,
        is_cancelled: Callable[[], bool] = lambda: False,
    ) -> list[R]:
        """See ``Spread``."""
        with ThreadPoolExecutor(self.places, "campaign") as pool:
            pieces = [pool.submit(work, shared, item) for item in items]
            waiting = set(pieces)
            try:
                while waiting:
                    if is_cancelled():
                        raise CampaignCancelledError
                    done, waiting = wait(waiting, _LOOK_S, FIRST_COMPLETED)
                    for piece in done:
                        piece.result()
                    if done:
                        on_done(len(pieces) - len(waiting))
            finally:
                pool.shutdown(cancel_futures=True)
        return [piece.result() for piece in pieces]


class Cluster:
    """A Dask cluster; ``opened`` makes one."""

    def __init__(self, client: Any, address: str) -> None:  # noqa: ANN401 - Dask is optional
        self._client = client
        self._address = address
        self.places = sum(client.nthreads().values())

    def run(
        self,
        work: Callable[[S, T], R],
        shared: S,
        items: Sequence[T],
        *,
        on_done: Callable[[int], None] = lambda _: None,
        is_cancelled: Callable[[], bool] = lambda: False,
    ) -> list[R]:
        """See ``Spread``."""
        client = self._client
        # on every machine, for what only one of them had would go away with it
        common = client.scatter(shared, hash=False, broadcast=True)
        pieces = [client.submit(work, common, item, pure=False) for item in items]
        try:
            with client.as_current():
                self._follow(pieces, on_done, is_cancelled)
            return self._gathered(pieces)
        except _losses() as error:
            raise self._gone() from error
        except BaseException:
            client.cancel(pieces)
            raise

    def _follow(
        self,
        pieces: list[Any],
        on_done: Callable[[int], None],
        is_cancelled: Callable[[], bool],
    ) -> None:
        done = 0
        running = importlib.import_module("distributed").as_completed(pieces)
        while done < len(pieces):
            if is_cancelled():
                raise CampaignCancelledError
            before = done
            for piece in running.next_batch(block=False):
                status = piece.status
                if status == "cancelled":
                    raise self._gone()
                if status == "error":
                    piece.result()
                if status == "finished":
                    done += 1
                else:  # it went away with its machine, and another works it out again
                    running.add(piece)
            if done > before:
                on_done(done)
            else:
                time.sleep(_LOOK_S)

    def _gathered(self, pieces: list[Any]) -> list[Any]:
        try:
            return self._client.gather(pieces)
        except OSError as error:  # no piece's own: all of them are done
            raise self._gone() from error

    def _gone(self) -> ClusterError:
        return ClusterError(
            f"The cluster {self._address} went away in the middle of the work; start it again "
            "when the cluster is back."
        )


def _losses() -> tuple[type[Exception], ...]:
    """Return what Dask raises where its scheduler is gone."""
    comm, client = (importlib.import_module(f"distributed.{name}") for name in ("comm", "client"))
    return comm.CommClosedError, client.FutureCancelledError, client.FuturesCancelledError


@contextmanager
def opened(*, holds_lock: bool = False) -> Generator[Spread]:
    """Open what ``GRACE_CLUSTER`` says, for one campaign or several.

    Args:
        holds_lock: The work is mostly Python, of which one thread runs at a time.

    Raises:
        ClusterError: The address is none that may be used, or no cluster answers there.
    """
    address = os.environ.get(ADDRESS_VARIABLE, "")
    cores = os.cpu_count() or 1
    if not address and holds_lock and cores >= CORES_OF_A_LOCAL_CLUSTER and _has_dask():
        address = "local"
    if address in {"", "threads"}:
        yield Threads()
        return
    check_address(address)
    if not _has_dask():
        raise ClusterError(
            f"{ADDRESS_VARIABLE} is {address}, and Dask is not installed; install the extra: "
            "pip install 'grace-ground-station[campaign]'"
        )
    with _local() if address == "local" else _remote(address) as client:
        yield Cluster(client, address)


def check_address(address: str) -> None:
    """Refuse an address that is none, or one that would let strangers run code.

    Raises:
        ClusterError: Says which may be used.
    """
    if address in {"threads", "local"}:
        return
    try:
        parsed = urlsplit(address)
        has_place = parsed.hostname is not None and parsed.port is not None
    except ValueError:
        parsed, has_place = urlsplit(""), False
    if not has_place or parsed.scheme not in {"tcp", "tls"}:
        raise ClusterError(
            f"{address!r} is no address of a cluster: {ADDRESS_VARIABLE} is threads, local, "
            "tls://HOST:PORT, or tcp://127.0.0.1:PORT."
        )
    if parsed.scheme == "tcp" and not _is_here(parsed.hostname or ""):
        raise ClusterError(
            f"{address} is another machine without TLS, and whoever reaches a scheduler runs code "
            f"on its machines: give it a certificate, and use tls://{parsed.netloc}."
        )


def machines(client: Any) -> dict[str, tuple[str, int]]:  # noqa: ANN401 - Dask is optional
    """Return version of our software and number of threads of each worker, by its address."""
    threads = client.nthreads()
    return {place: (found, threads[place]) for place, found in client.run(software).items()}


def software() -> str:
    """Return the version of this software; every machine of a cluster must have the same."""
    try:
        return version(_DISTRIBUTION)
    except PackageNotFoundError:
        return "not installed"


def _has_dask() -> bool:
    return find_spec("distributed") is not None


def _is_here(host: str) -> bool:
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


@contextmanager
def _local() -> Generator[Any]:
    distributed = importlib.import_module("distributed")
    with (
        distributed.LocalCluster(
            n_workers=os.cpu_count(), threads_per_worker=1, dashboard_address="127.0.0.1:0"
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


@contextmanager
def _remote(address: str) -> Generator[Any]:
    distributed = importlib.import_module("distributed")
    try:
        client = distributed.Client(address, timeout=_PATIENCE_S, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise ClusterError(
            f"No Dask scheduler answers at {address}: start it, or unset {ADDRESS_VARIABLE}."
        ) from error
    with client:
        found = machines(client)
        if not found:
            raise ClusterError(
                f"The cluster {address} has no worker: start `dask worker {address}` on a machine."
            )
        strangers = {place: one for place, (one, _) in found.items() if one != software()}
        if strangers:
            place, other = next(iter(strangers.items()))
            raise ClusterError(
                f"The worker {place} of the cluster has version {other}, this machine "
                f"{software()}: install the same on all of them."
            )
        yield client
