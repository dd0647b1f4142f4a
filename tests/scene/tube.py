"""A snake-like tube, generated: circles along a sine, whose texture coordinate u and tangents run along its axis.

`.venv/bin/python -m tests.scene.tube` writes configs/tube.obj, a coarse one.
"""

import json
import struct
from pathlib import Path

import numpy as np

from pipeline.arrays import Array

LENGTH, AMPLITUDE, RADIUS = 100.0, 10.0, 5.0


def tube(along: int = 160, around: int = 48) -> tuple[Array, np.ndarray, Array, Array, Array]:
    """Makes the tube in the plane z = 0, with its axis along x on the whole.

    Returns vertices (n, 3), faces (m, 3), normals and tangents (n, 3), texture coordinates (n, 2).
    """
    u, v = (grid.ravel() for grid in np.meshgrid(*(np.linspace(0, 1, n + 1) for n in (along, around)), indexing="ij"))
    turn, angle = 2.0 * np.pi * u, 2.0 * np.pi * v
    axis = np.stack([LENGTH * (u - 0.5), AMPLITUDE * np.sin(turn), 0.0 * u], axis=1)
    tangent = np.stack([LENGTH + 0.0 * u, 2.0 * np.pi * AMPLITUDE * np.cos(turn), 0.0 * u], axis=1)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    side = np.cross([0.0, 0.0, 1.0], tangent)
    normals = np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * [0.0, 0.0, 1.0]
    corner = (np.arange(along)[:, None] * (around + 1) + np.arange(around)).ravel()
    right, up = around + 1, 1
    faces = np.concatenate(
        [
            np.stack([corner, corner + right + up, corner + right], axis=1),
            np.stack([corner, corner + up, corner + right + up], axis=1),
        ]
    )
    return axis + RADIUS * normals, faces, normals, tangent, np.stack([u, v], axis=1)


def write_obj(path: Path, textured: bool = True, along: int = 160, around: int = 48, digits: int = 9) -> Path:
    """Writes the tube as an OBJ, with or without texture coordinates."""
    vertices, faces, normals, _, uv = tube(along, around)
    kinds = {"v": vertices, "vn": normals, **({"vt": uv} if textured else {})}
    lines = ["# generated, no snake: by tests/scene/tube.py of diffract-bake"]
    lines += [" ".join([kind, *(f"{x:.{digits}g}" for x in row)]) for kind, rows in kinds.items() for row in rows]
    corner = "{0}/{0}/{0}" if textured else "{0}//{0}"
    lines += ["f " + " ".join(corner.format(i + 1) for i in face) for face in faces]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
    return path


def write_glb(path: Path, *attributes: str) -> Path:
    """Writes the tube as a GLB with POSITION and the attributes that are named, turned to stand up by its node."""
    vertices, faces, normals, tangents, uv = tube()
    values = {
        "POSITION": vertices,
        "NORMAL": normals,
        "TANGENT": np.concatenate([tangents, np.ones((len(tangents), 1))], axis=1),
        "TEXCOORD_0": uv,
    }
    blobs = [values[name].astype("<f4") for name in ("POSITION", *attributes)] + [faces.astype("<u4").reshape(-1, 1)]
    kinds = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
    views, accessors, start = [], [], 0
    for i, blob in enumerate(blobs):
        views.append({"buffer": 0, "byteOffset": start, "byteLength": blob.nbytes})
        entry = {"bufferView": i, "componentType": 5125 if blob.dtype == "<u4" else 5126}
        limits = {"min": blob.min(axis=0).tolist(), "max": blob.max(axis=0).tolist()} if i == 0 else {}
        accessors.append({**entry, "count": len(blob), "type": kinds[blob.shape[1]], **limits})
        start += blob.nbytes
    names = {name: i for i, name in enumerate(("POSITION", *attributes))}
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        # a quarter turn about x: +z of the tube becomes -y, as in files whose up is +y
        "nodes": [{"mesh": 0, "rotation": [-np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]}],
        "meshes": [{"primitives": [{"attributes": names, "indices": len(blobs) - 1}]}],
        "buffers": [{"byteLength": start}],
        "bufferViews": views,
        "accessors": accessors,
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    data = b"".join(blob.tobytes() for blob in blobs)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    return path


def write_example(path: Path) -> Path:
    """Writes the tube of configs/tube.toml."""
    return write_obj(path, along=28, around=14, digits=4)


if __name__ == "__main__":
    write_example(Path("configs/tube.obj"))
