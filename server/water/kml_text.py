"""The few words of KML 2.2 that files of the station are made of."""

from collections.abc import Iterable, Mapping
from xml.sax.saxutils import escape

BEGIN = (
    '<?xml version="1.0" encoding="UTF-8"?>\n<kml xmlns="http://www.opengis.net/kml/2.2"><Document>'
)
END = "</Document></kml>\n"
MEDIA_TYPE = "application/vnd.google-earth.kml+xml"


def coordinates(
    places: Iterable[tuple[float, float, float]], degree_decimals: int, metre_decimals: int
) -> str:
    """Return places, each longitude, latitude and height (negative under water), as KML's text."""
    return " ".join(
        f"{longitude:.{degree_decimals}f},{latitude:.{degree_decimals}f},"
        f"{height:.{metre_decimals}f}"
        for longitude, latitude, height in places
    )


def line(name: str, places: str, words: Mapping[str, str] | None = None) -> str:
    """Return a placemark of a line whose heights count, with what else is said of it."""
    return (
        f"<Placemark><name>{escape(name)}</name>{_data(words or {})}"
        "<LineString><altitudeMode>absolute</altitudeMode>"
        f"<coordinates>{places}</coordinates></LineString></Placemark>"
    )


def area(name: str, role: str, places: str) -> str:
    """Return a placemark of an area at the surface, with what it is for."""
    return (
        f"<Placemark><name>{escape(name)}</name>"
        f"{_data({'role': role})}"
        "<Polygon><outerBoundaryIs><LinearRing>"
        f"<coordinates>{places}</coordinates>"
        "</LinearRing></outerBoundaryIs></Polygon></Placemark>"
    )


def _data(words: Mapping[str, str]) -> str:
    data = "".join(
        f'<Data name="{key}"><value>{escape(value)}</value></Data>' for key, value in words.items()
    )
    return f"<ExtendedData>{data}</ExtendedData>" if data else ""
