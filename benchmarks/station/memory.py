"""The most memory that a process has had in use."""

import resource
from pathlib import Path

_STATUS = Path("/proc/self/status")


def peak_mb() -> float:
    """Return the high-water mark of this process's own memory.

    Linux keeps ``ru_maxrss`` across fork and exec, so that a process started afresh reports that
    of the process which started it if it was larger; the mark in ``status`` begins anew.
    """
    if _STATUS.exists():
        for line in _STATUS.read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) / 1024.0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
