"""Folders of meshes as users have them: every format, scans, strangers among them, and damaged files."""

import pickle
import warnings

import numpy as np
import pytest

from evimo.errors import BadFile, EvimoWarning, NotFound
from evimo.scene.meshes.bank import mesh_bank
from evimo.scene.meshes.files import SUFFIXES, load_meshes, mesh_files, read_mesh

trimesh = pytest.importorskip("trimesh")
TENT = b"v 0 0 0\nv 4 0 0\nv 0 2 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
HEADER = b"ply\nformat %s 1.0\nelement vertex %d\nproperty float x\nproperty float y\nproperty float z\n"


def ball(rng, number=3000):
    ways = rng.normal(size=(number, 3))
    return (ways / np.linalg.norm(ways, axis=1)[:, None]).astype("<f4")


@pytest.mark.parametrize("suffix", [*SUFFIXES, ".PLY"])
def test_every_format_gives_the_same_mesh(tmp_path, suffix):
    file = tmp_path / f"brick{suffix}"
    trimesh.creation.box((1, 2, 3)).export(file, file_type=suffix[1:].lower())
    bank = load_meshes(tmp_path)
    assert bank.extent[0] == pytest.approx((1 / 3, 2 / 3, 1))
    assert len(bank.corners) == 12
    assert bank.corners.reshape(-1, 3).min(axis=0) == pytest.approx((-1 / 3, -2 / 3, -1))
    assert bank.radius[0] == pytest.approx(np.sqrt(14) / 3)
    each = np.abs(bank.normals.reshape(-1, 3))
    assert np.sort(each, axis=1) == pytest.approx(np.tile((0, 0, 1), (36, 1)), abs=1e-6)


def test_all_parts_of_a_file_are_one_mesh_where_they_stand(tmp_path):
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.creation.box((1, 1, 1)))
    scene.add_geometry(trimesh.creation.box((1, 1, 1)), transform=trimesh.transformations.translation_matrix((3, 0, 0)))
    scene.export(tmp_path / "two.glb")
    vertices, triangles = read_mesh(tmp_path / "two.glb")
    assert len(triangles) == 24
    assert np.ptp(vertices, axis=0) == pytest.approx((4, 1, 1))


@pytest.mark.parametrize("tail", [b"", b"\n", b"\0" * 7])
@pytest.mark.parametrize(
    "faces", [b"", b"element face 0\n", b"element face 0\nproperty list uchar int vertex_indices\n"]
)
def test_points_alone_are_meshed_whatever_the_scanner_adds(tmp_path, faces, tail):
    points = ball(np.random.default_rng(0))
    header = HEADER % (b"binary_little_endian", len(points)) + faces + b"end_header\n"
    (tmp_path / "scan.ply").write_bytes(header + points.tobytes() + tail)
    vertices, triangles = read_mesh(tmp_path / "scan.ply")
    assert len(triangles) > 1000
    assert np.linalg.norm(vertices, axis=1) == pytest.approx(np.ones(len(vertices)), abs=0.06)


def test_points_in_text_are_meshed_too(tmp_path):
    points = ball(np.random.default_rng(0), 1500)
    rows = "\n".join(" ".join(f"{v:.5f}" for v in point) for point in points)
    (tmp_path / "scan.ply").write_bytes(HEADER % (b"ascii", len(points)) + b"end_header\n" + rows.encode())
    (tmp_path / "scan.obj").write_text("".join(f"v {x:.5f} {y:.5f} {z:.5f}\n" for x, y, z in points))
    for mesh in (read_mesh(tmp_path / "scan.ply"), read_mesh(tmp_path / "scan.obj")):
        assert np.linalg.norm(mesh[0], axis=1) == pytest.approx(np.ones(len(mesh[0])), abs=0.1)


