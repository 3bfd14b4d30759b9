"""The field's own checkers, each run in a closed child process.

The child reaches no network, inherits no secrets and has a limit of time. The extra ``delivery``
brings the checkers; without it, and whenever a check breaks, the answer is *could not be checked*.
"""

import contextlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Final

from server.base.worker import IsCancelled, WorkCancelledError
from server.delivery.finding import CheckReport, Finding

SUITES: Final[Mapping[str, tuple[str, ...]]] = {
    "og:1.0": ("check_variables_og1_url",),
    "cf:1.10": (),
}
"""Suites with the checks that are left out: what needs the network never runs."""
LIMIT_S: Final = 120.0
_PACKAGES: Final = ("compliance-checker", "cc-plugin-og")
_POLL_S: Final = 0.1
_INHERITED: Final = ("PATH", "HOME", "LANG", "LC_ALL", "SYSTEMROOT", "TMPDIR")
_FIXES: Final = (
    ("global attribute", "Fill in the metadata of the deployment, then write the file anew."),
    ("contributor", "Fill in the people in the metadata, then write the file anew."),
    ("units", "Correct the unit of the channel in Settings, Channels, then write the file anew."),
    (
        "standard_name",
        "Correct the CF name of the channel in Settings, Channels, then write the file anew.",
    ),
)
_FIX: Final = "Write the file anew; if this stays, it is a fault of the station."


def field_checks(
    path: Path, is_cancelled: IsCancelled, *, limit_s: float = LIMIT_S
) -> list[CheckReport]:
    """Run each suite over a file.

    Raises:
        WorkCancelledError: If the work is not wanted any more.
    """
    return [_checked(suite, path, is_cancelled, limit_s) for suite in SUITES]


def _checked(suite: str, path: Path, is_cancelled: IsCancelled, limit_s: float) -> CheckReport:
    begun, skipped = time.monotonic(), SUITES[suite]

    def unchecked(said: str, why: str) -> CheckReport:
        return CheckReport(suite, said, "unchecked", (), why, time.monotonic() - begun)

    try:
        said = ", ".join(f"{name} {version(name)}" for name in _PACKAGES)
    except PackageNotFoundError:
        extra = "pip install 'grace-ground-station[delivery]'"
        return unchecked("", f"The checkers are not installed: {extra}.")
    command = [sys.executable, "-m", "server.delivery.checker_process", str(path), suite, *skipped]
    environment = {name: os.environ[name] for name in _INHERITED if name in os.environ}
    with subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=environment,
    ) as child:
        told = _told(child, is_cancelled, begun + limit_s)
    if told is None:
        return unchecked(said, f"The checker did not end within {limit_s:g} s.")
    if child.returncode != 0:
        return unchecked(said, f"The checker broke off with status {child.returncode}.")
    try:
        answer = json.loads(told)
    except ValueError:
        return unchecked(said, "The checker's answer cannot be read.")
    return _report(suite, said, answer, time.monotonic() - begun)


def _told(
    child: subprocess.Popen[bytes], is_cancelled: IsCancelled, until_s: float
) -> bytes | None:
    """Return what a child prints, ``None`` for one that has not ended by a moment.

    Raises:
        WorkCancelledError: If the work is not wanted any more.
    """
    try:
        while time.monotonic() <= until_s:
            if is_cancelled():
                raise WorkCancelledError
            with contextlib.suppress(subprocess.TimeoutExpired):
                return child.communicate(timeout=_POLL_S)[0]
        return None
    finally:
        if child.poll() is None:
            child.kill()


def _report(suite: str, said: str, answer: Mapping[str, Any], seconds: float) -> CheckReport:
    """Return a report; a check that raised makes the whole suite one that was not checked."""
    if answer["errors"]:
        why = f"A check of the suite raised: {'; '.join(answer['errors'])}."
        return CheckReport(suite, said, "unchecked", (), why, seconds)
    if not answer["results"]:
        return CheckReport(suite, said, "unchecked", (), "No check of the suite ran.", seconds)
    findings = tuple(
        Finding(result["name"], "", message, _fix_of(f"{result['name']} {message}"))
        for result in answer["results"]
        if result["got"] < result["of"]
        for message in result["messages"] or ["The check did not pass."]
    )
    return CheckReport(suite, said, "findings" if findings else "passed", findings, "", seconds)


def _fix_of(words: str) -> str:
    return next((fix for key, fix in _FIXES if key in words.lower()), _FIX)
