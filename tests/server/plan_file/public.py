"""The situations of public plan files, rebuilt from their coordinates, which are facts.

Each maker writes a file of its own with the numbers of the one that it names: same commands, same
places, same altitudes, same traps.
"""

import json
from collections.abc import Iterable, Sequence
from typing import Any

Pair = tuple[float, float]


def wpl(rows: Iterable[Sequence[float | int]], between: str = "") -> bytes:
    """Return a WPL file of rows (frame, command, p1..p4, latitude, longitude, altitude)."""
    lines = ["\t".join([str(number), "0", *map(str, row), "1"]) for number, row in enumerate(rows)]
    return ("QGC WPL 110\n" + between + ("\n" + between).join(lines) + "\n").encode()


def flown(frame: int, latitude: float, longitude: float, altitude: float, command: int = 16):
    return (frame, command, 0.0, 0.0, 0.0, 0.0, latitude, longitude, altitude)


def dive_mission() -> bytes:
    """ArduPilot/ardupilot, Tools/autotest/ArduSub_Tests/DiveMission/sub_mission.txt."""
    return wpl(
        [
            flown(0, -35.363262, 149.165237, 583.969971),
            flown(3, 33.809780, -118.393982, -50.0),
            flown(3, 33.809780, -118.394432, -50.0),
            flown(3, 33.810310, -118.394432, -50.0),
            flown(3, 33.810310, -118.395020, -25.0, 18),
            flown(3, 33.811207, -118.393036, -25.0, 21),
        ]
    )


def terrain_mission() -> bytes:
    """ArduPilot/ardupilot, Tools/autotest/ArduSub_Tests/TerrainMission/terrain_mission.txt."""
    return wpl(
        [
            flown(3, 33.809780, -118.393982, 0.0),
            flown(3, 33.809780, -118.393982, -25.0),
            flown(10, 33.809780, -118.394432, -25.0),
            flown(10, 33.810310, -118.394432, 10.0),
            flown(10, 33.810310, -118.393982, 15.0),
        ],
        between="\n# an item\n",
    )


def simple_item(
    number: int, command: int, frame: int, *params: float | None, **more: Any
) -> dict[str, Any]:
    return {
        "type": "SimpleItem",
        "command": command,
        "frame": frame,
        "params": list(params),
        "autoContinue": True,
        "doJumpId": number,
        **more,
    }


def waypoint(number: int, latitude: float, longitude: float, altitude: float | None, **more: Any):
    place = (0, 0, 0, None, latitude, longitude, altitude)
    return simple_item(number, 16, 3, *place, Altitude=altitude, AltitudeMode=1, **more)


def plan(
    items: Sequence[Any] = (),
    polygons: Sequence[Any] = (),
    circles: Sequence[Any] = (),
    points: Sequence[Any] = (),
    home: Sequence[float] | None = None,
    rally_version: int = 2,
    **more: Any,
) -> bytes:
    document = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "mission": {
            "version": 2,
            "cruiseSpeed": 15,
            "hoverSpeed": 5,
            "firmwareType": 12,
            "vehicleType": 2,
            "items": list(items),
            "plannedHomePosition": home,
        },
        "geoFence": {"version": 2, "circles": list(circles), "polygons": list(polygons)},
        "rallyPoints": {"version": rally_version, "points": list(points)},
        **more,
    }
    return json.dumps(document).encode()


def fence(corners: Sequence[Pair], *, is_inside: bool = True) -> dict[str, Any]:
    return {"inclusion": is_inside, "polygon": [list(at) for at in corners], "version": 1}


CANBERRA = (
    (-35.36001036, 149.16537679),
    (-35.35789911, 149.16762139),
    (-35.35652005, 149.16443406),
    (-35.35671532, 149.15541078),
    (-35.35804555, 149.15351036),
    (-35.35946119, 149.15657797),
    (-35.35963204, 149.16123177),
    (-35.36130393, 149.16235407),
)


