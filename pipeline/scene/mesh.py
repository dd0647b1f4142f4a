"""Meshes of a scene, read by trimesh: triangles with normals and with the direction of the scan's +x on them."""

import io
import json
import struct
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.arrays import Array
from pipeline.scene.model import Mesh

_MOST_BYTES, _MOST_TRIANGLES = 2**29, 5_000_000
# the share of corners that may lack a normal or a tangent: tips, and triangles without an area
_MOST_MISSING = 0.01
_SUFFIXES = (".obj", ".glb", ".gltf")
# the names under which trimesh keeps attributes that it does not know
_TANGENT, _UV = "_TANGENT", "_UV"
_GLB_MAGIC, _JSON_CHUNK = b"glTF", b"JSON"


@dataclass(frozen=True)
class Surface:
    """The triangles of a mesh.

    vertices: (n, 3). faces: int (m, 3). normals: (n, 3), not necessarily unit vectors. along: the direction of the
    scan's +x at each vertex (n, 3), of any length and not necessarily in the surface.
    """

    vertices: Array
    faces: np.ndarray
    normals: Array
    along: Array

    @cached_property
    def _caster(self) -> Any:
        import trimesh

        # Embree where it is installed, else an R-tree
        return trimesh.Trimesh(self.vertices, self.faces, process=False, validate=False).ray

    def first_hits(self, origin: Array, rays: Array) -> np.ndarray:
        """Finds the first triangle (n,) on rays (n, 3) from a point (3,); -1 for none."""
        return np.asarray(self._caster.intersects_first(np.tile(origin, (len(rays), 1)), rays))

    def at(self, origin: Array, rays: Array, triangle: np.ndarray) -> tuple[Array, Array, Array, Array]:
        """Interpolates where rays (n, 3) from a point (3,) meet the planes of triangles (n,).

        Returns points, normals and directions along (n, 3 each), and the triangles' own normals, not unit vectors.
        """
        corners = self.vertices[self.faces[triangle]]
        first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        flat = np.cross(first, second)
        # a triangle that a ray has hit has an area and is not along the ray
        distance = np.sum(flat * (corners[:, 0] - origin), axis=1) / np.sum(flat * rays, axis=1)
        point = origin + distance[:, None] * rays
        area = np.sum(flat**2, axis=1)
        beside = point - corners[:, 0]
        b = np.sum(np.cross(beside, second) * flat, axis=1) / area
        c = np.sum(np.cross(first, beside) * flat, axis=1) / area
        weights = np.stack([1.0 - b - c, b, c], axis=1)[..., None]
        normal, along = (np.sum(weights * of[self.faces[triangle]], axis=1) for of in (self.normals, self.along))
        return point, normal, along, flat


def read(mesh: Mesh) -> Surface:
    """Reads a mesh.

    Raises ValueError where it cannot be read or has no usable triangles, and KeyError, with the remedy, where it does
    not say where the scan's +x lies.
    """
    parts = [_placed(part, turn) for part, turn in _parts(Path(mesh.path))]
    if not parts:
        raise ValueError("expected a mesh of triangles, got none")
    counts = np.cumsum([0, *(len(vertices) for vertices, *_ in parts)])
    vertices = np.concatenate([part[0] for part in parts])
    faces = np.concatenate([part[1] + start for part, start in zip(parts, counts[:-1], strict=True)])
    if not len(faces):
        raise ValueError("expected triangles, got none")
    if len(faces) > _MOST_TRIANGLES:
        raise ValueError(f"expected at most {_MOST_TRIANGLES} triangles, got {len(faces)}; simplify it")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise ValueError("its triangles name vertices that it does not have")
    bad = ~np.isfinite(vertices).all(axis=1)
    if bad.any():
        raise ValueError(f"expected finite vertices, got NaN or infinity in {bad.sum()} of {len(vertices)}")
    normals = np.concatenate([part[2] for part in parts])
    if _missing(normals, faces) > _MOST_MISSING:
        raise ValueError(f"expected normals, got none at {100 * _missing(normals, faces):.3g} % of its corners")
    if mesh.along != "tangents":
        return Surface(vertices, faces, normals, np.tile(np.array(mesh.along, float), (len(vertices), 1)))
    found = [part[3] for part in parts]
    if any(one is None for one in found):
        raise KeyError("expected tangents or texture coordinates in the file, got neither; or set along = [x, y, z]")
    along = np.concatenate([one for one in found if one is not None])
    lengths = np.linalg.norm(along, axis=1, keepdims=True)
    if _missing(along / np.where(lengths > 0.0, lengths, np.nan), faces) > _MOST_MISSING:
        raise KeyError("expected tangents, got some without a direction (or equal texture coordinates); or set along")
    return Surface(vertices, faces, normals, along)


def _missing(vectors: Array, faces: np.ndarray) -> float:
    """Computes the share of the triangles' corners whose vector (n, 3) is NaN."""
    return float(np.mean(np.any(~np.isfinite(vectors), axis=1)[faces]))


