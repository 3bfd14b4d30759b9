"""Fixes by cameras as tests draw them."""

from datetime import UTC, datetime

from robot_link.camera.fix import CameraFix
from tests.robot_link.rig import MINI

AT = datetime(2026, 11, 22, 15, 4, 5, 123000, tzinfo=UTC)
FIX = CameraFix(
    robot=MINI,
    measured_at=AT,
    ned_m=(1.402, 0.713, 0.482),
    covariance_m2=(1.4e-6, 2e-7, 0.0, 1.5e-6, 0.0, 1.7e-6),
    considered_covariance_m2=(1.1e-6, 1e-7, 0.0, 1.2e-6, 0.0, 1.3e-6),
    heading_rad=0.801,
    heading_std_rad=0.004,
    roll_rad=0.03,
    pitch_rad=-0.35,
    tilt_std_rad=0.011,
    cameras=("tank-1", "tank-2"),
    tags=(0, 2),
    rms=1.2,
    quality="good",
    reason="",
    calibration=1,
)
