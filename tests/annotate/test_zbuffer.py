"""Drawn depth against rays cast by another program, and against spheres and planes that can be computed by hand."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from evimo.annotate.discs import disc_levels, discs_of
from evimo.annotate.lens import lens_tables
from evimo.annotate.surfaces import surfaces_of
from evimo.annotate.zbuffer import drawn, fill_pinholes
from evimo.captures.scans import Scan
from evimo.geometry.camera import Camera

RADTAN = Camera(96.0, 97.0, 65.5, 50.0, 100, 130, (-0.3, 0.08, 1e-3, -5e-4))
PINCUSHION = Camera(96.0, 97.0, 65.5, 50.0, 100, 130, (0.25, 0.1, 0.0, 0.0, 0.02))
FISHEYE = Camera(75.0, 75.0, 64.5, 49.5, 100, 130, (0.02, -0.01, 0.002, 0.0), "fisheye")
CAMERAS = {"radtan": RADTAN, "pincushion": PINCUSHION, "fisheye": FISHEYE}


def scan_of(points, triangles=None):
    triangles = np.zeros((0, 3), np.int64) if triangles is None else np.asarray(triangles)
    return Scan(Path("made"), np.asarray(points, np.float64), triangles, np.zeros((0, 3)))


def draw(scans, camera, poses=None, codes=None, fine=0.7):
    poses = np.tile(np.eye(4)[:3], (len(scans), 1, 1)) if poses is None else poses
    codes = np.arange(1, len(scans) + 1) if codes is None else codes
    return drawn(surfaces_of(scans), lens_tables(camera), poses, codes, np.full(len(scans), fine))


def rays_of(camera):
    straight, known = camera.normalised(camera.pixels())
    assert known.all()
    return np.concatenate((straight, np.ones((*camera.size, 1))), axis=-1)


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
def test_triangles_are_where_rays_meet_them(camera):
    """Embree casts the rays; the scene has triangles of a pixel, of the whole image, and around the camera."""
    rng = np.random.default_rng(2)
    room = trimesh.creation.box((6, 5, 8), transform=trimesh.transformations.rotation_matrix(0.4, (1, 2, 3)))
    ball = trimesh.creation.icosphere(4, 0.5)
    ball.apply_translation((0.2, -0.1, 1.4))
    shards = rng.uniform((-1, -1, -0.5), (1, 1, 3), (60, 1, 3)) + rng.normal(scale=0.2, size=(60, 3, 3))
    loose = trimesh.Trimesh(shards.reshape(-1, 3), np.arange(180).reshape(-1, 3), process=False)
    meshes = [room, ball, loose]
    depth, seen = draw([scan_of(mesh.vertices, mesh.faces) for mesh in meshes], camera)
    whole = trimesh.util.concatenate(meshes)
    rays = rays_of(camera).reshape(-1, 3)
    caster = trimesh.ray.ray_pyembree.RayMeshIntersector(whole)
    faces, index, spots = caster.intersects_id(np.zeros_like(rays), rays, multiple_hits=True, return_locations=True)
    nearest, what = np.full(len(rays), np.inf), np.zeros(len(rays), int)
    body = np.repeat([1, 2, 3], [len(mesh.faces) for mesh in meshes])
    for face, ray, z in zip(faces, index, spots[:, 2], strict=True):
        if 0.01 < z < nearest[ray]:
            nearest[ray], what[ray] = z, body[face]
    agree = (what == seen.ravel()) & (np.abs(depth.ravel() / nearest - 1) < 1e-4)
    assert agree.mean() > 0.999  # Embree's single precision decides otherwise on a few edges
    assert set(np.unique(seen)) == {1, 2, 3}


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
@pytest.mark.parametrize(("count", "radius", "fine"), [(60_000, 0.4, 0.7), (2_000, 0.4, 0.7), (60_000, 0.07, 0.7)])
def test_a_cloud_on_a_sphere_is_the_sphere(camera, count, radius, fine):
    """Dense ones of many points in a pixel, and thin ones of pixels between points: no holes, and no swelling."""
    rng = np.random.default_rng(3)
    points = rng.normal(size=(count, 3))
    points *= radius / np.linalg.norm(points, axis=1, keepdims=True)
    centre = np.array([0.1, -0.05, 1.2])
    pose = np.concatenate((np.eye(3), centre[:, None]), axis=1)[None]
    depth, seen = draw([scan_of(points)], camera, pose, fine=fine)
    rays = rays_of(camera)
    a, b, c = (rays**2).sum(-1), rays @ centre, centre @ centre - radius**2
    inside = b * b - a * c
    exact = (b - np.sqrt(np.maximum(inside, 0))) / a
    union, both = (seen == 1) | (inside > 0), (seen == 1) & (inside > 0)
    assert both.sum() / union.sum() > (0.98 if radius < 0.1 else 0.995 if count > 2_000 else 0.97)
    well_inside = b * b - a * (centre @ centre - (0.85 * radius) ** 2) > 0
    assert (seen[well_inside] == 1).all()
    right = np.abs(depth / exact - 1)[well_inside] < (0.002 if count > 2_000 else 0.02)
    assert right.mean() > (
        0.999 if count > 2_000 else 0.99
    )  # of the thinnest, a pixel may see through to the other side


def test_a_slanted_plane_of_few_points_has_its_exact_depth():
    """Discs lie in the surface: flat ones that face the camera would be 5 % wrong here."""
    rng = np.random.default_rng(4)
    along, across = np.array([1.0, 0, 1.2]), np.array([0, 1.0, 0])
    points = np.array([0, 0, 2.0]) + rng.uniform(-3, 3, (40_000, 1)) * along + rng.uniform(-3, 3, (40_000, 1)) * across
    depth, seen = draw([scan_of(points[points[:, 2] > 0.3])], RADTAN)
    rays = rays_of(RADTAN)
    exact = 2 / (1 - 1.2 * rays[..., 0])  # z = 2 + 1.2 x, x = z * ray
    near = (exact > 0.5) & (exact < 4)
    assert near.sum() > 5_000
    assert (seen[near] == 1).mean() > 0.999
    right = np.abs(depth / exact - 1)[near & (seen == 1)] < 1e-3
    assert right.mean() > 0.999  # a pinhole that was closed has its neighbour's depth


def test_what_is_nearer_hides_and_what_has_no_code_is_not_drawn():
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0.0]])
    scan = scan_of(square, [[0, 1, 2], [0, 2, 3]])
    poses = np.stack([np.concatenate((np.eye(3), [[0], [0], [z]]), axis=1) for z in (2.0, 1.0)])
    depth, seen = draw([scan, scan], RADTAN, poses, [7, 9])
    assert (depth[50, 65], seen[50, 65]) == (1, 9)
    depth, seen = draw([scan, scan], RADTAN, poses, [7, 0])
    assert (depth[50, 65], seen[50, 65]) == (2, 7)
    assert np.isinf(depth[0, 0]) and seen[0, 0] == 0


def test_pinholes_are_closed_and_slits_stay_open():
    depth = np.full((9, 9), 1.0, np.float32)
    depth[2, 2] = depth[4:7, 6] = 3.0
    seen = np.where(depth > 2, 5, 4).astype(np.uint8)
    fill_pinholes(depth, seen)
    assert (depth[2, 2], seen[2, 2]) == (1.0, 4)
    assert depth[5, 6] == 3.0  # the middle of the slit; its two ends are closed, each having one neighbour
    assert (depth != 1).sum() == 1


def test_discs_lie_in_the_surface_and_leave_no_holes():
    rng = np.random.default_rng(6)
    points = np.concatenate((rng.uniform(0, 1, (5_000, 2)), np.zeros((5_000, 1))), axis=1)
    discs = discs_of(points)
    assert np.abs(discs.normal[:, 2]).min() > 0.999
    asked = rng.uniform(0.05, 0.95, (20_000, 2))
    covered = np.zeros(len(asked), bool)
    for place, radius in zip(discs.centre[:, :2], discs.radius, strict=True):
        covered |= ((asked - place) ** 2).sum(axis=1) <= radius**2
    assert covered.mean() > 0.999
    levels = disc_levels(points)
    assert [len(each.numbers) for each in levels] == sorted((len(each.numbers) for each in levels), reverse=True)
    assert len(levels[-1].numbers) <= 800
    assert np.median(levels[-1].discs.radius) > 2 * np.median(levels[0].discs.radius)
