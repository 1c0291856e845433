"""Scans as they come: triangles and points, in text and binary, EV-IMO's own, and what is refused."""

import numpy as np
import pytest

from evimo.captures.scans import load_scan
from evimo.errors import BadFile, NotFound

CORNERS = np.array([[0, 0, 0], [100, 0, 0], [0, 200, 0], [0, 0, 300.0]])
FACES = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])


def write_ply(path, corners, faces, *, binary):
    form = "binary_little_endian" if binary else "ascii"
    head = f"ply\nformat {form} 1.0\nelement vertex {len(corners)}\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz")
    head += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    if binary:
        rows = np.array([(3, face) for face in faces.tolist()], [("n", "u1"), ("face", "<i4", 3)])
        body = corners.astype("<f4").tobytes() + rows.tobytes()
    else:
        lines = [" ".join(map(str, row)) for row in corners.tolist()] + [f"3 {a} {b} {c}" for a, b, c in faces.tolist()]
        body = ("\n".join(lines) + "\n").encode()
    path.write_bytes(head.encode() + body)
    return path


@pytest.mark.parametrize("binary", [True, False])
@pytest.mark.parametrize("faces", [FACES, FACES[:0]])
def test_triangles_and_points_are_read_in_their_unit(tmp_path, binary, faces):
    scan = load_scan(write_ply(tmp_path / "a.ply", CORNERS, faces, binary=binary), unit="mm")
    np.testing.assert_allclose(scan.points, CORNERS / 1000, atol=1e-7)
    np.testing.assert_array_equal(scan.triangles, faces)
    assert scan.is_cloud == (len(faces) == 0)
    assert scan.markers.shape == (0, 3)


def test_a_folder_holds_the_scan_and_its_markers(tmp_path):
    write_ply(tmp_path / "model.ply", CORNERS, FACES, binary=True)
    (tmp_path / "config.txt").write_text("1 10 20 30\n# seen twice\n\n2 40 50 60\n")
    np.testing.assert_allclose(load_scan(tmp_path, unit="mm").markers, [[0.01, 0.02, 0.03], [0.04, 0.05, 0.06]])
    np.testing.assert_allclose(load_scan(tmp_path / "model.ply").markers[1], [40, 50, 60])


def test_what_a_depth_camera_did_not_see_is_left_out(tmp_path):
    points = CORNERS.copy()
    points[1] = np.nan
    scan = load_scan(write_ply(tmp_path / "a.ply", points, FACES[:0], binary=True))
    np.testing.assert_allclose(scan.points, CORNERS[[0, 2, 3]])
    with pytest.raises(BadFile, match="no numbers"):
        load_scan(write_ply(tmp_path / "b.ply", points, FACES, binary=True))


@pytest.mark.parametrize(
    ("name", "count", "markers"), [("toy_car", 128_275, 5), ("toy_plane", 268_810, 5), ("cup", 58_210, 6)]
)
def test_the_scans_of_ev_imo_are_read(shared_data, name, count, markers):
    scan = load_scan(shared_data(f"scans/{name}"))
    assert (len(scan.points), len(scan.triangles), len(scan.markers)) == (count, 0, markers)
    reach = np.ptp(scan.points, axis=0)
    assert 0.05 < reach.max() < 0.5  # a toy, in metres
    inside = (scan.markers > scan.points.min(axis=0) - 0.02) & (scan.markers < scan.points.max(axis=0) + 0.02)
    assert inside.all()


def test_what_is_no_scan_is_said_with_its_place(tmp_path):
    write_ply(tmp_path / "model.ply", CORNERS, FACES, binary=True)
    (tmp_path / "config.txt").write_text("1 10 20 30\n2 40 fifty 60\n")
    with pytest.raises(BadFile, match=r"config\.txt, line 2"):
        load_scan(tmp_path)
    (tmp_path / "cut.ply").write_bytes((tmp_path / "model.ply").read_bytes()[:-10])
    with pytest.raises(BadFile, match=r"cut\.ply"):
        load_scan(tmp_path / "cut.ply")
    with pytest.raises(BadFile, match="beyond its 4"):
        load_scan(write_ply(tmp_path / "far.ply", CORNERS, FACES + 1, binary=True))
    with pytest.raises(NotFound, match="none"):
        load_scan(tmp_path / "none.ply")
    (tmp_path / "empty").mkdir()
    with pytest.raises(NotFound, match=r"model\.ply"):
        load_scan(tmp_path / "empty")
