"""What a browser sees of the water before anybody moves the camera."""

import itertools
import math

import numpy as np
import pytest

from autonomy.site import LAKE, TANK
from tests.webui.fake_source import FakeSource
from webui.scene.framing import FIELD_OF_VIEW_RAD, WATER
from webui.scene.projection import Projection
from webui.scene.server import RobotScene


@pytest.mark.parametrize("site", [TANK, LAKE], ids=["tank", "lake"])
@pytest.mark.parametrize("aspect", [1.4, 2.4])
def test_the_whole_water_and_its_labels_are_in_view(site, aspect):
    water, projection = site.water, Projection.of_site(site)
    corners = np.array(
        list(
            itertools.product(
                (water.x_min_m, water.x_max_m),
                (water.y_min_m, water.y_max_m),
                (0.0, water.depth_max_m),
            )
        )
    )
    ahead = WATER.look_at - WATER.position
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    up = np.cross(right, ahead)
    rays = projection.point(corners, projection.default_exaggeration) - WATER.position
    half_height = (rays @ ahead) * math.tan(FIELD_OF_VIEW_RAD / 2)
    assert np.abs(rays @ up / half_height).max() < 0.9
    assert np.abs(rays @ right / half_height).max() < 0.9 * aspect


def test_the_depth_is_named_with_how_many_times_as_deep_it_is_drawn():
    source = FakeSource()
    source.site = LAKE
    scene = RobotScene(source)
    try:

        def depth() -> str:
            return scene._stage._labels["ruler_depth"][0].text

        assert depth() == "20 m deep, drawn 8 times as deep"
        scene.change({"exaggeration": 2.5})
        assert depth() == "20 m deep, drawn 2.5 times as deep"
        scene.change({"exaggeration": 1.0})
        assert depth() == "20 m deep"
    finally:
        scene.stop()
