"""Decoded telemetry as it enters the tables, many rows a statement."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, cast

from sqlalchemy import CursorResult, Table, select
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.orm import Session

from db.current_tables import CurrentReportRow
from db.fault import UnknownIdError
from db.onboard_tables import ActuatorReportRow
from db.tables import Base, PlanReportRow, RawFrameRow, Robot, SampleCount, SampleRow, StateRow
from db.target_tables import TargetReportRow
from robot_link.messages import STATE, PlanReport, RawFrame, Sample, StateReport
from robot_link.report import ActuatorReport, CurrentReport, RobotReport, TargetReport

Telemetry = RobotReport | RawFrame
"""What the writer takes in batches."""


def append_telemetry(session: Session, values: Sequence[Telemetry]) -> None:
    """Insert decoded values; a value that is already there (sent twice) changes nothing.

    Raises:
        UnknownIdError: If a value names a robot that the station does not know.
    """
    keys = {row.id: row.key for row in session.execute(select(Robot.id, Robot.key))}
    rows: dict[type[Base], list[dict[str, Any]]] = {}
    for value in values:
        table, row = _row(value)
        if value.robot is not None:
            if value.robot not in keys:
                raise UnknownIdError("robot", value.robot)
            row["robot_key"] = keys[value.robot]
        rows.setdefault(table, []).append(row)
    for table, batch in rows.items():
        if table is SampleRow:
            insert_samples(session, batch)
        else:
            insert_new(session, table, batch)


def insert_samples(session: Session, rows: list[dict[str, Any]]) -> None:
    """Insert measurements, skip those whose key is taken, and count those that are new."""
    known = session.execute(select(Robot.key, Robot.created_at))
    added = {row[0]: row[1] for row in known}
    groups: dict[tuple[int, str, bool], list[dict[str, Any]]] = {}
    for row in rows:
        key = row["robot_key"]
        groups.setdefault((key, row["variable"], row["measured_at"] >= added[key]), []).append(row)
    counts = [
        {
            "robot_key": robot_key,
            "variable": variable,
            "is_live": is_live,
            "samples": insert_new(session, SampleRow, group),
        }
        for (robot_key, variable, is_live), group in groups.items()
    ]
    new = [row for row in counts if row["samples"]]
    if not new:
        return
    insert = _insert(session, SampleCount)
    session.execute(
        insert.on_conflict_do_update(
            index_elements=["robot_key", "variable", "is_live"],
            set_={"samples": SampleCount.samples + insert.excluded.samples},
        ),
        new,
    )


def insert_new(session: Session, table: type[Base], rows: list[dict[str, Any]]) -> int:
    """Insert rows, skip those whose key is taken, and return how many were new."""
    done = session.execute(
        _insert(session, table).on_conflict_do_nothing(),
        rows,
        execution_options={"preserve_rowcount": True},
    )
    return cast("CursorResult[Any]", done).rowcount


def _insert(session: Session, table: type[Base]) -> "sqlite.Insert | postgresql.Insert":
    dialect = sqlite if session.get_bind().dialect.name == "sqlite" else postgresql
    target = table.__table__
    if not isinstance(target, Table):
        raise TypeError(f"{table.__name__} is not a plain table")
    return dialect.insert(target)


def _row(value: Telemetry) -> tuple[type[Base], dict[str, Any]]:
    match value:
        case StateReport():
            return StateRow, _state_row(value)
        case Sample():
            return SampleRow, _sample_row(value)
        case PlanReport():
            return PlanReportRow, {
                "measured_at": value.measured_at,
                "received_at": value.received_at,
                "sha256": value.sha256,
                "state": int(value.state),
                "leg": value.leg,
                "legs": value.legs,
                "energy_used": value.energy_used,
                "reason": value.reason,
            }
        case TargetReport():
            return TargetReportRow, _target_row(value)
        case CurrentReport():
            return CurrentReportRow, {
                "measured_at": value.measured_at,
                "received_at": value.received_at,
                "north_m_s": value.current_ne_m_s[0],
                "east_m_s": value.current_ne_m_s[1],
                "std_m_s": value.current_std_m_s,
                "doubt": value.doubt,
                "dives": value.dives,
                "fixes_refused": value.fixes_refused,
            }
        case ActuatorReport():
            return ActuatorReportRow, _actuator_row(value)
        case RawFrame():
            return RawFrameRow, {
                "robot_key": None,
                "at": value.at,
                "robot_at": value.robot_at,
                "arrived_at": value.arrived_at,
                "carrier": value.carrier,
                "outgoing": value.outgoing,
                "data": value.data,
            }


def _state_row(report: StateReport) -> dict[str, Any]:
    row = STATE.values(report)
    row["measured_at"] = report.measured_at
    row["received_at"] = report.received_at
    row["has_fix"] = report.has_fix
    row["mode"] = int(report.mode)
    return row


def _sample_row(sample: Sample) -> dict[str, Any]:
    north_m, east_m, depth_m = sample.position_ned
    return {
        "log": sample.log,
        "sequence": sample.sequence,
        "variable": sample.variable,
        "measured_at": sample.measured_at,
        "received_at": sample.received_at,
        "value": sample.value,
        "north_m": north_m,
        "east_m": east_m,
        "depth_m": depth_m,
        "position_std_m": sample.position_std_m,
    }


def _actuator_row(report: ActuatorReport) -> dict[str, Any]:
    following = {
        f"{name}_{field}": value
        for name, told in (("mass", report.mass), ("pump", report.pump))
        for field, value in asdict(told).items()
    }
    return {
        "measured_at": report.measured_at,
        "received_at": report.received_at,
        **following,
        "speed_share": report.speed_share,
        "is_mass_off": report.is_mass_off,
        "is_swinging": report.is_swinging,
        "stuck": ",".join(report.stuck),
    }


def _target_row(report: TargetReport) -> dict[str, Any]:
    true_north_m, true_east_m = report.true_ne_m or (None, None)
    return {
        "measured_at": report.measured_at,
        "received_at": report.received_at,
        "phase": int(report.phase),
        "north_m": report.position_ne_m[0],
        "east_m": report.position_ne_m[1],
        "hypotheses": [
            [*one.position_ne_m, *one.velocity_ne_m_s, *one.covariance_m2, one.weight]
            for one in report.hypotheses
        ],
        "range_m": report.range_m,
        "range_age_s": report.range_age_s,
        "ranges_heard": report.ranges_heard,
        "ranges_rejected": report.ranges_rejected,
        "determinant_m2_s": report.determinant_m2_s,
        "barrier": report.barrier,
        "inverse_condition": report.inverse_condition,
        "nominal_turn_rate_rad_s": report.nominal[0],
        "nominal_acceleration_m_s2": report.nominal[1],
        "turn_rate_rad_s": report.command[0],
        "acceleration_m_s2": report.command[1],
        "is_barrier_on": report.is_barrier_on,
        "is_feasible": report.is_feasible,
        "is_quiet": report.is_quiet,
        "true_north_m": true_north_m,
        "true_east_m": true_east_m,
        "is_too_fast": report.is_too_fast,
        "speed_class": None if report.speed_class is None else int(report.speed_class),
        "delay_s": report.delay_s,
    }
