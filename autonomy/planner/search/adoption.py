"""Puts trajectories from elsewhere into a search's tables."""

from collections.abc import Sequence

from autonomy.arrays import FloatArray
from autonomy.planner.config import PlannerConfig
from autonomy.planner.graph import DEPTH_MAX, STAGED, Graph, first_staged
from autonomy.planner.leg.edge import Edge
from autonomy.planner.leg.leg_kernel import (
    DURATION,
    ENERGY,
    HEADING,
    KIND,
    KINDS,
    RADIUS,
    SPEED,
    TURN,
    X0,
    X1,
    Z0,
    Z1,
)
from autonomy.planner.plan import Leg
from autonomy.planner.search.staging import note_shares
from autonomy.planner.search.warm import shape_of


def stage_trajectory(graph: Graph, config: PlannerConfig, edges: Sequence[Edge]) -> bool:
    """Stage the edges of a trajectory; tell whether there was room for them."""
    graph.tally[STAGED] = 0
    longest = min(DEPTH_MAX, len(graph.staged_point_count))
    legs_room, points_room = graph.edge_legs.shape[1], graph.staged_points.shape[1]
    if len(edges) > longest:
        return False
    begin = edges[0].legs[0].start_ned[:2]
    for staged, edge in enumerate(edges):
        if len(edge.legs) > legs_room or len(edge.points) > points_room:
            return False
        number = first_staged(graph) + staged
        for row, leg in zip(graph.edge_legs[number], edge.legs, strict=False):
            _write(row, leg)
        graph.edge_leg_count[number] = len(edge.legs)
        graph.edge_shape[number] = shape_of(config, edge)
        graph.edge_start[number] = begin
        graph.edge_end[number] = begin = (edge.points[-1, 1], edge.points[-1, 2])
        graph.staged_points[staged, : len(edge.points)] = edge.points
        graph.staged_point_count[staged] = len(edge.points)
        note_shares(graph, number)
    graph.tally[STAGED] = len(edges)
    return True


def _write(row: FloatArray, leg: Leg) -> None:
    """Write a leg as compiled code reads it (``leg_kernel.leg_of``)."""
    row[KIND] = KINDS.index(leg.kind)
    row[X0 : Z0 + 1] = leg.start_ned
    row[X1 : Z1 + 1] = leg.end_ned
    row[SPEED], row[DURATION], row[ENERGY] = leg.speed_m_s, leg.duration_s, leg.energy
    row[HEADING], row[RADIUS], row[TURN] = leg.heading_rad, leg.radius_m, leg.turn_rad