def _parts(path: Path) -> list[tuple[Any, Array]]:
    """Reads a file; returns its meshes, each with its transform (4, 4)."""
    suffix, size = path.suffix.lower(), path.stat().st_size
    if suffix not in _SUFFIXES:
        raise ValueError(f"expected a mesh as {', '.join(_SUFFIXES)}, got {path.suffix or 'no suffix'}")
    if size > _MOST_BYTES:
        raise ValueError(f"expected at most {_MOST_BYTES >> 20} MiB, got {size >> 20}")
    try:
        import trimesh
    except ImportError:
        raise ValueError('meshes need trimesh, which is not installed: pip install "diffract-bake[scene]"') from None
    try:
        data = path.read_bytes()
        data = _with_attributes(data, suffix) if suffix != ".obj" else data
        # without a resolver no other file is read, such as one of materials
        scene = trimesh.load_scene(io.BytesIO(data), file_type=suffix[1:], process=False, skip_materials=True)
        return [
            (scene.geometry[name], turn)
            for turn, name in (scene.graph[node] for node in scene.graph.nodes_geometry)
            if isinstance(scene.geometry[name], trimesh.Trimesh)
        ]
    # trimesh's parsers raise errors of many classes
    except Exception as error:
        text = " ".join(str(error).split())[:200]
        raise ValueError(f"cannot be read as a mesh: {text or type(error).__name__}") from None


def _placed(part: Any, turn: Array) -> tuple[Array, np.ndarray, Array, Array | None]:
    """Moves a mesh to its place; returns vertices, faces, normals and directions along (None where it has none)."""
    linear = np.asarray(turn)[:3, :3]
    vertices, faces = np.asarray(part.vertices, float), np.asarray(part.faces, int)
    # normals turn with the inverse transpose, here the matrix of cofactors, which a flat transform has, too
    cofactors = np.stack([np.cross(linear[i - 2], linear[i - 1]) for i in range(3)])
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        normals = np.asarray(part.vertex_normals, float) @ cofactors.T
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        along = _along(part, vertices, faces)
        placed = vertices @ linear.T + np.asarray(turn)[:3, 3]
    return placed, faces, normals, None if along is None else along @ linear.T


def _along(part: Any, vertices: Array, faces: np.ndarray) -> Array | None:
    """Finds the tangents (n, 3) of a mesh: those of its file, else from its texture coordinates."""
    if _TANGENT in part.vertex_attributes:
        return np.asarray(part.vertex_attributes[_TANGENT], float)[:, :3]
    uv = part.vertex_attributes.get(_UV)
    if uv is None:
        uv = getattr(part.visual, "uv", None)
    if uv is None or len(uv) != len(vertices):
        return None
    return from_texture(vertices, faces, np.asarray(uv, float))


def from_texture(vertices: Array, faces: np.ndarray, uv: Array) -> Array:
    """Computes the direction (n, 3) in which the first texture coordinate grows, a mean over a vertex's triangles.

    vertices: (n, 3). faces: (m, 3). uv: texture coordinates (n, 2).
    """
    (p, q, r), (a, b, c) = (x[faces].transpose(1, 0, 2) for x in (vertices, uv))
    du, dv = np.stack([b - a, c - a], axis=-1).transpose(1, 0, 2)
    area = du[:, 0] * dv[:, 1] - du[:, 1] * dv[:, 0]
    # weighted by the triangle's area in the texture, of which only the sign is left
    tangent = np.sign(area)[:, None] * ((q - p) * dv[:, 1:] - (r - p) * dv[:, :1])
    out = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(out, faces[:, corner], tangent)
    return out


def _with_attributes(data: bytes, suffix: str) -> bytes:
    """Renames attributes of a glTF file that trimesh drops: tangents, and texture coordinates without a material.

    Raises ValueError where the file needs others.
    """
    if suffix == ".glb":
        magic, _, _, length, kind = struct.unpack_from("<4sIII4s", data)
        if (magic, kind) != (_GLB_MAGIC, _JSON_CHUNK):
            raise ValueError("expected a GLB of version 2")
        document, rest = json.loads(data[20 : 20 + length]), data[20 + length :]
    else:
        document, rest = json.loads(data), b""
    for buffer in (*document.get("buffers", ()), *document.get("images", ())):
        if not buffer.get("uri", "data:").startswith("data:"):
            raise ValueError(f"expected all data in one file, got a reference to {buffer['uri']}; save it as .glb")
    for mesh in document.get("meshes", ()):
        for primitive in mesh["primitives"]:
            names = primitive["attributes"]
            for old, new in (("TANGENT", _TANGENT), ("TEXCOORD_0", _UV)):
                if old in names:
                    names[new] = names[old]
    text = json.dumps(document).encode()
    if suffix != ".glb":
        return text
    text += b" " * (-len(text) % 4)
    header = struct.pack("<4sII", _GLB_MAGIC, 2, 20 + len(text) + len(rest))
    return header + struct.pack("<I4s", len(text), _JSON_CHUNK) + text + rest
