"""What the instruments of simulated robots meet: layers, fronts and patches of every channel.

The planned fields of tank and lake are those that maps are scored with
(``autonomy.field.synthetic``); all others are here. A water is warm and light above a thermocline,
which is also its halocline; a front leans across it, with another water on its far side; patches
drift nowhere. The layers are those of a summer's day: they do not move the robot, whose ballast
meets ``simulator.conditions``.

Source:
    Solubility of oxygen: Garcia and Gordon, Oxygen solubility in seawater, Limnology and
    Oceanography 37 (1992), coefficients of Benson and Krause. Conductivity and pressure: TEOS-10.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.channel import CHANNELS
from autonomy.field.synthetic import truth
from autonomy.site import Site

PLANNED = ("blue_light", "chlorophyll")
"""Channels whose fields maps are scored with."""

_SOLUBILITY = (3.80369, -9.86643e-2, 5.10006, 4.17887, 3.20291, 5.80871)
_SOLUBILITY_SALT = (-9.51519e-3, -1.13864e-2, -7.70028e-3, -7.01577e-3)
_SOLUBILITY_SALT_2 = -2.75915e-7
_GRAMS_PER_UMOL = 31.9988e-6
_PATCHES = ((-0.22, 0.18, 0.14, 1.0), (0.22, -0.2, 0.1, 0.7), (0.05, 0.3, 0.08, 0.5))
"""North, east and size as shares of the water's size, and height."""
_FRONT_WIDTH = 0.04


@dataclass(frozen=True, slots=True)
class _Kind:
    """A kind of water: pairs are values at the surface and in the deep."""

    layer_share: float
    """Depth of the thermocline as a share of the greatest depth."""
    layer_max_m: float
    temperature_c: tuple[float, float]
    salinity: tuple[float, float]
    oxygen_percent: tuple[float, float]
    nitrate: tuple[float, float]
    front: tuple[float, float]
    """How much warmer and saltier the surface is beyond the front."""
    attenuation_per_m: float
    """Of light, in clear water."""
    turbidity: float
    cdom: float
    algae: float
    """Blue-green algae in the thickest patch, ug/L."""
    daylight: float
    """At the surface, umol/(m2 s)."""


_KINDS = {
    "tank": _Kind(
        layer_share=0.5,
        layer_max_m=0.6,
        temperature_c=(21.0, 20.2),
        salinity=(0.25, 0.25),
        oxygen_percent=(97.0, 94.0),
        nitrate=(10.0, 10.0),
        front=(0.2, 0.0),
        attenuation_per_m=0.3,
        turbidity=0.4,
        cdom=2.0,
        algae=0.3,
        daylight=12.0,
    ),
    "lake": _Kind(
        layer_share=0.36,
        layer_max_m=12.0,
        temperature_c=(22.5, 9.5),
        salinity=(0.24, 0.31),
        oxygen_percent=(106.0, 18.0),
        nitrate=(4.0, 35.0),
        front=(1.2, 0.04),
        attenuation_per_m=0.35,
        turbidity=2.0,
        cdom=12.0,
        algae=18.0,
        daylight=1500.0,
    ),
    "sea": _Kind(
        layer_share=0.35,
        layer_max_m=30.0,
        temperature_c=(17.5, 8.0),
        salinity=(31.5, 34.4),
        oxygen_percent=(104.0, 62.0),
        nitrate=(1.0, 22.0),
        front=(1.8, 1.1),
        attenuation_per_m=0.12,
        turbidity=0.8,
        cdom=3.0,
        algae=2.0,
        daylight=1700.0,
    ),
}


class WaterField:
    """Every channel of one water, known everywhere and always.

    Args:
        site: The water.
    """

    def __init__(self, site: Site) -> None:
        self._site = site
        self._kind = _KINDS[site.kind]
        share_m = self._kind.layer_share * site.water.depth_max_m
        self.layer_m = min(share_m, self._kind.layer_max_m)
        """Depth of the thermocline, about: it is tilted."""

    def truth(self, channel: str, points: FloatArray) -> FloatArray:
        """Return a channel without noise, in its unit; a team's own is patches around 1.

        Args:
            channel: Its key.
            points: Positions in the site's NED frame, shape ``(n, 3)``, m.

        Returns:
            Values, shape ``(n,)``.
        """
        return self.truths((channel,), points)[channel]

    def truths(self, channels: Iterable[str], points: FloatArray) -> dict[str, FloatArray]:
        """Return several channels without noise at the same points, each as ``truth`` does."""
        places = np.asarray(points, dtype=np.float64).reshape(-1, 3)
        here = _Here(self._site, self._kind, self.layer_m, places)
        return {channel: _value(channel, here, places) for channel in channels}


