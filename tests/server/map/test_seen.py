"""Measurements placed where cameras saw their robot."""

from dataclasses import replace
from datetime import timedelta

import numpy as np

from db.column import moment
from db.query.camera.fixes import add_fixes
from db.query.measured.samples import sample_columns
from server.map.seen import places_seen
from tests.robot_link.fix_case import FIX
from tests.server.conftest import MINI
from tests.server.map.test_map_comparison import sampled


async def test_a_measurement_is_placed_between_the_fixes_around_it(station, world):
    await sampled(station, world)
    store = station.foundation.store
    with store.read() as session:
        columns = sample_columns(session, (MINI,), "blue_light")
    seen, unseen, refused = columns.measured_at_us[[3, 20, 30]].tolist()

    def fix(at_us, after_s, north_m, quality="good"):
        at = moment(at_us) + timedelta(seconds=after_s)
        one = replace(FIX, measured_at=at, ned_m=(north_m, 0.5, 0.3), quality=quality)
        return replace(one, calibration=None), at

    fixes = [fix(seen, -0.1, 1.0), fix(seen, 0.3, 1.4), fix(unseen, -0.7, 2.0)]
    fixes += [fix(unseen, 0.1, 2.0), *(fix(refused, s, 3.0, "refused") for s in (-0.1, 0.1))]
    await store.write(lambda session: add_fixes(session, fixes))
    with store.read() as session:
        places = places_seen(session, (MINI,), columns)
    np.testing.assert_allclose(places[3], [1.1, 0.5, 0.3], atol=1e-9)
    assert not np.isfinite(places[[20, 30]]).any()
    assert np.isfinite(places).all(axis=1).sum() == 1
