"""What was submitted to a season, on disk: packed while it waits for its check, and a folder of its own once it plays.

submissions/DIGEST.ENTRY.packed   as it came
submissions/checking-.../         while it is checked
submissions/DIGEST/               what plays
"""

import os
import shutil
import tempfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from arena.errors import InputError
from arena.folders import make_folder
from arena.submission import Submission, digest_of, unpack

_FOLDER = "submissions"
_PACKED, _CHECKING = ".packed", "checking-"


class SubmittedFolder:
    """The folder of what was submitted, in the folder of a season."""

    def __init__(self, season: Path) -> None:
        self._folder = season / _FOLDER
        make_folder(self._folder, f"cannot keep submissions in {self._folder}", 0o700)

    def keep(self, entry: str, packed: bytes) -> str:
        """Keep what came until it is checked, and return its digest; `OSError` if it cannot be written."""
        digest = digest_of(packed)
        descriptor, name = tempfile.mkstemp(dir=self._folder, prefix=_CHECKING)
        try:
            with os.fdopen(descriptor, "wb") as file:
                file.write(packed)
                file.flush()
                os.fsync(file.fileno())
            Path(name).replace(self._packed(entry, digest))
        except OSError:
            Path(name).unlink(missing_ok=True)  # what a full disk took is sent again and again
            raise
        return digest

    def read(self, entry: str, digest: str, most_bytes: int) -> Submission:
        """Return what waits; `InputError` if it cannot be read."""
        try:
            return unpack(self._packed(entry, digest).read_bytes(), most_bytes)
        except FileNotFoundError as error:
            raise InputError("what was submitted is not there any more; submit it again") from error

    @contextmanager
    def unpacked(self, submission: Submission) -> Iterator[Path]:
        """Lend a folder that holds a submission; it is gone afterwards, unless `enter` took it."""
        folder = Path(tempfile.mkdtemp(dir=self._folder, prefix=_CHECKING))
        try:
            submission.write(folder)
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def enter(self, folder: Path, digest: str) -> str:
        """Keep a folder that `unpacked` lent, and return where it is in the season's folder, as `Version.spec` has it."""
        place = self._folder / digest
        if not place.exists():  # another entry may have come with the same bytes
            folder.rename(place)
        return f"{_FOLDER}/{digest}"

    def forget(self, entry: str, digest: str) -> None:
        """Delete what waited."""
        self._packed(entry, digest).unlink(missing_ok=True)

    def clear(self, waiting: Collection[tuple[str, str]], specs: Collection[str]) -> None:
        """Delete what a process left that was killed: all but what waits, by entry and digest, and what versions are."""
        kept = {self._packed(entry, digest) for entry, digest in waiting}
        for path in self._folder.iterdir():
            if path.is_dir() and f"{_FOLDER}/{path.name}" not in specs:
                shutil.rmtree(path, ignore_errors=True)
            elif path.is_file() and path not in kept:
                path.unlink(missing_ok=True)

    def _packed(self, entry: str, digest: str) -> Path:
        return self._folder / f"{digest}.{entry}{_PACKED}"
