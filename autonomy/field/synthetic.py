"""Fields that are known everywhere: what the simulated robots measure, and maps are scored with."""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.channel import CHANNELS
from autonomy.field.scale import from_model, to_model

LARGEST_COUNT = 4095.0
"""Full scale of the light sensor's 12-bit converter."""


def truth(variable_key: str, points: FloatArray) -> FloatArray:
    """Return the field without noise, in the variable's unit.

    Args:
        variable_key: "blue_light" (counts, in the tank) or "chlorophyll" (ug/L, in the lake).
        points: Positions in the site's NED frame, shape ``(n, 3)``, m.

    Returns:
        Values, shape ``(n,)``.

    Raises:
        ValueError: If no synthetic field exists for the variable.
    """
    x, y, z = np.asarray(points, dtype=np.float64).reshape(-1, 3).T
    if variable_key == "blue_light":
        return _tank_blue_light(x, y, z)
    if variable_key == "chlorophyll":
        return _lake_chlorophyll(x, y, z)
    raise ValueError(f"there is no synthetic field of {variable_key}")


def measurement_noise(variable_key: str) -> float:
    """Return the standard deviation of one measurement, in the model's scale.

    Raises:
        ValueError: If no synthetic field exists for the variable.
    """
    noise = {"blue_light": 0.05, "chlorophyll": 0.3}
    if variable_key not in noise:
        raise ValueError(f"there is no synthetic field of {variable_key}")
    return noise[variable_key]


def measure(variable_key: str, points: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return noisy measurements of the field, in the variable's unit, shape ``(n,)``."""
    channel = CHANNELS[variable_key]
    scale = channel.scale
    exact = to_model(scale, truth(variable_key, points), channel.log_floor)
    noise = measurement_noise(variable_key) * rng.standard_normal(exact.shape)
    noisy = from_model(scale, exact + noise)
    return np.minimum(noisy, LARGEST_COUNT) if variable_key == "blue_light" else noisy


def _tank_blue_light(x: FloatArray, y: FloatArray, z: FloatArray) -> FloatArray:
    """Two lamps in dim daylight: inverse-square with attenuation, blunted at the lamp."""
    counts = 30.0 * np.exp(-1.2 * z)
    lamps = ((0.62, 0.48, 0.50, 60.0, 0.22), (2.02, 0.92, 0.28, 85.0, 0.26))
    for lamp_x, lamp_y, lamp_z, intensity, radius in lamps:
        squared = (x - lamp_x) ** 2 + (y - lamp_y) ** 2 + (z - lamp_z) ** 2
        counts = counts + intensity * np.exp(-1.1 * np.sqrt(squared)) / (squared + radius**2)
    return np.minimum(counts, LARGEST_COUNT)


def _lake_chlorophyll(x: FloatArray, y: FloatArray, z: FloatArray) -> FloatArray:
    """A tilted, patchy deep maximum and two blooms at the surface; little light below 14 m."""
    layer_z = 6.0 + 2.0 * np.sin(2 * np.pi * x / 700.0) + 0.004 * y
    patches = 0.6 + 0.4 * np.cos(2 * np.pi * (x + 0.6 * y) / 420.0)
    value = 1.2 + 6.5 * np.exp(-0.5 * ((z - layer_z) / 2.2) ** 2) * patches
    for bloom_x, bloom_y, size, height in ((140.0, 340.0, 70.0, 9.0), (360.0, 150.0, 50.0, 6.0)):
        squared = ((x - bloom_x) / size) ** 2 + ((y - bloom_y) / (1.3 * size)) ** 2
        value = value + height * np.exp(-0.5 * squared) * np.exp(-z / 3.5)
    return value * np.exp(-np.maximum(z - 14.0, 0.0) / 3.0)
