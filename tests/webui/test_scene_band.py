from dataclasses import replace

import numpy as np
import pytest

from autonomy.site import LAKE
from tests.webui.fake_source import FakeSource
from webui.scene.band import NODES, SURFACINGS, TUBE, surfacing_rings, tube
from webui.scene.server import RobotScene
from webui.scene.source import BandView


def drawn_band(seed: int, legs: int = 5, each: int = 7) -> BandView:
    """Return a band of legs that go up and down in turn, as wide as the dice say."""
    dice = np.random.default_rng(seed)
    count, turns = legs * each, np.arange(legs + 1)
    share = np.concatenate([k + np.linspace(0.0, 1.0, each) for k in range(legs)])
    depth = np.interp(share, turns, 6.0 * (turns % 2))
    centre = np.column_stack([100.0 + 20.0 * share, 120.0 + 4.0 * np.sin(share), depth])
    axes = np.sort(dice.uniform(0.1, 5.0, (count, 2)))[:, ::-1]
    return BandView(
        level=0.9,
        leg=np.repeat(np.arange(legs), each),
        centre_ned=centre,
        half_axes_m=np.column_stack([axes, dice.uniform(0.1, 2.0, count)]),
        direction_rad=dice.uniform(-np.pi, np.pi, count),
        surfacing_ne_m=dice.uniform(50.0, 150.0, (3, 2)),
        surfacing_axes_m=np.sort(dice.uniform(1.0, 8.0, (3, 2)))[:, ::-1],
        surfacing_rad=dice.uniform(-np.pi, np.pi, 3),
    )


def turned(band: BandView, vectors: np.ndarray) -> np.ndarray:
    """Return what belongs to each station in the directions of its ellipse's axes."""
    cos, sin = np.cos(band.direction_rad), np.sin(band.direction_rad)
    north, east, down = np.moveaxis(vectors, -1, 0)
    along = cos[:, None] * north + sin[:, None] * east
    return np.stack([along, -sin[:, None] * north + cos[:, None] * east, down], axis=-1)


@pytest.mark.parametrize("seed", range(5))
def test_the_tube_goes_around_the_ellipsoid_of_each_station(seed):
    band = drawn_band(seed)
    deep = replace(band, centre_ned=band.centre_ned + np.array([0.0, 0.0, 20.0]))
    vertices, faces = tube(deep)
    rings = vertices.reshape(len(deep.leg), -1, 3)
    inside = turned(deep, rings - deep.centre_ned[:, None]) / deep.half_axes_m[:, None]
    assert np.linalg.norm(inside, axis=2) == pytest.approx(1.0)
    assert set(faces.ravel()) == set(range(len(vertices)))


def test_no_triangle_of_the_tube_leads_from_one_leg_to_another():
    band = drawn_band(1)
    vertices, faces = tube(band)
    leg = np.repeat(band.leg, len(vertices) // len(band.leg))
    assert (leg[faces] == leg[faces[:, :1]]).all()


def test_the_tube_of_a_track_that_stands_on_the_spot_is_finite_and_in_the_water():
    band = drawn_band(2)
    still = replace(band, centre_ned=np.zeros_like(band.centre_ned))
    vertices, _ = tube(still)
    assert np.isfinite(vertices).all()
    assert vertices[:, 2].min() >= 0.0


def test_the_tube_of_a_long_mission_stays_light():
    vertices, _ = tube(drawn_band(3, legs=400))
    assert len(vertices) <= 400 * 2 * 16


def test_a_surfacing_lies_at_the_surface_with_its_ellipse():
    band = drawn_band(4)
    rings = surfacing_rings(band)
    centres = np.column_stack([band.surfacing_ne_m, rings[:, 0, 2]])
    away = turned(replace(band, direction_rad=band.surfacing_rad), rings - centres[:, None])
    share = away[..., :2] / band.surfacing_axes_m[:, None]
    assert np.linalg.norm(share, axis=2) == pytest.approx(1.0)
    assert 0.0 < rings[..., 2].max() < 0.5


def test_the_band_is_a_layer_that_goes_with_its_plan():
    source = FakeSource(LAKE)
    scene = RobotScene(source)
    scene.update()
    [layer] = [one for one in scene.state.layers if one.key == "band"]
    assert not layer.has_content
    source.fly_ahead(drawn_band(0))
    scene.update()
    assert set(NODES) <= set(scene._stage._nodes)
    scene.change({"layers": {"band": False}})
    assert not any(scene._stage._nodes[name].visible for name in NODES)
    [layer] = [one for one in scene.state.layers if one.key == "band"]
    assert (layer.title, layer.visible, layer.has_content) == ("Band of flights", False, True)
    source.set_plan_state("done")
    scene.update()
    scene.stop()
    assert not {TUBE, SURFACINGS} & set(scene._stage._nodes)