def canberra() -> bytes:
    """mavlink/mavros, mavros/test/mavros_py/testdata/simple.plan."""
    items = [simple_item(1, 22, 3, 15, 0, 0, None, 0, 0, 50, Altitude=50, AltitudeMode=1)]
    items += [waypoint(number, *at, 50) for number, at in enumerate(CANBERRA, start=2)]
    items.append(simple_item(10, 20, 2, 0, 0, 0, 0, 0, 0, 0))
    circle = {"center": [-35.36218563059447, 149.16461502741134], "radius": 463.7075269143206}
    ring = (
        (-35.35577972719051, 149.15033147518085),
        (-35.35499865210675, 149.1715783983837),
        (-35.365094075579435, 149.1694684777504),
        (-35.360859582008764, 149.1497179521595),
    )
    points = (
        (-35.36270731, 149.16440413, 0),
        (-35.35825302, 149.1672024, 0),
        (-35.35969306, 149.15249281, 0),
    )
    return plan(
        items,
        [fence(ring)],
        [{"circle": circle, "inclusion": True, "version": 1}],
        [list(point) for point in points],
        (-35.3632621, 149.1652374, 585),
    )


def fences_alone() -> bytes:
    """mavlink/qgroundcontrol, custom/res/geofences/ce_geofence_rd_2.plan."""
    inner = (38.7507608625056, -77.49735908548331), (38.750551952470936, -77.49713235890398)
    outer = (38.75094024382851, -77.49709285710168), (38.75073132744176, -77.49686508648041)
    half = (38.750850553167055, -77.4972259712925), (38.75064163995635, -77.4969987226922)
    return plan(
        polygons=[
            fence((inner[0], *outer, inner[1])),
            fence((inner[0], *half, inner[1]), is_inside=False),
        ],
        home=(38.7508357856351, -77.4969789717910, 30),
        rally_version=1,
    )


TRANSECTS = (
    (47.397705960554916, 8.546339694155481),
    (47.39770596118868, 8.546206836516207),
    (47.39770596219769, 8.545744326765641),
    (47.39770596214361, 8.54561146912636),
    (47.397481131760195, 8.545631605677352),
    (47.39748113179102, 8.545764462749732),
    (47.3974811307771, 8.54620924114824),
    (47.39748113014056, 8.546342098220613),
)
ZURICH = (
    (47.397924966150924, 8.545724712437675),
    (47.397930791600224, 8.546204431863657),
    (47.397448005093175, 8.546209595436125),
    (47.39744450980439, 8.545767742626708),
)


def survey(version: int, height_m: float = 50.0) -> dict[str, Any]:
    return {
        "type": "ComplexItem",
        "complexItemType": "survey",
        "version": version,
        "angle": 90,
        "polygon": [list(at) for at in ZURICH],
        "TransectStyleComplexItem": {
            "version": 1,
            "CameraCalc": {
                "AdjustedFootprintSide": 25,
                "DistanceToSurface": height_m,
                "DistanceToSurfaceRelative": True,
            },
            "FollowTerrain": False,
            "Refly90Degrees": False,
            "VisualTransectPoints": [list(at) for at in TRANSECTS],
        },
    }


def zurich_survey() -> bytes:
    """mavlink/MAVSDK, .../test_plans/qgroundcontrol_sample_with_survey_wrong_version.plan."""
    camera = simple_item(1, 530, 2, 0, 2, None, None, None, None, None)
    return plan([camera, survey(9)], home=(47.39801775617688, 8.545149580000002, 483.4))


LAKE_WASHINGTON = (
    (47.65965281788451, -122.1059149362712),
    (47.66002598220988, -122.1044593196253),
    (47.66034166158975, -122.1047336695092),
    (47.6599810708829, -122.1061470943783),
)


def polygon_kml(*, before: str = "", has_ring: bool = True) -> bytes:
    """mavlink/qgroundcontrol, test/MissionManager/PolygonGood.kml and PolygonBadCoordinatesNode."""
    ring = [*LAKE_WASHINGTON, LAKE_WASHINGTON[0]]
    text = " ".join(f"{longitude},{latitude},0" for latitude, longitude in ring)
    inner = f"<coordinates>\n{text}\n</coordinates>"
    boundary = f"<LinearRing>{inner}</LinearRing>" if has_ring else inner
    return (
        f'{before}<?xml version="1.0" encoding="UTF-8"?>\n'
        '<kml xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2">'
        "\n<Document>\n<name>Polygon.kmz</name>\n"
        "<Style><IconStyle><Icon><href>pin.png</href></Icon></IconStyle></Style>\n"
        "<Placemark>\n<name>Untitled Polygon</name>\n<Polygon>\n<tessellate>1</tessellate>\n"
        f"<outerBoundaryIs>\n{boundary}\n</outerBoundaryIs>\n</Polygon>\n</Placemark>\n"
        "</Document>\n</kml>\n"
    ).encode()
