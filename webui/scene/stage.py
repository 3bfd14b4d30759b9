"""Puts things that are given in metres of the site into the view, and stretches them together.

viser scales a node's own geometry but not its children, so each node made here gets the scale
itself; ``exaggerate`` sets it on all of them.
"""

from typing import Literal

import numpy as np
import numpy.typing as npt
import viser

from autonomy.arrays import FloatArray
from webui.scene.colour import Colour, ColourArray, linear
from webui.scene.projection import Projection

Node = (
    viser.LineSegmentsHandle | viser.MeshHandle | viser.BatchedMeshHandle | viser.PointCloudHandle
)


class Stage:
    """Draws in ENU metres below ``/world``; one vertical exaggeration holds for all of it."""

    def __init__(self, scene: viser.SceneApi, projection: Projection) -> None:
        self.scene = scene
        self.projection = projection
        self.exaggeration = projection.default_exaggeration
        self._nodes: dict[str, Node] = {}
        self._labels: dict[str, tuple[viser.LabelHandle, FloatArray]] = {}
        scene.add_frame("/world", show_axes=False, position=projection.offset())

    def exaggerate(self, exaggeration: float) -> None:
        """Stretch everything vertically by another factor."""
        self.exaggeration = exaggeration
        for node in self._nodes.values():
            node.scale = self._scale()
        for label, enu_m in self._labels.values():
            label.position = tuple(enu_m * np.array(self._scale()))

    def lines(
        self, name: str, segments_enu: FloatArray, colours: ColourArray | Colour, width_px: float
    ) -> viser.LineSegmentsHandle:
        """Draw separate line segments, shape ``(n, 2, 3)``; an older node of the name goes."""
        handle = self.scene.add_line_segments(
            f"/world/{name}",
            segments_enu.astype(np.float32),
            linear(colours),
            thickness=width_px,
            thickness_units="screen",
            scale=self._scale(),
        )
        self._nodes[name] = handle
        return handle

    def rectangle(self, name: str, corners_enu: FloatArray, colour: Colour, opacity: float) -> None:
        """Fill four corners, shape ``(4, 3)``, in order around the edge."""
        self.mesh(name, corners_enu, np.array([[0, 1, 2], [0, 2, 3]]), colour, opacity)

    def mesh(
        self,
        name: str,
        vertices_enu: FloatArray,
        faces: npt.NDArray[np.int64],
        colour: Colour,
        opacity: float,
        *,
        side: Literal["front", "double"] = "double",
    ) -> None:
        """Fill triangles, shape ``(f, 3)``, between vertices, shape ``(n, 3)``.

        Those of side ``front`` are seen only from where their corners run anticlockwise.
        """
        self._nodes[name] = self.scene.add_mesh_simple(
            f"/world/{name}",
            vertices_enu.astype(np.float32),
            faces,
            color=colour,
            opacity=opacity,
            side=side,
            flat_shading=True,
            cast_shadow=False,
            receive_shadow=False,
            scale=self._scale(),
        )

    def cells(
        self,
        name: str,
        shape: tuple[FloatArray, npt.NDArray[np.int64]],
        centres_enu: FloatArray,
        colours: ColourArray,
        opacities: npt.NDArray[np.float32],
    ) -> viser.BatchedMeshHandle:
        """Draw one small mesh (vertices, faces) at every centre, shape ``(n, 3)``."""
        turns = np.tile(np.array([1.0, 0.0, 0.0, 0.0], np.float32), (len(centres_enu), 1))
        handle = self.scene.add_batched_meshes_simple(
            f"/world/{name}",
            shape[0].astype(np.float32),
            shape[1],
            turns,
            centres_enu.astype(np.float32),
            batched_colors=colours,
            batched_opacities=opacities,
            lod="off",
            flat_shading=True,
            cast_shadow=False,
            receive_shadow=False,
            scale=self._scale(),
        )
        self._nodes[name] = handle
        return handle

    def points(
        self,
        name: str,
        positions_enu: FloatArray,
        colour: Colour,
        *,
        shape: Literal["square", "diamond", "circle", "rounded"],
        size: float,
    ) -> None:
        """Draw a mark of one shape and size (view units) at every point, shape ``(n, 3)``."""
        self._nodes[name] = self.scene.add_point_cloud(
            f"/world/{name}",
            positions_enu.astype(np.float32),
            np.array(colour, dtype=np.uint8),
            point_size=size,
            point_shape=shape,
            point_shading="flat",
            precision="float32",
            scale=self._scale(),
        )

    def label(self, name: str, text: str, enu_m: FloatArray) -> None:
        """Write a short text at a point; one that stands there already says another."""
        known = self._labels.get(name)
        if known is not None and np.array_equal(known[1], enu_m):
            known[0].text = text
            return
        handle = self.scene.add_label(
            f"/world/{name}",
            text,
            position=tuple(enu_m * np.array(self._scale())),
            font_screen_scale=0.8,
            anchor="center-center",
        )
        self._labels[name] = (handle, enu_m)

    def show(self, name: str, visible: bool) -> None:
        """Show or hide a node; nothing happens when it is not there."""
        if name in self._nodes:
            self._nodes[name].visible = visible

    def show_label(self, name: str, visible: bool) -> None:
        """Show or hide a label; nothing happens when it is not there."""
        if name in self._labels:
            self._labels[name][0].visible = visible

    def remove_label(self, name: str) -> None:
        """Take a label away; nothing happens when it is not there."""
        if name in self._labels:
            self._labels.pop(name)[0].remove()

    def remove(self, name: str) -> None:
        """Take a node away; nothing happens when it is not there."""
        node = self._nodes.pop(name, None)
        if node is not None:
            node.remove()

    def _scale(self) -> tuple[float, float, float]:
        return self.projection.scale(self.exaggeration)
