"""Trees of boxes: what must hold of them whatever the triangles are."""

import time

import numpy as np
import pytest

from evimo.scene.meshes.trees import LEAF, corner_normals, escapes, grow


def boxes_of(rng, number, spread):
    middle = rng.normal(size=(number, 3)) * spread
    half = rng.exponential(0.05, (number, 3))
    return np.concatenate((middle - half, middle + half), axis=1).astype(np.float32)


@pytest.mark.parametrize("number", [1, 2, 5, 300])
@pytest.mark.parametrize("spread", [(1, 1, 1), (1, 0, 0), (0, 0, 0)])
def test_every_triangle_is_in_one_leaf_within_all_boxes_above_it(number, spread):
    triangles = boxes_of(np.random.default_rng(number), number, spread)
    boxes, nodes, order = grow(triangles)
    assert sorted(order) == list(range(number))
    seen = np.zeros(number, int)

    def visit(node, above):
        assert (boxes[node, :3] >= above[:3]).all() and (boxes[node, 3:] <= above[3:]).all()
        first, count, second, _ = nodes[node]
        if not count:
            visit(node + 1, boxes[node])
            visit(second, boxes[node])
            return
        assert count <= LEAF
        for k in order[first : first + count]:
            seen[k] += 1
            assert (triangles[k, :3] >= boxes[node, :3]).all() and (triangles[k, 3:] <= boxes[node, 3:]).all()

    visit(0, boxes[0])
    assert (seen == 1).all()


def test_missing_every_box_or_none_ends_after_at_most_all_nodes():
    boxes, nodes, _ = grow(boxes_of(np.random.default_rng(0), 200, (1, 1, 1)))
    misses = escapes(nodes)
    assert (misses[:, 0] == -1).all()
    for octant in range(8):
        visited, node = [], 0
        while node >= 0:
            visited.append(node)
            leaf, second, axis = nodes[node, 1] > 0, nodes[node, 2], nodes[node, 3]
            node = misses[octant, node] if leaf else (second if octant >> axis & 1 else node + 1)
        assert sorted(visited) == list(range(len(nodes)))
        inner = [n for n in visited if nodes[n, 1] == 0]
        place = {n: k for k, n in enumerate(visited)}
        for n in inner:  # the child that lies first along the ray comes first
            axis = nodes[n, 3]
            low, high = sorted((n + 1, nodes[n, 2]), key=lambda m: place[m], reverse=bool(octant >> axis & 1))
            assert boxes[low, axis] + boxes[low, 3 + axis] <= boxes[high, axis] + boxes[high, 3 + axis] + 0.5


@pytest.mark.slow
def test_a_hundred_thousand_triangles_take_less_than_a_second():
    triangles = boxes_of(np.random.default_rng(1), 100_000, (1, 1, 1))
    grow(triangles[:100])
    start = time.process_time()
    grow(triangles)
    assert time.process_time() - start < 1


@pytest.mark.slow
def test_a_fan_of_thousands_of_triangles_around_one_vertex_takes_no_longer_than_others():
    angle = np.linspace(0, 2 * np.pi, 100_001)[:-1]
    rim = np.stack((np.cos(angle), np.sin(angle), 0 * angle), axis=1)
    triangles = np.stack(
        (np.zeros(len(rim), int), np.arange(1, len(rim) + 1), np.roll(np.arange(1, len(rim) + 1), -1)), 1
    )
    areas = np.cross(rim, np.roll(rim, -1, axis=0))
    corner_normals(areas[:4], triangles[:4], 6, 0.77)
    start = time.process_time()
    normals = corner_normals(areas, triangles, len(rim) + 1, 0.77)
    assert time.process_time() - start < 3
    assert normals == pytest.approx(np.tile((0, 0, 1), (len(rim), 3)), abs=1e-6)
