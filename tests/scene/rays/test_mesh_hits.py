"""Rays against triangles: by another program, and by what is known of closed surfaces."""

import numba
import numpy as np
import pytest

from evimo.scene.meshes.bank import NO_MESHES, mesh_bank
from evimo.scene.meshes.clouds import surface_of
from evimo.scene.meshes.files import read_mesh
from evimo.scene.rays.mesh_hits import hit_mesh, mesh_normal

FAR = np.float32(1e9)
SIDE = 90  # rays each way


def sphere(fineness):
    trimesh = pytest.importorskip("trimesh")
    ball = trimesh.creation.icosphere(fineness)
    return np.asarray(ball.vertices), np.asarray(ball.faces)


def torus(around, across):
    u, v = np.mgrid[0:around, 0:across]
    a, b = u * 2 * np.pi / around, v * 2 * np.pi / across
    wide = 1 + 0.35 * np.cos(b)
    vertices = np.stack((wide * np.cos(a), wide * np.sin(a), 0.35 * np.sin(b)), axis=-1).reshape(-1, 3)

    def at(i, j):
        return i % around * across + j % across

    one = np.stack((at(u, v), at(u + 1, v), at(u + 1, v + 1)), axis=-1)
    two = np.stack((at(u, v), at(u + 1, v + 1), at(u, v + 1)), axis=-1)
    return vertices, np.concatenate((one, two)).reshape(-1, 3)


@numba.njit(error_model="numpy")  # not cached: the cache would not see that hit_mesh has changed
def _cast(bank, mesh, origins, directions, depth, found):
    for k in range(len(origins)):
        o, d = origins[k], directions[k]
        depth[k], found[k] = hit_mesh(
            bank.boxes, bank.nodes, bank.misses, bank.corners, bank.roots[mesh], o[0], o[1], o[2], d[0], d[1], d[2], FAR
        )


def cast(bank, origins, directions, mesh=0):
    depth, found = np.empty(len(origins), np.float32), np.empty(len(origins), np.int32)
    _cast(bank, mesh, np.float32(origins), np.float32(directions), depth, found)
    return depth, found


def camera_rays(rng):
    """From a point 3 units away, over the whole mesh and past it; the parameter is depth, as in the renderer."""
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, SIDE), np.linspace(-0.5, 0.5, SIDE))
    rays = np.stack((x.ravel(), y.ravel(), np.ones(x.size)), axis=1) + rng.normal(0, 1e-3, (x.size, 3)) * (1, 1, 0)
    return np.float32(np.tile(turn @ (0.1, -0.05, -3.0), (x.size, 1))), np.float32(rays @ turn.T)


def same_as_embree(bank, mesh=0):
    trimesh = pytest.importorskip("trimesh")
    embree = pytest.importorskip("trimesh.ray.ray_pyembree")
    pytest.importorskip("embreex")
    last = list(bank.roots[1:]) + [len(bank.nodes)]
    nodes = bank.nodes[bank.roots[mesh] : last[mesh]]
    mine = np.sort([k for first, count, _, _ in nodes for k in range(first, first + count)])
    corners = bank.corners[mine].reshape(-1, 3).astype(np.float64)
    solid = trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False)
    tracer = embree.RayMeshIntersector(solid, scale_to_box=False)
    for seed in range(4):
        origins, rays = camera_rays(np.random.default_rng(seed))
        depth, found = cast(bank, origins, rays, mesh)
        face, ray, where = tracer.intersects_id(origins, rays, multiple_hits=False, return_locations=True)
        theirs = np.full(len(rays), -1)
        theirs[ray] = mine[face]
        z = ((where - origins[ray]) * rays[ray]).sum(axis=1) / (rays[ray] ** 2).sum(axis=1)
        facing = (
            np.abs((solid.face_normals[face] * rays[ray]).sum(axis=1)) > 0.02
        )  # float32 cannot say where others end
        assert 0.05 < (theirs >= 0).mean() < 0.95
        np.testing.assert_array_equal(found >= 0, theirs >= 0)
        assert facing.mean() > 0.99 and np.abs(depth[ray] - z)[facing].max() < 1e-5
        assert (found == theirs).mean() > 0.999  # of two triangles that meet in the ray either may be named


def test_embree_hits_the_same_sphere_and_torus():
    bank = mesh_bank([sphere(4), torus(120, 60)])
    same_as_embree(bank, 0)
    same_as_embree(bank, 1)


def test_embree_hits_the_same_scan(shared_data):
    same_as_embree(mesh_bank([read_mesh(shared_data("scans/toy_plane/model.ply"))]))


