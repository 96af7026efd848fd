"""Finished walks on disk, each under the hash of everything that its numbers depend on.

One `.npz` a walk, in sub-folders by the first two digits: the arrays, and `about.json` with what made them and the
hash of the content. It is written under a temporary name and renamed, so that there is a whole entry or none, whenever
the program or the machine stops. Nothing is ever removed: delete the folder to start afresh.
"""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.files import replaced, user_path
from vsf_drake.npz_file import read_npz
from vsf_drake.schema import to_plain
from vsf_drake.simulation.many.cases import Task
from vsf_drake.simulation.many.keys import digest
from vsf_drake.simulation.many.worker import Kind, Reply

ABOUT = "about.json"
LASTING = (Kind.DONE, Kind.FAILED)
"""Replies worth keeping: a simulation that failed will fail again; a machine may not."""


class WalkCache:
    """A folder of finished walks.

    Args:
        folder: created if needed.

    Raises:
        InputError: it cannot be.
    """

    def __init__(self, folder: str | Path) -> None:
        if not isinstance(folder, (str, Path)):
            raise InputError(f"a {type(folder).__name__} is no folder", where="cache", right="Give its path")
        self.folder = user_path(folder)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"cannot be a folder ({error.strerror})", file=self.folder, where="cache") from None

    def path(self, key: str) -> Path:
        """Where the walk with that key is, or would be."""
        return self.folder / key[:2] / f"{key}.npz"

    def read(self, key: str) -> tuple[Reply | None, str]:
        """The reply that was kept, or None; and a sentence if there is an entry that cannot be trusted."""
        path = self.path(key)
        if not path.exists():
            return None, ""
        try:
            return _decoded(path, key), ""
        except Exception as error:  # a damaged file can make its readers raise anything
            return None, f"Its cache entry was damaged ({error}); it was computed anew."

    def write(self, task: Task, reply: Reply) -> None:
        """Keeps `reply`, if it is worth keeping.

        Raises:
            InputError: the disk is full or the folder cannot be written.
        """
        if reply.kind not in LASTING:
            return
        path = self.path(task.key)
        try:
            path.parent.mkdir(exist_ok=True)
            with replaced(path, "wb", lasting=True) as stream:
                stream.write(_encoded(task, reply))
        except (OSError, InputError) as error:
            cause = error.strerror if isinstance(error, OSError) else error.what
            raise InputError(f"a finished walk cannot be kept ({cause})", file=self.folder, where="cache",
                             right="Make room and run the same again: it goes on from what is there") from None


def _encoded(task: Task, reply: Reply) -> bytes:
    about: dict[str, Any] = {
        "key": task.key, "kind": reply.kind.value, "failure": reply.text, "columns": to_plain(reply.columns),
        "unconverged_steps": reply.unconverged_steps, "refined_steps": reply.refined_steps, "wall_s": reply.wall_s,
        "notes": list(reply.notes),
        "made_with": {"person": task.person, "motion": task.motion, "keep": list(task.keep),
                      **to_plain({name: value for name, value in task.options.items() if not callable(value)})},
        "software": task.software}
    about["content_sha256"] = digest(about, reply.arrays)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, array in reply.arrays.items():
            with archive.open(f"{name}.npy", "w") as member:
                np.lib.format.write_array(member, array, allow_pickle=False)
        archive.writestr(ABOUT, json.dumps(about, indent=1))
    return buffer.getvalue()


def _decoded(path: Path, key: str) -> Reply:
    arrays = read_npz(path)
    about = json.loads(arrays.pop(ABOUT))
    expected = about.pop("content_sha256")
    if digest(about, arrays) != expected or about["key"] != key:
        raise ValueError("its SHA-256 differs")
    return Reply(Kind(about["kind"]), text=about["failure"], arrays=arrays,
                 columns={name: tuple(names) for name, names in about["columns"].items()},
                 unconverged_steps=about["unconverged_steps"], refined_steps=about["refined_steps"],
                 wall_s=about["wall_s"], notes=tuple(about["notes"]))
