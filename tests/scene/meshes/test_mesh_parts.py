"""Meshes in a scene: a box and a ball made of triangles look like those that formulas give."""

from dataclasses import replace

import numpy as np
import pytest

from evimo.scene.bodies import BOX, ELLIPSOID, MESH, Body, Part, Scene
from evimo.scene.meshes.bank import mesh_bank
from evimo.scene.renderer import Renderer

trimesh = pytest.importorskip("trimesh")
TIMES = np.array([0.0, 0.13, 0.4])


def ball_and_brick(scene, *, as_meshes):
    """The small scene with every box of its movers as a brick of 3:2:4 and every ellipsoid as a ball."""
    brick, ball = trimesh.creation.box((3, 2, 4)), trimesh.creation.icosphere(5)
    bank = mesh_bank([(np.asarray(solid.vertices), np.asarray(solid.faces)) for solid in (brick, ball)])

    def changed(part: Part) -> Part:
        if part.inside or part.shape not in (BOX, ELLIPSOID):
            return part
        long = part.half.max()
        if as_meshes:
            return replace(part, shape=MESH, half=np.full(3, long), mesh=0 if part.shape == BOX else 1)
        return replace(part, half=long * (np.array((0.75, 0.5, 1.0)) if part.shape == BOX else np.ones(3)))

    bodies = tuple(replace(body, parts=tuple(changed(part) for part in body.parts)) for body in scene.bodies)
    return replace(scene, bodies=bodies, meshes=bank)


def plain(scene: Scene) -> Scene:
    """Without patterns: the coordinates of textures on meshes are others."""

    def painted(body: Body) -> Body:
        grey = (replace(part, surface=replace(part.surface, dark=0.4, bright=0.4)) for part in body.parts)
        return replace(body, parts=tuple(grey))

    return replace(scene, bodies=tuple(painted(body) for body in scene.bodies))


def test_triangles_look_like_the_formulas_of_the_same_shapes(small_scene, camera):
    scene = plain(small_scene)
    known = Renderer(ball_and_brick(scene, as_meshes=False), camera)
    made = Renderer(ball_and_brick(scene, as_meshes=True), camera)
    one, two = known.frames(TIMES), made.frames(TIMES)
    ids = [renderer.packed.ids[frames.tags >> 3] for renderer, frames in ((known, one), (made, two))]
    assert (ids[0] > 0).mean() > 0.05
    same = (one.tags >> 3) == (two.tags >> 3)
    assert same.mean() > 0.995
    assert np.abs(one.depth - two.depth)[same].max() < 5e-3
    assert np.percentile(np.abs(one.image - two.image)[same], 99) < 5e-3


def test_the_truth_of_a_mesh_is_that_of_its_body(small_scene, camera):
    known, made = (
        Renderer(ball_and_brick(small_scene, as_meshes=kind), camera).truth(130_000) for kind in (False, True)
    )
    assert (known.ids == made.ids).mean() > 0.995
    for id_, moved in known.objects.items():
        assert made.objects[id_].velocity == pytest.approx(moved.velocity)


def test_a_mesh_has_a_texture_without_smears(small_scene, camera):
    """Wherever a surface faces, its pattern varies about as much as that of the same box."""
    known, made = (
        Renderer(ball_and_brick(small_scene, as_meshes=kind), camera).frames(TIMES) for kind in (False, True)
    )
    mesh = (known.tags >> 3) == (made.tags >> 3)
    mesh &= np.isin(made.tags >> 3, [2, 3])
    assert mesh.sum() > 100
    assert made.image[mesh].std() > 0.6 * known.image[mesh].std()
