"""What processes of a demo and of a browser hold at a moment."""

import contextlib
from collections.abc import Callable, Iterable
from pathlib import Path

import psutil

_MB = 1e6


class Sampler:
    """Looks at station, simulator, browser and database.

    Args:
        data: The data folder of the station.
        heap: Returns figures of the page by their names.
        maps_mb: Returns what live maps of the station keep, 10^6 bytes.
    """

    def __init__(
        self, data: Path, heap: Callable[[], dict[str, float]], maps_mb: Callable[[], float]
    ) -> None:
        self._data = data
        self._heap = heap
        self._maps_mb = maps_mb

    def sample(self, at_s: float, station: int, simulator: int) -> dict[str, float]:
        """Look once.

        Args:
            at_s: When, in seconds of the run.
            station: Process id of the station.
            simulator: Process id of the simulator.

        Returns:
            Figures by name; ``_mb`` are memory that is no file's, and sizes of files, 10^6 bytes.
        """
        own, workers = psutil.Process(station), psutil.Process(station).children(recursive=True)
        robots = [psutil.Process(simulator), *psutil.Process(simulator).children(recursive=True)]
        browser = [one for one in psutil.Process().children(recursive=True) if _is_browser(one)]
        station_mb, workers_mb = memory_mb([own]), memory_mb(workers)
        maps_mb = self._maps_mb()
        return {
            "at_s": at_s,
            "station_mb": station_mb,
            "station_rss_mb": own.memory_info().rss / _MB,
            "station_pss_mb": own.memory_full_info().pss / _MB,
            "workers_mb": workers_mb,
            "maps_mb": maps_mb,
            "station_other_mb": station_mb - maps_mb,
            "station_all_mb": station_mb + workers_mb,
            "simulator_mb": memory_mb(robots),
            **self._heap(),
            "page_mb": memory_mb(one for one in browser if "--type=renderer" in _words(one)),
            "browser_all_mb": memory_mb(browser),
            "station_fds": own.num_fds(),
            "station_threads": own.num_threads(),
            "simulator_fds": sum(one.num_fds() for one in robots),
            "simulator_threads": sum(one.num_threads() for one in robots),
            "database_mb": sum(one.stat().st_size for one in self._data.glob("*.sqlite3*")) / _MB,
            "load": psutil.getloadavg()[0],
        }


def memory_mb(processes: Iterable[psutil.Process]) -> float:
    """Return the resident memory of some processes that mirrors no file; an ended one has none.

    Pages of files, such as libraries, come and go with what else runs on the machine.
    """
    total_kb = 0
    for process in processes:
        with contextlib.suppress(FileNotFoundError, ProcessLookupError):
            for line in Path(f"/proc/{process.pid}/status").read_text().splitlines():
                if line.startswith(("RssAnon:", "RssShmem:")):
                    total_kb += int(line.split()[1])
    return total_kb * 1024 / _MB


def _is_browser(process: psutil.Process) -> bool:
    return any("chrom" in word for word in _words(process)[:1])


def _words(process: psutil.Process) -> list[str]:
    """Return the command line of a process; none of one that ended.

    Processes of chromium that were forked from another write theirs as one word.
    """
    with contextlib.suppress(psutil.NoSuchProcess):
        return " ".join(process.cmdline()).split()
    return []
