"""What a camera's picture is drawn from: the tank as it truly is, its light and its cameras.

All of this is truth that never leaves the simulator; what a laboratory would have measured of it is
``simulator.camera.laboratory``.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.site import TANK, Box
from autonomy.vision.camera import Camera
from autonomy.vision.refraction import FRESH_WATER_INDEX
from autonomy.vision.rigid import Pose, rotation_of
from autonomy.vision.tag import Bundle, Layout
from simulator.camera import trace_kernel as kernel

_RIPPLES = 8
_WAVELENGTHS_M = (0.35, 0.9)
_GRAVITY_M_S2, _TENSION_M3_S2 = 9.81, 7.3e-5
"""Gravity, and surface tension over density of water."""


@dataclass(frozen=True, slots=True)
class Lighting:
    """Light in the tank, and what water does to it; 1 is the light in the tank's middle."""

    brightness: float = 1.0
    """0 is darkness."""
    gradient_ne_per_m: tuple[float, float] = (0.05, -0.06)
    """By how much the light grows northwards and eastwards."""
    caustics_std: float = 0.15
    """Relative, deeper than 0.3 m; their mean is 1 everywhere."""
    caustics_m_s: float = 0.12
    """How fast the net moves."""
    haze_per_m: float = 0.12
    """Part of the light that is lost along a way under water."""
    haze_light: float = 0.12
    """What an endless way under water looks like."""
    lamp_ned_m: tuple[float, float, float] = (1.4, -2.6, -3.0)
    glare: float = 0.35
    """Light of the lamp's image in the surface."""
    glare_width: float = 0.02
    """Slopes of the surface, up to which it mirrors the lamp; a ripple's come on top."""


@dataclass(frozen=True, slots=True)
class Sensor:
    """What is between the light and the bytes."""

    blur_px: float = 0.8
    """Standard deviation of the lens's blur."""
    exposure_s: float = 0.008
    shot_variance: float = 5e-4
    """Variance of the light by light: photons are counted, and noise grows as their root."""
    read_std: float = 0.002
    """Noise of the reading, in light."""
    gamma: float = 2.2
    jpeg_quality: int = 80

    def __post_init__(self) -> None:
        if not 0.0 <= self.blur_px <= 5.0:
            raise ValueError(f"sensor: blur_px is {self.blur_px}, not 0 to 5")
        if not 0.0 <= self.exposure_s <= 0.2:
            raise ValueError(f"sensor: exposure_s is {self.exposure_s}, not 0 to 0.2")
        if not 1 <= self.jpeg_quality <= 100:
            raise ValueError(f"sensor: jpeg_quality is {self.jpeg_quality}, not 1 to 100")


@dataclass(frozen=True, slots=True)
class Shades:
    """Parts of the light that things send back."""

    white: float = 0.75
    black: float = 0.04
    back: float = 0.30
    """Of a plate."""
    hull: float = 0.06
    floor: float = 0.28
    wall: float = 0.22
    rim: float = 0.35
    ground: float = 0.10


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A tank with cameras over it, tags in it, and robots of which only the tags are told here.

    Raises:
        ValueError: If the water cannot be drawn: its level is none of the tank, or it has slopes
            that no ripples have.
    """

    cameras: tuple[Camera, ...]
    """As they truly are."""
    layout: Layout
    """The fixed tags where they truly are."""
    bundles: tuple[Bundle, ...] = ()
    """The robots' tags as they are truly glued on."""
    water: Box = TANK.water
    level_m: float = 0.0
    """Down coordinate of the mean surface."""
    index: float = FRESH_WATER_INDEX
    ripple_slope_rad: float = 0.0
    """Root mean square slope of the surface along each axis."""
    rim_m: float = 0.10
    """Height of the tank's rim above the nominal level."""
    lighting: Lighting = field(default_factory=Lighting)
    sensor: Sensor = field(default_factory=Sensor)
    shades: Shades = field(default_factory=Shades)
    seed: int = 0

    def __post_init__(self) -> None:
        if not -self.rim_m < self.level_m < self.water.depth_max_m:
            raise ValueError(
                f"level_m: {self.level_m} is not between rim and floor,"
                f" {-self.rim_m} to {self.water.depth_max_m}"
            )
        if not 0.0 <= self.ripple_slope_rad <= 0.1:
            raise ValueError(f"ripple_slope_rad: {self.ripple_slope_rad} is not 0 to 0.1")

    def camera(self, name: str) -> Camera:
        """Return a camera.

        Raises:
            KeyError: If there is none of this name.
        """
        for camera in self.cameras:
            if camera.name == name:
                return camera
        raise KeyError(name)

    @property
    def world(self) -> FloatArray:
        """Water, light and shades for the kernels (``trace_kernel``), shape ``(25,)``."""
        box, light, shades = self.water, self.lighting, self.shades
        width = math.hypot(light.glare_width, self.ripple_slope_rad)
        glare = light.glare * (light.glare_width / width) ** 2
        return np.array(
            [
                *(box.x_min_m, box.x_max_m, box.y_min_m, box.y_max_m, box.depth_max_m),
                *(self.level_m, self.rim_m, 0.15, 1.0 / self.index),
                *(*light.gradient_ne_per_m, light.haze_per_m, light.haze_light),
                *(*light.lamp_ned_m, glare, width),
                *(shades.floor, shades.wall, shades.rim, shades.ground),
                *(shades.white, shades.black, shades.back),
            ]
        )

    def waves(self, time_s: float) -> FloatArray:
        """Return the ripples of a moment, shape ``(8, 5)``, ``(0, 5)`` where it is calm.

        The surface is flat with a slope: waves of drawn lengths and phases from all sides, as fast
        as gravity and surface tension let them.
        """
        if self.ripple_slope_rad == 0.0:
            return np.zeros((0, 5))
        rng = np.random.default_rng([self.seed, 8])
        waves = np.zeros((_RIPPLES, 5))
        towards = rng.uniform(0.0, 2.0 * np.pi) + 2.0 * np.pi * np.arange(_RIPPLES) / _RIPPLES
        k = 2.0 * np.pi / rng.uniform(*_WAVELENGTHS_M, _RIPPLES)
        omega = np.sqrt(_GRAVITY_M_S2 * k + _TENSION_M3_S2 * k**3)
        phase = rng.uniform(0.0, 2.0 * np.pi, _RIPPLES)
        each = self.ripple_slope_rad * math.sqrt(4.0 / _RIPPLES)
        waves[:, kernel.WAVE_NORTH] = k * np.cos(towards)
        waves[:, kernel.WAVE_EAST] = k * np.sin(towards)
        waves[:, kernel.WAVE_PHASE] = phase - omega * time_s
        waves[:, kernel.SLOPE_NORTH] = each * np.cos(towards)
        waves[:, kernel.SLOPE_EAST] = each * np.sin(towards)
        return waves


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Where a body is at a time, and how it moves then."""

    pose: Pose
    """Takes body axes into NED."""
    velocity_ned_m_s: FloatArray = field(default_factory=lambda: np.zeros(3))
    turn_rad_s: FloatArray = field(default_factory=lambda: np.zeros(3))
    """About the body's own axes."""

    def after(self, seconds: float) -> Pose:
        """Return the pose so much later."""
        return Pose(
            self.pose.rotation @ rotation_of(self.turn_rad_s * seconds),
            self.pose.position_m + self.velocity_ned_m_s * seconds,
        )
