"""Texts that lie where a file should be, such as the page of a server: what their beginning says they are."""

import re

STAND_INS = {
    rb"version https://git-lfs": ("a git-lfs pointer, not the file itself", "fetch it with `git lfs pull`"),
    rb"(\.\./)*(\.git)?/?annex/objects/": ("a git-annex pointer, not the file itself", "fetch it with `git annex get`"),
    rb"\s*<(!doctype\s+html|html|head|body)\b": (
        "a web page (HTML), not the file itself",
        "download the file itself: its address led to a page, such as one to log in or to confirm",
    ),
}


def stand_in(start: bytes) -> tuple[str, str] | None:
    """What stands where a file should be, by its first bytes, and what to do; None where nothing does."""
    start = start.removeprefix(b"\xef\xbb\xbf")
    return next((words for form, words in STAND_INS.items() if re.match(form, start, re.IGNORECASE)), None)
