"""Cameras whose processes see nothing: the tests tell what is seen."""

import sys

import pytest

from server.camera import child


@pytest.fixture(autouse=True)
def _blind_cameras(monkeypatch: pytest.MonkeyPatch) -> None:
    wait = "import os\nwhile os.read(0, 4096): pass"
    monkeypatch.setattr(child, "COMMAND", (sys.executable, "-c", wait))
