"""Designs that are moved as a whole."""

from autonomy.design.document import Design, Reference, ReferenceRow, Spot
from server.design.moving import shifted


def test_the_rows_of_a_reference_move_with_their_origin_alone():
    rows = tuple(
        ReferenceRow(time_s=9.0 * k, north_m=5.0 * k, east_m=0.0, depth_m=0.0) for k in range(3)
    )
    one = Design(content=Reference(shape="rows", origin=Spot(north_m=10.0, east_m=20.0), rows=rows))
    content = shifted(one, 20.0, -5.0).content
    assert isinstance(content, Reference)
    assert content.origin.ne_m == (30.0, 15.0)
    assert content.rows == rows
