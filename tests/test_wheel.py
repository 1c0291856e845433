"""The wheel holds what running needs and nothing else, and runs where only the base dependencies are installed."""

import re
import subprocess
import sys
import venv
import zipfile
from collections.abc import Iterator
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
KINDS = "onnx", "first.onnx", "safetensors"
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built from this checkout without the network."""
    folder = tmp_path_factory.mktemp("wheel")
    offline = ["--no-deps", "--no-build-isolation", "--no-index", "--quiet", "--disable-pip-version-check"]
    subprocess.run([sys.executable, "-m", "pip", "wheel", *offline, "-w", str(folder), str(ROOT)], check=True)
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def clean_bin(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bin folder of an environment that holds this wheel and its base dependencies, linked from ours: no extras."""
    folder = tmp_path_factory.mktemp("clean") / "venv"
    venv.create(folder, with_pip=False)
    python = folder / "bin" / "python"
    offline = ["--no-deps", "--no-index", "--quiet", "--disable-pip-version-check"]
    subprocess.run([sys.executable, "-m", "pip", "--python", str(python), "install", *offline, str(wheel)], check=True)
    (site,) = folder.glob("lib/python*/site-packages")
    for name in needed_by("evimo"):
        for entry in top_level(distribution(name)):
            if not (site / entry.name).exists():
                (site / entry.name).symlink_to(entry)
    return python.parent


def needed_by(name: str, known: set[str] | None = None) -> Iterator[str]:
    """The installed distributions that `name` requires, directly or not, leaving extras out."""
    known = {name} if known is None else known
    for requirement in distribution(name).requires or []:
        other = re.split(r"[^\w.-]", requirement, maxsplit=1)[0]
        if "extra ==" in requirement or other in known or not is_installed(other):
            continue
        known.add(other)
        yield other
        yield from needed_by(other, known)


def is_installed(name: str) -> bool:
    """Requirements for other systems or Python versions are not."""
    try:
        return bool(distribution(name))
    except PackageNotFoundError:
        return False


def top_level(dist: Distribution) -> set[Path]:
    """The files and folders that a distribution puts directly into site-packages."""
    site = Path(str(dist.locate_file("")))
    return {site / file.parts[0] for file in dist.files or [] if file.parts[0] not in ("..", "__pycache__")}


def test_wheel_holds_weights_sample_licence_and_types(wheel: Path):
    names = set(zipfile.ZipFile(wheel).namelist())
    weights = {f"evimo/model/weights/{name}.{kind}" for name in ("base", "small", "tiny") for kind in KINDS}
    weights |= {f"evimo/model/weights/ecn.{kind}" for kind in KINDS if "first" not in kind}
    assert {"evimo/py.typed", "evimo/benchmark/page.html.jinja", *weights} <= names
    assert any(re.fullmatch(r"evimo/samples/[^/]+\.npz", name) for name in names)
    assert any(name.endswith(".dist-info/licenses/LICENSE") for name in names)


def test_wheel_holds_only_the_package(wheel: Path):
    names = zipfile.ZipFile(wheel).namelist()
    assert {name.split("/")[0].split("-")[0] for name in names} == {"evimo"}
    assert [name for name in names if "__pycache__" in name or "/tests/" in name or "/docs/" in name] == []


def test_wheel_stays_small(wheel: Path):
    assert wheel.stat().st_size < 17e6  # the sample may have 3 MB, the weights the rest
    weights = [each for each in zipfile.ZipFile(wheel).infolist() if each.filename.startswith("evimo/model/weights/")]
    assert sum(each.file_size for each in weights if "/ecn." not in each.filename) < 15e6
    assert sum(each.file_size for each in weights) < 16e6


def test_wheel_runs_without_extras(clean_bin: Path, tmp_path: Path):
    def run(*command: str | Path) -> subprocess.CompletedProcess[str]:
        return subprocess.run([str(part) for part in command], cwd=tmp_path, capture_output=True, text=True)

    assert "ModuleNotFoundError" in run(clean_bin / "python", "-c", "import torch").stderr
    located = run(clean_bin / "python", "-c", "import evimo.samples; print(evimo.samples.path())")
    sample = located.stdout.strip()
    assert str(clean_bin.parent) in sample, located.stderr
    ran = run(clean_bin / "evimo", "run", sample, "--stop", "0.3", "--out", "out")
    assert ran.returncode == 0, ran.stderr
    assert {"video.mp4", "egomotion.csv", "objects.csv", "summary.json"} <= {
        file.name for file in Path(tmp_path, "out").iterdir()
    }
