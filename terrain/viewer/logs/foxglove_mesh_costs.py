"""A mesh map in the colours of its costs, as Foxglove scene entities.

The whole surface is drawn once; when costs change, only the triangles that differ from that first picture are drawn
again, over it, so that the file of a run with an obstacle layer stays small.
"""

from __future__ import annotations

from collections.abc import Iterator

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


def updates(frame: str, meshes: list[RecordedMesh]) -> Iterator[tuple[RecordedMesh, SceneUpdate]]:
    """One message for each record: the costs of the first, then what is different from them."""
    top = highest_cost(meshes)
    for number, mesh in enumerate(meshes):
        if number == 0:
            yield mesh, SceneUpdate(entities=[_entity(frame, WHOLE, mesh, mesh.faces, top, MAP_LIFT)])
            continue
        differs = mesh.costs != meshes[0].costs
        faces = mesh.faces[differs[mesh.faces].any(axis=1)]
        if len(faces):
            yield mesh, SceneUpdate(entities=[_entity(frame, CHANGED, mesh, faces, top, 2.0 * MAP_LIFT)])
        else:
            yield mesh, SceneUpdate(deletions=[_deletion(mesh.time)])


def _entity(
    frame: str, name: str, mesh: RecordedMesh, faces: NDArray[np.int32], top: float, lift: float
) -> SceneEntity:
    """Some faces of the map; ``highest_cost`` is the cost of the darkest colour."""
    used, corners = np.unique(faces, return_inverse=True)
    vertices = mesh.vertices[used] + np.array([0.0, 0.0, lift])
    entity = SceneEntity(frame_id=frame, id=name, frame_locked=True, timestamp=timestamp(mesh.time))
    entity.metadata.append(KeyValuePair(key="highest_cost", value=f"{top:.4g}"))
    colours = cost_colours_up_to(top, mesh.costs[used])
    entity.triangles.append(triangles(vertices, corners.reshape(-1, 3).astype(np.int32), colours))
    return entity


def _deletion(time: float) -> SceneEntityDeletion:
    return SceneEntityDeletion(timestamp=timestamp(time), type=SceneEntityDeletion.MATCHING_ID, id=CHANGED)
