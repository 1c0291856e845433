import numpy as np
import pytest

from evimo.scene.bodies import BOX, CYLINDER, ELLIPSOID, MESH
from evimo.scene.drawing.objects import LARGEST, MESHES, SMALLEST, compound, reach, size_of
from evimo.scene.drawing.paint import Paint
from evimo.scene.drawing.pools import POOLS
from evimo.scene.meshes.bank import mesh_bank


def is_inside(part, points):
    """Whether points (N, 3) of the body are within a part."""
    x, y, z = ((points - part.position) @ part.rotation / part.half).T
    if part.shape == BOX:
        return np.maximum(np.maximum(abs(x), abs(y)), abs(z)) <= 1
    if part.shape == ELLIPSOID:
        return x**2 + y**2 + z**2 <= 1
    return (x**2 + y**2 <= 1) & (abs(z) <= 1)


@pytest.mark.parametrize("seed", range(20))
def test_parts_touch_and_the_whole_is_as_large_as_a_hand_or_a_shoebox(seed, bank):
    rng = np.random.default_rng(seed)
    parts = compound(rng, Paint(bank, 0.5, (0.5, 2), (0.1, 0.3)))
    share = np.linspace(0, 1, 500)[:, None]
    joined = {0}
    for _ in parts:
        for i, part in enumerate(parts):
            between = [part.position + share * (parts[j].position - part.position) for j in joined]
            if any((is_inside(part, b) & is_inside(parts[j], b)).any() for j, b in zip(joined, between, strict=True)):
                joined = joined | {i}
    assert joined == set(range(len(parts)))
    points = rng.uniform(-LARGEST, LARGEST, (100_000, 3))
    extent = np.ptp(points[np.any([is_inside(part, points) for part in parts], axis=0)], axis=0).max()
    assert 0.6 * SMALLEST < extent <= LARGEST * 1.01


@pytest.mark.parametrize("shape", [BOX, ELLIPSOID, CYLINDER])
def test_reach_ends_at_the_surface(shape, bank):
    rng = np.random.default_rng(0)
    part = next(
        p for _ in range(100) for p in compound(rng, Paint(bank, 0.5, (0.5, 2), (0.1, 0.3))) if p.shape == shape
    )
    way = rng.normal(size=(50, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    ends = np.array([reach(shape, part.half, w) for w in way])[:, None] * way @ part.rotation.T
    assert is_inside(part, part.position + 0.999 * ends).all()
    assert not is_inside(part, part.position + 1.001 * ends).any()


@pytest.fixture(scope="module")
def meshes():
    """Three tetrahedra, each twice as high (z) as wide."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 2]])
    faces = np.array([[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]])
    return mesh_bank([(corners, faces)] * 3)


def test_some_things_are_the_users_meshes_and_pools_share_none(bank, meshes):
    paint, seen = Paint(bank, 0.5, (0.5, 2), (0.1, 0.3)), {}
    for part, pool in POOLS.items():
        drawn = [compound(np.random.default_rng(seed), paint, pool, meshes) for seed in range(300)]
        own = [parts for parts in drawn if parts[0].shape == MESH]
        assert len(own) / len(drawn) == pytest.approx(MESHES, abs=0.1)
        assert all(SMALLEST <= 2 * parts[0].half[0] <= LARGEST for parts in own)
        seen[part] = {parts[0].mesh for parts in own}
    assert seen == {"train": {0, 2}, "test": {1}}


def test_a_mesh_is_as_large_as_its_triangles(bank, meshes):
    paint = Paint(bank, 0.5, (0.5, 2), (0.1, 0.3))
    parts = next(p for k in range(99) if (p := compound(np.random.default_rng(k), paint, None, meshes))[0].mesh >= 0)
    half = parts[0].half[0]
    np.testing.assert_allclose(size_of(parts, meshes), [half / 2, half / 2, half], rtol=1e-6)
