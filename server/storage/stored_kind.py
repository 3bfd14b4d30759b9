"""The kinds of data that a station keeps, as people think of them, and where each lies."""

from dataclasses import dataclass
from typing import Final

from db.query.storage.prunable import PRUNABLE
from robot_link.storage_config import StorageConfig


@dataclass(frozen=True, slots=True)
class StoredKind:
    """One kind of data."""

    key: str
    title: str
    tables: tuple[str, ...] = ()
    """Its tables; the first has its rows."""
    at: str = ""
    """Column of the first that tells when a row belongs; "" where nothing does."""
    folders: tuple[str, ...] = ()
    """Folders of the data folder that it lies in."""


def _prunable(key: str, *beside: str) -> StoredKind:
    """Return a kind that has a rule, with the tables that go along with its rows."""
    kind, title = PRUNABLE[key], StorageConfig.model_fields[key].title
    return StoredKind(key, title or kind.title, (kind.table.name, *beside), kind.at)


STORED_KINDS: Final = (
    _prunable("raw"),
    _prunable("states", "state_rollup", "state_summed"),
    _prunable(
        "samples",
        *("sample_rollup", "sample_log", "sample_run"),
        *("recovered_sample", "smoothed_place", "other_series"),
    ),
    _prunable("readings", "reading_rollup"),
    _prunable("actuators"),
    _prunable("fixes"),
    StoredKind("detections", "Tags heard", ("detection", "receiver_report"), "measured_at"),
    StoredKind(
        "reports",
        "Reports on plans, targets and currents",
        ("plan_report", "plan_queue", "track_report", "current_report"),
        "measured_at",
    ),
    StoredKind("events", "Event log", ("event", "event_head"), "at"),
    StoredKind(
        "alarms",
        "Alarms and notices",
        ("alarm", "notice", "notice_case", "notice_item"),
        "raised_at",
    ),
    StoredKind("jobs", "Jobs", ("job",), "created_at"),
    StoredKind(
        "plans",
        "Plans and commands",
        ("plan", "mission", "transfer", "command", "command_level", "design", "design_version"),
        "created_at",
    ),
    StoredKind("decisions", "Decisions", ("decision", "decision_content"), "at"),
    StoredKind("maps", "Maps", ("map_snapshot", "prediction", "current_observation"), "at"),
    StoredKind(
        "quality", "Quality control", ("quality_run", "quality_stretch", "manual_flag"), "at"
    ),
    StoredKind("archive", "Files of moved rows", folders=("archive",)),
    StoredKind("deliveries", "Files and deliveries", folders=("delivery", "imports")),
    StoredKind(
        "pictures", "Pictures and films", folders=("camera_pictures", "log_pictures", "film")
    ),
    StoredKind(
        "base_maps",
        "Base maps and charts",
        folders=("base-maps", "water_charts", "water_currents"),
    ),
    StoredKind("logs", "Logs", folders=("log", "robot-logs")),
)
"""All that has a name of its own; the rest is told as one."""
