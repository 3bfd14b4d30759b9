"""What follows of conductivity, temperature and pressure, by TEOS-10 (the library ``gsw``).

``gsw`` is imported where it is used: it takes seconds and memory that a station without such
sensors need not spend.

Source:
    IOC, SCOR and IAPSO, The international thermodynamic equation of seawater 2010.
"""

from collections.abc import Mapping

import numpy as np

from autonomy.arrays import FloatArray

DERIVED = ("salinity", "absolute_salinity", "density", "sound_speed", "buoyancy_frequency_squared")
"""Keys of the channels that can be computed."""
MEASURED = frozenset(("conductivity", "temperature", "pressure", "salinity"))
"""Keys of the channels that they are computed of."""
_LEAST_STEP_DBAR = 0.2
"""Samples nearer to each other in pressure tell nothing of how the water is layered."""


def can_derive(key: str, told: "Mapping[str, object] | set[str]") -> bool:
    """Tell whether a channel can be computed from those that are told.

    Pressure is not needed: depth takes its place.
    """
    if key not in DERIVED or key in told:
        return False
    has_salt = "conductivity" in told or (key != "salinity" and "salinity" in told)
    return has_salt and "temperature" in told


def derived(
    key: str,
    told: Mapping[str, FloatArray],
    depth_m: FloatArray,
    latitude_deg: float,
    longitude_deg: float,
) -> FloatArray:
    """Return a derived channel at places of one water, in the catalogue's unit.

    Args:
        key: One of ``DERIVED``.
        told: ``temperature`` (degC) and ``salinity`` (practical) or ``conductivity`` (mS/cm), and
            ``pressure`` (dbar) where that is told, each of shape ``(n,)``, in order of time.
        depth_m: Where the measurements were taken, shape ``(n,)``; in place of a pressure.
        latitude_deg: Of the water.
        longitude_deg: Of the water.

    Returns:
        Values, shape ``(n,)``; NaN where nothing can be told. The squared buoyancy frequency
        stands at the later of the two samples that it lies between, s-2.

    Raises:
        ValueError: If the channel cannot be computed from what is told.
    """
    if not can_derive(key, set(told) - {key}):
        raise ValueError(f"{key} cannot be computed from {', '.join(told) or 'nothing'}")
    import gsw

    temperature = told["temperature"]
    pressure = told.get("pressure")
    if pressure is None:
        pressure = np.asarray(gsw.p_from_z(-np.maximum(depth_m, 0.0), latitude_deg))
    practical = None if key == "salinity" else told.get("salinity")
    if practical is None:
        practical = gsw.SP_from_C(told["conductivity"], temperature, pressure)
    if key == "salinity":
        return np.asarray(practical)
    absolute = gsw.SA_from_SP(practical, pressure, longitude_deg, latitude_deg)
    if key == "absolute_salinity":
        return np.asarray(absolute)
    conservative = gsw.CT_from_t(absolute, temperature, pressure)
    if key == "density":
        return np.asarray(gsw.rho(absolute, conservative, pressure))
    if key == "sound_speed":
        return np.asarray(gsw.sound_speed(absolute, conservative, pressure))
    squared = np.full(len(temperature), np.nan)
    if len(temperature) > 1:
        with np.errstate(divide="ignore", invalid="ignore"):  # of samples at one pressure
            found, _ = gsw.Nsquared(absolute, conservative, pressure, latitude_deg)
        squared[1:] = np.where(np.abs(np.diff(pressure)) >= _LEAST_STEP_DBAR, found, np.nan)
    return squared


def conservative_temperature(
    absolute_salinity: FloatArray,
    temperature: FloatArray,
    depth_m: FloatArray,
    latitude_deg: float,
) -> FloatArray:
    """Return the conservative temperature, degC, shape ``(n,)``.

    Args:
        absolute_salinity: g/kg, shape ``(n,)``.
        temperature: In place, degC, shape ``(n,)``.
        depth_m: Where it was measured, shape ``(n,)``.
        latitude_deg: Of the water.
    """
    import gsw

    pressure = gsw.p_from_z(-np.maximum(depth_m, 0.0), latitude_deg)
    return np.asarray(gsw.CT_from_t(absolute_salinity, temperature, pressure))


def sigma0(absolute_salinity: FloatArray, conservative: FloatArray) -> FloatArray:
    """Return the potential density anomaly referred to the surface, kg/m3 less 1000.

    Args:
        absolute_salinity: g/kg.
        conservative: Conservative temperature, degC, of the same shape, or one that fits it.
    """
    import gsw

    return np.asarray(gsw.sigma0(absolute_salinity, conservative))
