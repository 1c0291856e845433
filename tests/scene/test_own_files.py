"""Digests of folders."""

from evimo.scene.own_files import own_files


def digest(folder):
    return own_files(folder, (".obj",), what="meshes", deep=True).sha256


def test_a_digest_is_of_names_and_contents_of_the_files_that_are_taken(tmp_path):
    for place in ("one", "two/below"):
        folder = tmp_path / place
        folder.mkdir(parents=True)
        (folder / "a.obj").write_text("first")
        (folder / "b.obj").write_text("second")
    one, two = tmp_path / "one", tmp_path / "two" / "below"
    same = digest(one)
    assert same == digest(two) and len(same) == 64
    (one / "notes.txt").write_text("not a mesh")
    assert digest(one) == same
    (one / "b.obj").write_text("secondly")
    assert digest(one) != same
    (two / "b.obj").rename(two / "c.obj")
    assert digest(two) != same
    (two / "a.obj").write_text("firstc.obj")
    (two / "c.obj").write_text("second")
    assert digest(two) != same
