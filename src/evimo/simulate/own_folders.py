"""A user's own textures and meshes: found, read once in each process, and told apart by their contents.

A folder is taken to stay as it is while the process lasts; `forget` makes it be read anew.
"""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from evimo.errors import NotFound
from evimo.scene.meshes.bank import MeshBank
from evimo.scene.meshes.files import load_meshes, mesh_files
from evimo.scene.own_files import OwnFiles, own_files
from evimo.scene.textures.bank import texture_bank
from evimo.scene.textures.natural import SUFFIXES, own_photos

KEPT = 4  # folders whose content is kept in memory


@dataclass(frozen=True)
class OwnFolders:
    """Folders of pictures that textures are cut from, and of meshes that things are; or None."""

    textures: Path | None = None
    meshes: Path | None = None

    def check(self) -> None:
        """Read everything once.

        Raises:
            NotFound: a folder is not there or has nothing to use. BadInput: it may not be read.
            BadFile: a file in it is damaged, or may not be read.

        Warns:
            EvimoWarning: how many files are left out.
        """
        for files in (self._pictures, self._meshes):
            if files is not None:
                files.warn()
                _ = files.sha256  # reads every file
        if self.textures is not None:
            own_photos(self.textures, 0)
        self.mesh_bank()

    def mesh_bank(self) -> MeshBank | None:
        """The meshes, if there is a folder of them."""
        return None if self.meshes is None else _meshes(self.meshes)

    def facts(self) -> dict[str, Any]:
        """Where the folders are and what is in them, for a recording's JSON."""
        each = {"textures": self._pictures, "meshes": self._meshes}
        return {
            name: {"folder": str(files.folder.resolve()), "sha256": files.sha256}
            for name, files in each.items()
            if files is not None
        }

    @property
    def _pictures(self) -> OwnFiles | None:
        return None if self.textures is None else _listed(self.textures, meshes=False)

    @property
    def _meshes(self) -> OwnFiles | None:
        return None if self.meshes is None else _listed(self.meshes, meshes=True)


OWN = OwnFolders()


def own_folders_of(facts: dict[str, Any]) -> OwnFolders:
    """The folders that a recording was made with, by what it tells of itself.

    Raises:
        NotFound: one is not there any more, or its files are others.
    """
    told: dict[str, Any] = {name: facts.get(name) for name in ("textures", "meshes")}
    folders = OwnFolders(**{name: Path(fact["folder"]) for name, fact in told.items() if fact})
    for name, fact in folders.facts().items():
        if fact["sha256"] != told[name]["sha256"]:
            raise NotFound(f"the {name} in {fact['folder']} are others than they were", fix="the folder as it was")
    return folders


def forget() -> None:
    """Read every folder anew when it is used next."""
    for cached in (_listed, _meshes, own_photos, texture_bank):
        cached.cache_clear()


@lru_cache(maxsize=KEPT)
def _listed(folder: Path, *, meshes: bool) -> OwnFiles:
    return mesh_files(folder) if meshes else own_files(folder, SUFFIXES, what="pictures")


@lru_cache(maxsize=KEPT)
def _meshes(folder: Path) -> MeshBank:
    return load_meshes(folder)
