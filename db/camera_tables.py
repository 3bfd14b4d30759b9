"""Tables of cameras, of the tags that they look for, of their calibrations, and of their fixes."""

from datetime import datetime

from sqlalchemy import ForeignKey
from sqlalchemy.orm import Mapped, mapped_column

from db.tables import APPENDED_ONLY, CLUSTERED, Base, Document, Key


class CameraRow(Base):
    """A camera that the station looks through."""

    __tablename__ = "camera"
    __table_args__ = APPENDED_ONLY

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    id: Mapped[str] = mapped_column(unique=True)
    """One that was removed leaves its id to another, which has nothing of its calibrations."""
    uri: Mapped[str]
    latency_s: Mapped[float | None]
    """None where nobody measured it: then the usual one of its kind of source."""
    latency_std_s: Mapped[float | None]
    lens_key: Mapped[int | None] = mapped_column(ForeignKey("camera_calibration.key"))
    """The calibration of its lens that is in use."""
    version: Mapped[int]
    created_at: Mapped[datetime]
    created_by: Mapped[str]
    changed_at: Mapped[datetime]


class TagSetRow(Base):
    """Fixed tags of the tank and tags of robots, as they were from some moment on.

    The newest is in use.
    """

    __tablename__ = "tag_set"
    __table_args__ = APPENDED_ONLY

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    layout: Mapped[Document]
    """``{"tags": [...]}``; see ``autonomy.vision.tag``."""
    bundles: Mapped[Document]
    """``{"bundles": [{"robot": ..., "tags": [...]}, ...]}``."""
    at: Mapped[datetime]
    by: Mapped[str]


class CameraCalibrationRow(Base):
    """What a calibration found, and of what; never changed."""

    __tablename__ = "camera_calibration"
    __table_args__ = APPENDED_ONLY

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    kind: Mapped[str]
    """``lens`` of one camera, or ``rig`` of all that hang over the tank."""
    camera_key: Mapped[int | None] = mapped_column(Key)
    """Of a lens: whose. Its row may be gone."""
    tag_set_key: Mapped[int | None] = mapped_column(ForeignKey("tag_set.key"))
    """Of a rig: the tags that it rests on."""
    result: Mapped[Document]
    covariance: Mapped[bytes]
    """Square matrix of little-endian doubles, row by row."""
    inputs: Mapped[Document]
    at: Mapped[datetime]
    by: Mapped[str]


class CameraFixRow(Base):
    """Where cameras found a robot, taken or refused; see ``robot_link.camera.fix``."""

    __tablename__ = "camera_fix"
    __table_args__ = CLUSTERED

    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"), primary_key=True)
    measured_at: Mapped[datetime] = mapped_column(primary_key=True)
    received_at: Mapped[datetime]
    north_m: Mapped[float]
    east_m: Mapped[float]
    depth_m: Mapped[float]
    covariance_m2: Mapped[list[float]]
    """xx, xy, xz, yy, yz, zz."""
    considered_covariance_m2: Mapped[list[float]]
    heading_rad: Mapped[float | None]
    heading_std_rad: Mapped[float]
    roll_rad: Mapped[float | None]
    pitch_rad: Mapped[float | None]
    tilt_std_rad: Mapped[float]
    cameras: Mapped[list[str]]
    tags: Mapped[list[int]]
    rms: Mapped[float]
    quality: Mapped[str]
    reason: Mapped[str]
    calibration_key: Mapped[int | None] = mapped_column(ForeignKey("camera_calibration.key"))
    sent_at: Mapped[datetime | None]
    """When it was sent to the robot; None where it was not."""
