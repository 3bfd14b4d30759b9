"""Cameras whose processes are stand-ins."""

import sys

import pytest

from server.camera import child

STAND_IN = (sys.executable, "-m", "tests.server.camera.stand_in")


@pytest.fixture(autouse=True)
def _stand_ins(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(child, "COMMAND", STAND_IN)
