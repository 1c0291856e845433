"""`evimo download`: fetch EV-IMO."""

from pathlib import Path
from typing import Literal

from evimo.cli.progress import progress
from evimo.errors import BadInput
from evimo.writing import make_folder


def download(
    *names: str, kind: Literal["npz", "txt", "raw"] = "npz", out: Path | None = None, mirror: str | None = None
) -> None:
    """Fetch archives of EV-IMO, or list them with their sizes where no folder is given.

    evimo download paper2019 --out /data/evimo

    The same command again goes on where it stopped. Each archive is checked against the sum inside it, and later
    against SHA256SUMS in the folder. Unpack them with `tar -xzf`.

    Args:
        names: `eval/box` and so on, `train`, `eval`, or a published split such as `paper2019`; all without any.
        kind: `npz`, `txt`, or `raw`, which are bags.
        out: folder for the archives.
        mirror: address of another server with the same archives.
    """
    from evimo.recordings.downloading import HOST, archives, fetch

    if mirror is not None and not mirror.startswith(("http://", "https://")):
        raise BadInput(f"{mirror!r} is no address", fix="--mirror https://HOST/FOLDER")
    wanted = archives(names, kind, host=(mirror or HOST).rstrip("/"))
    total = sum(archive.gb for archive in wanted)
    for archive in wanted:
        print(f"{archive.gb:6.1f} GB  {archive.name:<26}{archive.url}")
    print(f"{total:6.1f} GB  in {len(wanted)} archives, as the dataset's page rounds them")
    if out is None:
        print("--out FOLDER fetches them")
        return
    make_folder(out)
    with progress(total, "GB") as advance:
        for archive in wanted:
            fetch(archive, out, lambda size: advance(size * 1e-9))
            print(f"{out / archive.file}: complete, its sum is right")