def test_a_sphere_is_where_its_formula_says():
    bank = mesh_bank([sphere(6)])
    origins, rays = camera_rays(np.random.default_rng(9))
    depth, found = cast(bank, origins, rays)
    a, b = (rays**2).sum(axis=1), (origins * rays).sum(axis=1)
    root = b**2 - a * ((origins**2).sum(axis=1) - 1)
    clear = np.abs(root) > 0.05 * a  # not past its rim
    np.testing.assert_array_equal(found[clear] >= 0, root[clear] > 0)
    known = (-b - np.sqrt(np.maximum(root, 0))) / a
    assert np.abs(depth - known)[clear & (root > 0)].max() < 2e-3


@pytest.mark.parametrize("name", ["sphere", "torus", "cube"])
def test_no_ray_leaves_a_closed_mesh_between_its_triangles(name):
    """Aimed at corners and edges from within, where rounding decides which triangle is hit."""
    rng = np.random.default_rng(4)
    cube = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, 8).T, None
    vertices, faces = {"sphere": lambda: sphere(4), "torus": lambda: torus(64, 32), "cube": lambda: cube}[name]()
    if faces is None:
        faces = np.array([(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)]
                         + [(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)])  # fmt: skip
        assert (
            len(np.unique(np.sort(np.concatenate((faces[:, :2], faces[:, 1:], faces[:, ::2])), axis=1), axis=0)) == 18
        )
    bank = mesh_bank([(vertices.astype(float), faces)])
    inside = (1 / 1.35, 0.0, 0.0) if name == "torus" else (0.0, 0.0, 0.0)
    three = bank.corners.reshape(-1, 3, 3)
    k, share = rng.integers(len(three), size=20_000), rng.random((20_000, 1)).astype(np.float32)
    edges = three[k, 0] * share + three[k, 1] * (1 - share)
    targets = np.concatenate((three.reshape(-1, 3), edges, rng.normal(size=(20_000, 3))))
    origins = np.float32(inside) + np.float32(rng.normal(0, 0.05, targets.shape))
    _, found = cast(bank, origins, (targets - origins) * np.float32(rng.uniform(0.1, 20, (len(targets), 1))))
    assert (found >= 0).all()


def test_rays_along_axes_and_away():
    bank = mesh_bank([torus(40, 20)])
    ways = np.concatenate((np.eye(3), -np.eye(3)))
    depth, found = cast(bank, -3 * ways + 0.02, ways)
    assert (found[[0, 1, 3, 4]] >= 0).all() and (found[[2, 5]] < 0).all()  # along z, through its hole
    assert depth[[0, 1, 3, 4]] == pytest.approx(np.full(4, 2.0), abs=0.05)
    depth, found = cast(bank, 3 * ways, ways)
    assert (found < 0).all() and (depth == FAR).all()


def test_normals_are_smooth_on_a_sphere_and_sharp_at_the_edges_of_a_cube():
    bank = mesh_bank([sphere(3)])
    origins, rays = camera_rays(np.random.default_rng(1))
    depth, found = cast(bank, origins, rays)
    for k in np.flatnonzero(found >= 0)[::97]:
        hit = np.float32(origins[k] + depth[k] * rays[k])
        *normal, _ = mesh_normal(bank.corners, bank.normals, found[k], *hit, *np.float32(rays[k]))
        assert normal @ (hit / np.linalg.norm(hit)) > 0.999
    square = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], float)
    low, high = (np.column_stack((square, np.full(4, z))) for z in (-0.5, 0.5))
    side = [((i, j, 4 + j), (i, 4 + j, 4 + i)) for i, j in ((0, 1), (1, 2), (2, 3), (3, 0))]
    faces = np.array([(0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), *(face for pair in side for face in pair)])
    box = mesh_bank([(np.concatenate((low, high)), faces)])
    for x, y in ((0.0, 0.0), (0.999, -0.3), (-0.2, 0.9999)):
        origin, ray = np.float32([[x, y, 2]]), np.float32([[0, 0, -2]])
        depth, found = cast(box, origin, ray)
        hit = (origin + depth[:, None] * ray)[0]
        nx, ny, nz, axis = mesh_normal(box.corners, box.normals, found[0], *hit, *ray[0])
        assert (nx, ny, nz, axis) == pytest.approx((0, 0, 1, 2), abs=1e-6)
        assert mesh_normal(box.corners, box.normals, found[0], *hit, *-ray[0])[2] == pytest.approx(
            -1
        )  # seen from within


def test_an_empty_bank_has_the_types_of_a_full_one():
    full = mesh_bank([sphere(0), surface_of(sphere(3)[0])])
    assert full.number == 2 and NO_MESHES.number == 0
    for some, none in zip(full, NO_MESHES, strict=True):
        assert some.dtype == none.dtype and some.ndim == none.ndim and some.flags.c_contiguous
