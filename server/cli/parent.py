"""Ends a child process when the process that started it is gone, however that one ended."""

import os
import signal
import threading
import time

_PERIOD_S = 0.5
_GRACE_S = 15.0


def end_with_parent(parent_pid: int) -> None:
    """Watch the parent from a thread: when it is gone, stop in order, or by force if that fails."""
    threading.Thread(target=_watch, args=(parent_pid,), name="parent watch", daemon=True).start()


def _watch(parent_pid: int) -> None:
    while os.getppid() == parent_pid:
        time.sleep(_PERIOD_S)
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(_GRACE_S)
    os._exit(1)
