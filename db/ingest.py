"""Decoded telemetry as it enters the tables, many rows a statement."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, Final, cast

from sqlalchemy import CursorResult, Table, select
from sqlalchemy.orm import Session

from db.camera_tables import CameraFixRow
from db.current_tables import CurrentReportRow
from db.fault import UnknownIdError
from db.onboard_tables import ActuatorReportRow
from db.query.camera.fixes import FixRecord, fix_columns
from db.sample_ingest import NewReading, NewSample, insert_readings, insert_samples, upsert
from db.state_sums import sum_up_late
from db.tables import Base, PlanQueueRow, PlanReportRow, RawFrameRow, Robot, StateRow
from db.tag_tables import DetectionRow, ReceiverReportRow
from db.target_tables import TargetReportRow
from robot_link.messages import STATE, PlanQueue, PlanReport, RawFrame, Sample, StateReport
from robot_link.report import (
    ActuatorReport,
    CurrentReport,
    Detection,
    Reading,
    ReceiverReport,
    RobotReport,
    TargetReport,
)

_Row = (
    StateReport
    | PlanReport
    | PlanQueue
    | TargetReport
    | CurrentReport
    | ActuatorReport
    | Detection
    | ReceiverReport
    | RawFrame
    | FixRecord
)
"""What is a row of a table of its own."""
Telemetry = RobotReport | RawFrame | FixRecord
"""What the writer takes in batches."""
RAW_SENSOR = "ADC"
"""Unit of a tag's sensor value that was not converted."""
_ROBOTS: Final = cast("Table", Robot.__table__)
_KEYS: Final = select(_ROBOTS.c.id, _ROBOTS.c.key)
"""Made once, and no statement of the ORM: each batch asks it."""


def append_telemetry(session: Session, values: Sequence[Telemetry]) -> None:
    """Insert decoded values; a value that is already there (sent twice) changes nothing.

    Raises:
        UnknownIdError: If a value names a robot that the station does not know.
    """
    keys = {row.id: row.key for row in session.execute(_KEYS)}
    samples: list[NewSample] = []
    readings: list[NewReading] = []
    rows: dict[type[Base], list[dict[str, Any]]] = {}
    for value in values:
        key = None if value.robot is None else keys.get(value.robot)
        if value.robot is not None and key is None:
            raise UnknownIdError("robot", value.robot)
        match value:
            case Sample():
                samples.append(_new_sample(value, keys[value.robot]))
            case Reading():
                readings.append(
                    NewReading(keys[value.robot], value.channel, value.measured_at, value.value)
                )
            case _:
                table, row = _row(value)
                rows.setdefault(table, []).append(row if key is None else row | {"robot_key": key})
    for table, batch in rows.items():
        insert_new(session, table, batch)
        if table is StateRow:
            times = [row["measured_at"] for row in batch]
            sum_up_late(session, [row["robot_key"] for row in batch], times)
    if samples:
        insert_samples(session, samples)
    if readings:
        insert_readings(session, readings)


def insert_new(session: Session, table: type[Base], rows: list[dict[str, Any]]) -> int:
    """Insert rows, skip those whose key is taken, and return how many were new."""
    done = session.execute(
        upsert(session, table).on_conflict_do_nothing(),
        rows,
        execution_options={"preserve_rowcount": True},
    )
    return cast("CursorResult[Any]", done).rowcount


def _row(value: _Row) -> tuple[type[Base], dict[str, Any]]:
    match value:
        case StateReport():
            return StateRow, _state_row(value)
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
        case PlanQueue():
            row = asdict(value)
            del row["robot"]
            return PlanQueueRow, row
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
        case Detection():
            return DetectionRow, _detection_row(value)
        case ReceiverReport():
            row = asdict(value)
            del row["robot"]
            return ReceiverReportRow, row
        case FixRecord():
            return CameraFixRow, fix_columns(value)
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
    if math.isnan(sum(row.values())):
        row = {key: None if math.isnan(value) else value for key, value in row.items()}
    row["measured_at"] = report.measured_at
    row["received_at"] = report.received_at
    row["has_fix"] = report.has_fix
    row["is_by_cameras"] = report.is_by_cameras
    row["mode"] = int(report.mode)
    return row


def _new_sample(sample: Sample, robot_key: int) -> NewSample:
    return NewSample(
        robot_key,
        sample.log,
        sample.sequence,
        sample.variable,
        sample.measured_at,
        sample.received_at,
        sample.value,
        sample.position_ned,
        sample.position_std_m,
    )


def _detection_row(detection: Detection) -> dict[str, Any]:
    north_m, east_m, depth_m = detection.position_ned
    return {
        "receiver": receiver_name(detection.receiver),
        "tag": detection.tag,
        "measured_at": detection.measured_at,
        "received_at": detection.received_at,
        "sensor": detection.sensor,
        "sensor_unit": None if detection.sensor is None else RAW_SENSOR,
        "north_m": north_m,
        "east_m": east_m,
        "depth_m": depth_m,
        "position_std_m": detection.position_std_m,
    }


def receiver_name(serial: int) -> str:
    """Return a receiver on board as exports of VUE name it."""
    return f"VR2C-{serial}"


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
