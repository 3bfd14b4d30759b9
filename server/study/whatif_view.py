"""What-if runs."""

from dataclasses import dataclass
from datetime import datetime
from typing import Any

from server.base.view import View


@dataclass(frozen=True, slots=True)
class StudyStartedView(View):
    """Where to ask what came of a study, and how far its work is."""

    id: str
    job: str
    """Its progress by `GET /api/jobs/{job}`; `DELETE` calls it off."""


@dataclass(frozen=True, slots=True)
class WhatIfSummaryView(View):
    """A what-if run in a list."""

    id: str
    state: str
    """``running``, ``done``, ``failed``, ``cancelled`` or ``interrupted``."""
    title: str
    """Its controllers and its reference."""
    vehicle: str
    """Key of the vehicle that it was run with."""
    shown: bool
    """Whether the 3D view draws it now."""
    job: str | None
    created_at: datetime
    created_by: str


@dataclass(frozen=True, slots=True)
class WhatIfsView(View):
    """What-if runs of a robot, the newest first."""

    whatifs: list[WhatIfSummaryView]


@dataclass(frozen=True, slots=True)
class WhatIfView(View):
    """One what-if run with all that was asked and what came of it."""

    id: str
    robot: str
    state: str
    """``running``, ``done``, ``failed``, ``cancelled`` or ``interrupted``."""
    title: str
    vehicle: str
    """Key of the vehicle that it was run with."""
    scenario: dict[str, Any]
    """The whole scenario; see `GET /api/config/trial/schema`."""
    controllers: list[dict[str, Any]]
    """``kind``, ``title`` and the whole ``config`` of each controller."""
    message: str
    """Why it has no result."""
    notices: list[str]
    """Where its reference leaves the robot's water; a run has neither walls nor floor."""
    result: dict[str, Any] | None
    """Reference, tracks, errors, actuator use and summary of each controller; null before the
    end."""
    shown: bool
    """Whether the 3D view draws it now."""
    job: str | None
    created_at: datetime
    created_by: str
    ended_at: datetime | None