def test_files_come_by_name_from_folders_too_and_strangers_are_counted(tmp_path):
    for name in ("b.obj", "deep/er/a.obj", "C.OBJ", ".hidden.obj", "._b.obj", ".git/x.obj"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(TENT)
    for name in ("notes.txt", "b.mtl", "deep/photo.jpg"):
        (tmp_path / name).write_bytes(b"?")
    found = mesh_files(tmp_path)
    assert [file.relative_to(tmp_path).as_posix() for file in found.files] == ["C.OBJ", "b.obj", "deep/er/a.obj"]
    with pytest.warns(EvimoWarning, match="3 of 6 files in .* are no meshes") as caught:
        found.warn()
    assert len(caught) == 1
    assert load_meshes(tmp_path).number == 3


def test_of_a_scanned_object_with_markers_the_scan_alone_is_taken(tmp_path):
    for name in ("cup/model.ply", "cup/cup_marker_1.ply", "cup/config.txt", "other/part.ply", "other/model.ply"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"?")
    found = mesh_files(tmp_path)
    names = [file.relative_to(tmp_path).as_posix() for file in found.files]
    assert names == ["cup/model.ply", "other/model.ply", "other/part.ply"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found.warn()


@pytest.mark.parametrize("made", [False, True])
def test_no_folder_and_no_mesh_in_it_are_errors_that_say_what_to_do(tmp_path, made):
    folder = tmp_path / "things"
    if made:
        folder.mkdir()
        (folder / "readme.md").write_text("nothing here")
    with pytest.raises(NotFound, match=r"things\n  try: a folder with .*\.ply"):
        load_meshes(folder)


BAD = {
    "empty.ply": b"",
    "noise.ply": bytes(range(256)),
    "noise.stl": bytes(range(256)) * 3,
    "noise.glb": b"glTF" + bytes(range(256)),
    "noise.off": b"\x89PNG",
    "noise.obj": b"\x89PNG\r\n",
    "short.off": b"OFF\n3 1 0\n0 0 0\n",
    "beyond.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n",
    "beyond.ply": HEADER % (b"ascii", 3)
    + b"element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n",
    "cut.ply": HEADER % (b"binary_little_endian", 500) + b"end_header\n" + bytes(300),
    "huge.ply": HEADER % (b"binary_little_endian", 10**13) + b"end_header\n" + bytes(300),
    "words.ply": b"ply\nformat ascii 1.0\nelement vertex many\nend_header\n",
    "line.obj": b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n",
    "nan.obj": b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "points.obj": b"v 1 2 3\nv 4 5 6\n",
    "same.ply": HEADER % (b"binary_little_endian", 500) + b"end_header\n" + bytes(6000),
}


@pytest.mark.parametrize("name", BAD)
def test_a_damaged_file_is_one_error_with_its_name_and_what_to_do(tmp_path, name):
    (tmp_path / "good.obj").write_bytes(TENT)
    (tmp_path / name).write_bytes(BAD[name])
    with pytest.raises(BadFile, match=rf"{name}.*\n  try: .*take it out of the folder"):
        load_meshes(tmp_path)


def test_nothing_is_unpickled_and_no_other_file_is_opened(tmp_path, monkeypatch):
    (tmp_path / "secret").mkdir()
    (tmp_path / "secret" / "paint.mtl").write_text("newmtl red\nmap_Kd ../photo.png\n")
    (tmp_path / "things").mkdir()
    (tmp_path / "things" / "tent.obj").write_bytes(b"mtllib ../secret/paint.mtl\nusemtl red\n" + TENT)
    (tmp_path / "things" / "code.ply").write_bytes(pickle.dumps(print))
    opened = []
    monkeypatch.setattr("pickle.loads", lambda *a, **k: pytest.fail("unpickled"))
    monkeypatch.setattr("builtins.open", lambda name, *a, **k: opened.append(name) or pytest.fail("opened"))
    vertices, triangles = read_mesh(tmp_path / "things" / "tent.obj")
    assert (len(vertices), len(triangles)) == (4, 4) and not opened
    with pytest.raises(BadFile):
        read_mesh(tmp_path / "things" / "code.ply")


def test_a_mesh_is_centred_and_keeps_its_proportions():
    vertices = np.array([(10, 0, 0), (14, 0, 0), (10, 2, 0), (10, 0, 1)], float)
    bank = mesh_bank([(vertices, np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]))])
    corners = bank.corners.reshape(-1, 3)
    assert corners.min(axis=0) == pytest.approx((-1, -0.5, -0.25))
    assert corners.max(axis=0) == pytest.approx((1, 0.5, 0.25))