class _Here:
    """What makes the channels at some points: place in the water, layers, front and patches."""

    def __init__(self, site: Site, kind: _Kind, layer_m: float, points: FloatArray) -> None:
        box = site.water
        x, y, z = points.T
        self.site, self.kind = site, kind
        self.x, self.y, self.z = x, y, np.maximum(z, 0.0)
        # u and v run from -0.5 to 0.5 over the water
        u = (x - box.x_min_m) / (box.x_max_m - box.x_min_m) - 0.5
        v = (y - box.y_min_m) / (box.y_max_m - box.y_min_m) - 0.5
        self.layer_m = layer_m
        tilted_m = layer_m * (1.0 + 0.12 * np.sin(2.0 * np.pi * (u + 0.2)) + 0.15 * v)
        self.upper = 0.5 * (1.0 - np.tanh((self.z - tilted_m) / (0.2 * layer_m)))
        """1 above the thermocline, 0 below it."""
        along = u + 0.35 * v + 0.04 * np.sin(3.0 * np.pi * v) - 0.1
        self.beyond = 0.5 * (1.0 + np.tanh(along / _FRONT_WIDTH))
        """0 on the near side of the front, 1 on the far side."""
        patches = np.zeros_like(x)
        for north, east, size, height in _PATCHES:
            patches += height * np.exp(-0.5 * ((u - north) ** 2 + (v - east) ** 2) / size**2)
        self.patches = patches

    def layered(self, ends: tuple[float, float]) -> FloatArray:
        """Return what is one value above the thermocline and another below."""
        surface, deep = ends
        return deep + (surface - deep) * self.upper


def _temperature(here: _Here) -> FloatArray:
    warmer = here.kind.front[0] * (here.beyond - 0.5) + 0.3 * here.patches
    return here.layered(here.kind.temperature_c) + warmer * here.upper


def _salinity(here: _Here) -> FloatArray:
    return here.layered(here.kind.salinity) + here.kind.front[1] * here.beyond * here.upper


def _pressure(here: _Here) -> FloatArray:
    import gsw

    return np.asarray(gsw.p_from_z(-here.z, here.site.origin_latitude_deg), dtype=np.float64)


def _conductivity(here: _Here) -> FloatArray:
    import gsw

    found = gsw.C_from_SP(_salinity(here), _temperature(here), _pressure(here))
    return np.asarray(found, dtype=np.float64)


def _oxygen_percent(here: _Here) -> FloatArray:
    """Algae breathe out by day; the best of it lies just above the thermocline."""
    made = 6.0 * here.patches * here.upper
    return here.layered(here.kind.oxygen_percent) + made - 5.0 * here.beyond * here.upper


def oxygen_solubility(temperature_c: FloatArray, salinity: FloatArray) -> FloatArray:
    """Return the oxygen that water holds in balance with moist air at one atmosphere, mg/L.

    The density is taken as that of fresh water of 4 degrees plus 0.77 kg/m3 for each unit of
    salinity, within 0.6 percent of the true one to 25 degrees.
    """
    scaled = np.log((298.15 - temperature_c) / (273.15 + temperature_c))
    log_umol_kg = (
        np.polyval(_SOLUBILITY, scaled)
        + salinity * np.polyval(_SOLUBILITY_SALT, scaled)
        + _SOLUBILITY_SALT_2 * salinity**2
    )
    kg_per_l = 1.0 + 0.77e-3 * salinity
    return 1e3 * _GRAMS_PER_UMOL * np.exp(log_umol_kg) * kg_per_l


def _oxygen(here: _Here) -> FloatArray:
    return 0.01 * _oxygen_percent(here) * oxygen_solubility(_temperature(here), _salinity(here))


def _light(here: _Here) -> FloatArray:
    attenuation = here.kind.attenuation_per_m * (1.0 + 0.5 * here.patches)
    return here.kind.daylight * np.exp(-attenuation * here.z)


def _algae(here: _Here) -> FloatArray:
    """They float up: most of them are near the surface."""
    return here.kind.algae * (0.03 + here.patches * np.exp(-here.z / (0.4 * here.layer_m)))


def _turbidity(here: _Here) -> FloatArray:
    """A plume beyond the front, algae, and mud above the floor."""
    floor_m = np.asarray(here.site.floor_m(here.x, here.y), dtype=np.float64)
    mud = np.exp(-np.maximum(floor_m - here.z, 0.0) / (0.15 * here.layer_m))
    plume = 1.5 * here.beyond * here.upper
    return here.kind.turbidity * (1.0 + plume + 0.4 * here.patches * here.upper + 2.0 * mud)


def _cdom(here: _Here) -> FloatArray:
    return here.kind.cdom * (1.0 + 0.8 * here.beyond * here.upper)


def _ph(here: _Here) -> FloatArray:
    return 7.1 + 0.011 * _oxygen_percent(here)


def _sound_level(here: _Here) -> FloatArray:
    return 105.0 - 6.0 * here.z / (here.z + here.layer_m)


def _own(here: _Here) -> FloatArray:
    return 0.5 + 0.5 * here.upper + here.patches


_CHANNELS: Mapping[str, Callable[[_Here], FloatArray]] = {
    "temperature": _temperature,
    "salinity": _salinity,
    "pressure": _pressure,
    "conductivity": _conductivity,
    "dissolved_oxygen": _oxygen,
    "oxygen_saturation": _oxygen_percent,
    "par": _light,
    "blue_green_algae": _algae,
    "turbidity": _turbidity,
    "backscatter": lambda here: 0.0015 * _turbidity(here),
    "cdom": _cdom,
    "ph": _ph,
    "nitrate": lambda here: here.layered(here.kind.nitrate),
    "sound_level": _sound_level,
    "water_depth": lambda here: np.asarray(here.site.floor_m(here.x, here.y), dtype=np.float64),
}


def _value(channel: str, here: _Here, places: FloatArray) -> FloatArray:
    if channel in PLANNED:
        return truth(channel, places)
    value = _CHANNELS.get(channel, _own)(here)
    declared = CHANNELS.get(channel)
    return value if declared is None else value.clip(declared.low, declared.high)
