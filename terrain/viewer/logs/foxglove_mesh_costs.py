"""A mesh map in the colours of its costs, as Foxglove scene entities.

The whole surface is drawn once; when costs change, only the triangles that differ from that first picture are drawn
again, over it, so that the file of a run with an obstacle layer stays small. Colours mean the same costs in all of
them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from foxglove_schemas_protobuf.KeyValuePair_pb2 import KeyValuePair
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneEntityDeletion_pb2 import SceneEntityDeletion
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from numpy.typing import NDArray

from terrain.recording.recorded_maps import RecordedMesh, highest_cost
from terrain.viewer.logs.foxglove_messages import MAP_LIFT, timestamp, triangles
from terrain.viewer.pictures.colours import cost_colours_up_to

WHOLE, CHANGED = "costs", "changed costs"


class MeshCosts:
    """Messages of a run's mesh, record by record; the scale of colours is that of the first.

    Parameters
    ----------
    frame : str
        Of the map.
    """

    def __init__(self, frame: str) -> None:
        self._frame = frame
        self._first: RecordedMesh | None = None
        self._top = 1.0

    def take(self, mesh: RecordedMesh) -> tuple[str, Callable[[], SceneUpdate]]:
        """Return which of ``WHOLE`` and ``CHANGED`` a record draws, and what makes the message.

        All but the first record may come without vertices and faces.
        """
        if self._first is None:
            self._first, self._top = mesh, highest_cost([mesh])
            return WHOLE, partial(self._draw, WHOLE, mesh, mesh.costs, mesh.faces, MAP_LIFT)
        return CHANGED, partial(self._changes, self._first, mesh)

    def _changes(self, first: RecordedMesh, mesh: RecordedMesh) -> SceneUpdate:
        faces = first.faces[(mesh.costs != first.costs)[first.faces].any(axis=1)]
        if not len(faces):
            return SceneUpdate(deletions=[_deletion(mesh.time)])
        there = replace(mesh, vertices=first.vertices)
        return self._draw(CHANGED, there, mesh.costs, faces, 2.0 * MAP_LIFT)

    def _draw(
        self, name: str, mesh: RecordedMesh, costs: NDArray[np.float16], faces: NDArray[np.int32], lift: float
    ) -> SceneUpdate:
        """Some faces of the map."""
        used, corners = np.unique(faces, return_inverse=True)
        vertices = mesh.vertices[used] + np.array([0.0, 0.0, lift])
        entity = SceneEntity(frame_id=self._frame, id=name, frame_locked=True, timestamp=timestamp(mesh.time))
        entity.metadata.append(KeyValuePair(key="highest_cost", value=f"{self._top:.4g}"))
        colours = cost_colours_up_to(self._top, costs[used])
        entity.triangles.append(triangles(vertices, corners.reshape(-1, 3).astype(np.int32), colours))
        return SceneUpdate(entities=[entity])


def _deletion(time: float) -> SceneEntityDeletion:
    return SceneEntityDeletion(timestamp=timestamp(time), type=SceneEntityDeletion.MATCHING_ID, id=CHANGED)
