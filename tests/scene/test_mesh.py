"""Meshes: what pixels see of a snake-like tube, in the frame of the scan that lies along its axis."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.arrays import Array
from pipeline.optics import geometry
from pipeline.scene import mesh, seen
from pipeline.scene.model import Mesh, Scene
from pipeline.scene.pairs import random_pairs
from pipeline.scene.visited import rho_max, visited
from tests.cli.tool import REPOSITORY
from tests.scene.scenes import scene
from tests.scene.tube import AMPLITUDE, LENGTH, RADIUS, write_example, write_glb, write_obj

CAMERA = {"position": [0.0, -60.0, 200.0], "fov_deg": 12.0, "size": [160, 60]}


def tube_scene(path: Path, **keys: Any) -> Scene:
    """The tube under the sun, seen by one camera."""
    made = {"path": str(path)}
    made.update(keys.pop("mesh", {}))
    return scene(**{"lights": [{"kind": "sun", "theta_deg": 20.0}], "cameras": [CAMERA], "mesh": made, **keys})


def expected_frame(point: Array) -> Array:
    """Rows x, y, z of the frames of the tube's surface next to points (n, 3), by Newton's steps along its axis."""
    x = point[:, 0].copy()
    for _ in range(20):
        turn = 2.0 * np.pi * (x / LENGTH + 0.5)
        slope = 2.0 * np.pi * AMPLITUDE / LENGTH * np.cos(turn)
        x += ((point[:, 0] - x) + slope * (point[:, 1] - AMPLITUDE * np.sin(turn))) / (1.0 + slope**2) * 0.7
    axis = np.stack([x, AMPLITUDE * np.sin(turn), 0.0 * x], axis=1)
    along = np.stack([np.ones_like(x), slope, 0.0 * x], axis=1)
    normal = point - axis
    along, normal = (vector / np.linalg.norm(vector, axis=1, keepdims=True) for vector in (along, normal))
    return np.stack([along, np.cross(normal, along), normal], axis=1)


@pytest.mark.parametrize("kind", ["obj", "tangents", "texture"])
def test_pixels_have_the_frame_of_the_tube(tmp_path: Path, kind: str) -> None:
    """x lies along the axis, z is the normal, in an OBJ and in glTF with tangents or texture coordinates alone."""
    if kind == "obj":
        path, turned = write_obj(tmp_path / "tube.obj"), np.eye(3)
    else:
        attributes = ("NORMAL", "TANGENT") if kind == "tangents" else ("NORMAL", "TEXCOORD_0")
        path = write_glb(tmp_path / "tube.glb", *attributes)
        turned = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    camera = {**CAMERA, "position": (turned @ CAMERA["position"]).tolist(), "up": turned[:, 2].tolist()}
    (raster,) = seen.rasters(tube_scene(path, cameras=[camera]))
    met = raster.seen.met
    assert 0.2 < met.mean() < 0.5
    point, frame = raster.seen.point[met] @ turned, raster.seen.frame[met] @ turned
    exact = expected_frame(point)
    assert np.abs(np.sum(frame[:, 2] * exact[:, 2], axis=1)).min() > np.cos(0.03)
    assert np.sum(frame * exact, axis=2).min() > np.cos(0.05)
    # views are those of the ray in that frame
    towards = camera["position"] - raster.seen.point[met]
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    np.testing.assert_allclose(
        np.einsum("nij,nj->ni", raster.seen.frame[met], towards), raster.seen.wr[met], atol=1e-6
    )


def test_a_direction_along_the_mesh_replaces_tangents(tmp_path: Path) -> None:
    made = tube_scene(write_obj(tmp_path / "tube.obj", textured=False), mesh={"along": [1.0, 0.0, 0.0]})
    (raster,) = seen.rasters(made)
    frame = raster.seen.frame[raster.seen.met]
    np.testing.assert_allclose(
        np.einsum("nij,nkj->nik", frame, frame), np.tile(np.eye(3), (len(frame), 1, 1)), atol=1e-9
    )
    assert np.abs(frame[:, 1, 0]).max() < 1e-9
    assert frame[:, 0, 0].min() > 0.0


def test_every_pair_on_a_mesh_is_within_the_gap_of_a_visited_direction(tmp_path: Path) -> None:
    """Rays between the raster's find nothing outside the raster's gaps, up to rims of the tube (1 in 500)."""
    keys = {"lights": [{"theta_deg": 20.0}], "cameras": [{**CAMERA, "size": [640, 240]}]}
    made = tube_scene(write_obj(tmp_path / "tube.obj"), **keys)
    uvw = geometry.uvw(*random_pairs(made, 500, 3))
    found = visited(made, 20000)
    held = [np.any(np.linalg.norm(one - found.uvw, axis=1) <= found.gap) for one in uvw]
    assert np.mean(held) >= 0.998
    assert np.median(found.gap) < 0.2
    assert np.hypot(uvw[:, 0], uvw[:, 1]).max() <= rho_max(made)


def test_back_faces_are_not_seen(tmp_path: Path) -> None:
    """From within the tube, only its inside is in view."""
    inside = {"position": [0.0, 0.0, 0.0], "target": [0.0, -1.0, 0.0], "fov_deg": 60.0, "size": [20, 20]}
    with pytest.raises(seen.UnseenError, match="front of the mesh"):
        seen.rasters(tube_scene(write_obj(tmp_path / "tube.obj"), cameras=[inside]))


def test_more_pixels_than_rays_give_the_same_picture(tmp_path: Path) -> None:
    """A raster of every fourth row and column has the solid angle and the mean view of all pixels."""
    path = write_obj(tmp_path / "tube.obj")
    (few,) = seen.rasters(tube_scene(path))
    (many,) = seen.rasters(tube_scene(path, cameras=[{**CAMERA, "size": [1280, 480]}]))
    assert (few.step, many.step) == (1, 3)
    assert few.weight.sum() == pytest.approx(many.weight.sum(), rel=0.01)
    means = [r.weight[r.seen.met] @ r.seen.wr[r.seen.met] / r.weight.sum() for r in (few, many)]
    np.testing.assert_allclose(means[0], means[1], atol=5e-3)


def test_rays_meet_what_trimesh_meets_without_embree(tmp_path: Path) -> None:
    """Both of trimesh's ray casters find the same triangles; only Embree is fast."""
    from trimesh.ray.ray_triangle import RayMeshIntersector

    surface = mesh.read(Mesh(path=str(write_obj(tmp_path / "tube.obj"))))
    rng = np.random.default_rng(1)
    origin = np.array(CAMERA["position"])
    rays = surface.vertices[rng.integers(len(surface.vertices), size=400)] + RADIUS * rng.random((400, 3)) - origin
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    slow = RayMeshIntersector(surface._caster.mesh).intersects_first(np.tile(origin, (400, 1)), rays)
    assert np.mean(slow == surface.first_hits(origin, rays)) > 0.99


def test_the_mesh_of_the_example_is_the_generated_one(tmp_path: Path) -> None:
    """After a change of the tube: .venv/bin/python -m tests.scene.tube."""
    committed, made = (
        [line.split() for line in path.read_text(encoding="ascii").splitlines() if line.startswith(("v", "f"))]
        for path in (REPOSITORY / "configs" / "tube.obj", write_example(tmp_path / "tube.obj"))
    )
    assert [line[0] for line in committed] == [line[0] for line in made]
    for one, two in zip(committed, made, strict=True):
        if one[0] == "f":
            assert one == two
        else:
            np.testing.assert_allclose(np.array(one[1:], float), np.array(two[1:], float), atol=1e-2)
