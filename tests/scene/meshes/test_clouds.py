"""Surfaces of point clouds: of shapes that are known, and of real scans."""

import numpy as np
import pytest
from scipy.spatial import KDTree

from evimo.scene.meshes.clouds import CELLS, surface_of
from evimo.scene.meshes.files import read_mesh


def on_sphere(rng, number):
    ways = rng.normal(size=(number, 3))
    return ways / np.linalg.norm(ways, axis=1)[:, None]


def is_closed(triangles):
    edges = np.sort(np.concatenate((triangles[:, :2], triangles[:, 1:], triangles[:, ::2])), axis=1)
    return (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()


def distances(points, vertices, triangles):
    """From each point to the nearest of many places on the mesh."""
    rng = np.random.default_rng(0)
    shares = rng.dirichlet((1, 1, 1), (len(triangles), 6))
    places = np.einsum("tnc,tci->tni", shares, vertices[triangles]).reshape(-1, 3)
    return KDTree(places).query(points)[0]


def test_points_of_a_sphere_become_that_sphere():
    points = 0.1 * on_sphere(np.random.default_rng(0), 8000) + (3, -2, 1)
    vertices, triangles = surface_of(points)
    radius = np.linalg.norm(vertices - (3, -2, 1), axis=1)
    assert is_closed(triangles)
    assert np.median(radius) == pytest.approx(0.1, abs=0.4 * 0.2 / CELLS)
    assert np.abs(radius - 0.1).max() < 0.2 / CELLS
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    volume = abs(np.einsum("ti,ti->", a, np.cross(b, c))) / 6
    assert volume > 0.9 * 4 / 3 * np.pi * 0.1**3  # filled, not a shell of two skins


def test_a_sheet_of_points_becomes_a_thin_wall():
    points = np.random.default_rng(0).uniform((-1, -0.7, 0), (1, 0.7, 0), (20_000, 3))
    vertices, triangles = surface_of(points)
    assert is_closed(triangles)
    assert np.abs(vertices[:, 2]).max() < 1.0 * 2 / CELLS
    assert np.ptp(vertices, axis=0)[:2] == pytest.approx((2, 1.4), abs=4 / CELLS)


def test_stray_points_and_crumbs_are_left_out():
    rng = np.random.default_rng(1)
    ball, crumb = on_sphere(rng, 6000), 0.05 * on_sphere(rng, 60) + (1.3, 0, 0)
    vertices, _ = surface_of(np.concatenate((ball, crumb, rng.uniform(-1.5, 1.5, (20, 3)))))
    assert np.linalg.norm(vertices, axis=1).max() < 1.15


@pytest.mark.parametrize("points", [np.zeros((1000, 3)), np.eye(3), np.zeros((0, 3))])
def test_too_few_points_are_an_error(points):
    with pytest.raises(ValueError, match="do not make a surface"):
        surface_of(points)


@pytest.mark.parametrize("name", ["cup", "toy_car", "toy_plane"])
def test_real_scans_become_closed_meshes_within_a_cell_of_their_points(shared_data, name):
    file = shared_data(f"scans/{name}/model.ply")
    content = file.read_bytes()
    head = content.index(b"end_header\n") + 11
    number = int(content[:head].split(b"element vertex ")[1].split()[0])
    points = np.frombuffer(content, np.float32, 3 * number, head).reshape(-1, 3).astype(float)
    vertices, triangles = read_mesh(file)
    cell = np.ptp(points, axis=0).max() / CELLS
    assert is_closed(triangles)
    assert 5_000 < len(triangles) < 35_000
    assert np.median(distances(points[::10], vertices, triangles)) < 0.8 * cell
    assert np.percentile(KDTree(points).query(vertices)[0], 95) < 1.5 * cell
    assert np.ptp(vertices, axis=0) == pytest.approx(np.ptp(points, axis=0), abs=2 * cell)
