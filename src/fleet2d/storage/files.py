"""Files of a folder that Fleet2D stores: safe names, atomic replacement, one writer, a journal.

Runs, studies, tunings and exports go through these functions, so that tests can make each of them
fail, and so that one check covers all names that a folder from somebody else may hold.
"""

from __future__ import annotations

import errno
import json
import os
import platform
import shutil
import stat
import struct
import tempfile
import zlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from fleet2d.errors import ArtifactError, RunDirectoryError
from fleet2d.inputs import open_input

try:
    import fcntl
except ImportError:  # not a POSIX system: the file itself is the lock
    HAS_LOCKS = False
else:
    HAS_LOCKS = True

PARTIAL = ".partial"
"""Suffix of a file's name until the file is complete."""
SCRATCH_LOCK = "in-use.lock"

_FULL = {errno.ENOSPC, getattr(errno, "EDQUOT", errno.ENOSPC)}


def plain_name(name: object, folder: Path | str) -> str:
    """Return a name that was read from a folder, checked to stay inside the folder.

    Args:
        name: Names separated by slashes, such as `learned/ltp.npz`.
        folder: The folder, or the location of a store, for the message.

    Raises:
        RunDirectoryError: The name would lead out of the folder.

    Example:
        >>> plain_name("learned/ltp.npz", "month")
        'learned/ltp.npz'
        >>> plain_name("../other/run", "month")
        Traceback (most recent call last):
        fleet2d.errors.RunDirectoryError: month names a file '../other/run', which is not inside ...
    """
    if (
        isinstance(name, str)
        and name.isprintable()
        and not set("\\:" if os.name == "nt" else "\\") & set(name)  # a colon names a drive
        and not {"", ".", ".."} & set(name.split("/"))
    ):
        return name
    raise RunDirectoryError(
        f"{folder} names a file {repr(name)[:80]}, which is not inside of it: the folder is damaged"
        " or forged"
    )


def path_in(folder: Path | str, name: object) -> Path:
    """Return the path of a file or folder that is named in somebody else's folder.

    Every name that was read from a run, a study or another folder that a command opens is turned
    into a path here, and so are the fixed names of files in such a folder. Nothing needs to exist.

    Args:
        folder: The folder, which the user named: it may itself be reached by a link.
        name: A name in it; see `plain_name`.

    Raises:
        RunDirectoryError: The name leads out of the folder; or the path is a link, leads through
            one, or is a device, a pipe or a socket.
    """
    path = Path(folder)
    for part in plain_name(name, folder).split("/"):
        path /= part
        with suppress(OSError):  # opening a path that is missing or not accessible fails, too
            mode = path.lstat().st_mode
            if stat.S_ISLNK(mode):
                raise RunDirectoryError(
                    f"{path} is a link, which may lead anywhere: remove it, or replace it by what"
                    " it leads to"
                )
            if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
                raise RunDirectoryError(f"{path} is not a file, but a device or a pipe: remove it")
    return path


def refuse_links(folder: Path, subfolders: Iterable[str] = ()) -> None:
    """Refuse a folder with links, devices or pipes in it, before anything is written there.

    Args:
        folder: The folder, which may itself be reached by a link.
        subfolders: Names of the folders in it that are checked, too.

    Raises:
        RunDirectoryError: A link, device or pipe is in the folder or in one of the subfolders.
        OSError: A folder can't be read.
    """
    for directory in (folder, *(path_in(folder, name) for name in subfolders)):
        for path in sorted(directory.iterdir()) if directory.is_dir() else ():
            path_in(directory, path.name)


def write_all(handle: int, content: bytes | memoryview) -> None:
    """Write all bytes to an open file.

    Raises:
        OSError: The bytes can't be written; some may have been.
    """
    rest = memoryview(content)
    while rest:
        rest = rest[os.write(handle, rest) :]


def sync(handle: int) -> None:
    """Flush an open file to the disk.

    Raises:
        OSError: The disk failed; bytes written since the last call may be lost.
    """
    os.fsync(handle)


def sync_directory(directory: Path) -> None:
    """Flush the names in a directory to the disk, where the system can do that."""
    if os.name != "posix":
        return
    handle = os.open(directory, os.O_RDONLY)
    try:
        sync(handle)
    finally:
        os.close(handle)


def replace(path: Path, new: Path) -> None:
    """Rename the file `new` to `path`, atomically."""
    new.replace(path)


def write_atomically(path: Path, content: bytes | memoryview) -> None:
    """Write a file atomically: after a crash it has the old content or the new one.

    Raises:
        OSError: It can't be written; the old content is unchanged.

    Example:
        >>> import tempfile
        >>> file = Path(tempfile.mkdtemp()) / "plan.json"
        >>> write_atomically(file, b"{}")
        >>> file.read_text(), [path.name for path in file.parent.iterdir()]
        ('{}', ['plan.json'])
    """
    with replacing(path) as handle:
        write_all(handle, content)


@contextmanager
def replacing(path: Path) -> Iterator[int]:
    """Yield the handle of a new file, which replaces a file atomically in the end.

    Raises:
        OSError: It can't be written; the old content is unchanged.
    """
    with partial_file(path) as partial:
        handle = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
        try:
            yield handle
            sync(handle)
        finally:
            os.close(handle)


@contextmanager
def partial_file(path: Path) -> Iterator[Path]:
    """Yield the path of a file to be written, which replaces a file atomically in the end.

    A link in place of either file is replaced; what it leads to is not touched.

    Raises:
        OSError: It can't be written; the old content is unchanged.
    """
    if not path.name:  # "." or "/"
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    partial = path.with_name(f"{path.name}{PARTIAL}")
    try:
        partial.unlink(missing_ok=True)  # left by a crash
        yield partial
        replace(path, partial)
    except BaseException:  # also Ctrl-C
        with suppress(OSError):
            partial.unlink(missing_ok=True)
        raise


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """Yield the path of a folder to be made, which appears whole or not at all.

    The folder is made within a temporary one beside it, and moved in the end. Leftovers of a killed
    process are replaced.

    Raises:
        OSError: The folder can't be written, or exists already.

    Example:
        >>> import tempfile
        >>> bag = Path(tempfile.mkdtemp()) / "bag"
        >>> with new_folder(bag) as made:
        ...     made.mkdir()
        ...     _ = (made / "messages").write_text("…")
        ...     bag.exists()
        False
        >>> [path.name for path in bag.parent.rglob("*")]
        ['bag', 'messages']
    """
    if os.path.lexists(path):
        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(path))
    beside = path.with_name(f"{path.name}{PARTIAL}")
    if beside.is_dir() and not beside.is_symlink():
        shutil.rmtree(beside)
    beside.unlink(missing_ok=True)
    beside.mkdir(parents=True)
    try:
        made = beside / path.name
        yield made
        for file in filter(Path.is_file, made.rglob("*")):
            with file.open("rb") as opened:
                sync(opened.fileno())
        sync_directory(made)
        replace(path, made)
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def is_disk_full(error: OSError) -> bool:
    """Return whether an error means that the disk, or the user's quota, is full."""
    return error.errno in _FULL


class FolderLock:
    """The right to write in a folder.

    Where the system has advisory locks, the lock ends with its process, even if that is killed; a
    lock file that remains doesn't prevent a new lock then.

    Example:
        >>> import tempfile
        >>> folder = Path(tempfile.mkdtemp())
        >>> lock = FolderLock(folder, "run.lock")
        >>> FolderLock(folder, "run.lock")  # doctest: +ELLIPSIS
        Traceback (most recent call last):
        fleet2d.errors.RunDirectoryError: ... is being written by process ...
        >>> lock.release()
        >>> FolderLock(folder, "run.lock").release()
    """

    def __init__(
        self,
        folder: Path,
        name: str,
        advice: str = "wait until it is done, or choose another directory",
    ) -> None:
        """Acquire the lock.

        Args:
            folder: The folder.
            name: The name of the lock file in it.
            advice: What to do if another process holds the lock, for the message.

        Raises:
            RunDirectoryError: Another process holds the lock, or the lock file is a link.
            OSError: The file can't be created.
        """
        self.path = path_in(folder, name)
        self._advice = advice
        while True:
            self._handle = self._open()
            # Another process may have removed the file between opening and locking it.
            with suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(self._handle), self.path.stat()):
                    break
            os.close(self._handle)
        os.ftruncate(self._handle, 0)
        os.write(self._handle, f"process {os.getpid()} on {platform.node()}\n".encode())

    def _open(self) -> int:
        flags = os.O_RDWR | os.O_CREAT | (0 if HAS_LOCKS else os.O_EXCL)
        try:
            handle = os.open(self.path, flags, 0o666)
        except FileExistsError as error:
            raise self._locked_error() from error
        if HAS_LOCKS:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                os.close(handle)
                raise self._locked_error() from error
        return handle

    def _locked_error(self) -> RunDirectoryError:
        writer = ""
        with suppress(OSError, ValueError):
            writer = " ".join(self.path.read_text(encoding="utf-8")[:200].split())
        return RunDirectoryError(
            f"{self.path.parent} is being written by {writer or 'another process'}: {self._advice}"
        )

    def release(self) -> None:
        """Release the lock, if it is held."""
        if self._handle < 0:
            return
        with suppress(OSError):
            self.path.unlink()
        os.close(self._handle)
        self._handle = -1


@contextmanager
def scratch_folder(prefix: str) -> Iterator[Path]:
    """Yield a temporary folder, which is removed at the end of the context.

    If the process is killed before, the next process that uses this prefix removes the folder.

    Example:
        >>> with scratch_folder("fleet2d-doctest-") as folder:
        ...     folder.is_dir()
        True
        >>> folder.exists()
        False
    """
    _remove_abandoned(prefix)
    while True:
        folder = Path(tempfile.mkdtemp(prefix=prefix))
        try:
            lock = FolderLock(folder, SCRATCH_LOCK)
        except (RunDirectoryError, FileNotFoundError):  # another process removed it as abandoned
            continue
        break
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        lock.release()


def _remove_abandoned(prefix: str) -> None:
    """Remove the scratch folders of this user whose process is no longer there."""
    if not HAS_LOCKS:
        return
    for folder in Path(tempfile.gettempdir()).glob(f"{prefix}*"):
        with suppress(OSError, RunDirectoryError):
            if folder.lstat().st_uid == os.getuid() and (folder / SCRATCH_LOCK).exists():
                lock = FolderLock(folder, SCRATCH_LOCK)
                shutil.rmtree(folder, ignore_errors=True)
                lock.release()


# Kind, bytes of the description, bytes of the content, checksum of all three and of both sizes.
_HEADER = struct.Struct("<BIQI")
# Frames up to this size are buffered before they are written, unless a commit comes first [bytes].
_BUFFER_BYTES = 1 << 22


@dataclass(frozen=True)
class JournalFormat:
    """The format of a kind of journal.

    Attributes:
        magic: The first bytes of the file, which name the format and its version.
        kinds: The kinds of its frames.
    """

    magic: bytes
    kinds: tuple[str, ...]


class Frame(NamedTuple):
    """A frame of a journal.

    Attributes:
        kind: One of the format's kinds.
        description: Plain JSON data.
        content: Any bytes.
        start: Its position in the file [bytes].
        end: Position of the next frame [bytes].
    """

    kind: str
    description: Any
    content: bytes
    start: int
    end: int


class FrameWriter:
    """Appends frames to a journal.

    Attributes:
        path: The file.
        end: Position where the last commit ends [bytes].

    Example:
        >>> import tempfile
        >>> notes = JournalFormat(b"notes 1", ("note",))
        >>> writer = FrameWriter(Path(tempfile.mkdtemp(), "journal"), notes)
        >>> writer.add("note", '{"by": "ana"}')
        >>> writer.commit()
        >>> [frame.description for frame in read_frames(writer.path, notes)]
        [{'by': 'ana'}]
        >>> writer.close()
    """

    def __init__(self, path: Path, form: JournalFormat, start: int = 0) -> None:
        """Create the file, or continue it after a commit.

        Args:
            path: The file; if it is in somebody else's folder, from `path_in`.
            form: The format.
            start: The end of the commit, where the file is cut off [bytes]; 0: create the file, or
                replace an existing one.

        Raises:
            OSError: The file can't be written.
        """
        self.path = path
        self.end = start
        self._kinds = form.kinds
        self._buffer: list[bytes] = []
        self._size = 0  # bytes in the buffer
        self._written = start
        if not start:
            path.unlink(missing_ok=True)
        flags = os.O_WRONLY | (0 if start else os.O_CREAT | os.O_EXCL)
        self._handle = os.open(path, flags, 0o666)
        try:
            if start:
                os.ftruncate(self._handle, start)
                os.lseek(self._handle, 0, os.SEEK_END)
            else:
                write_all(self._handle, form.magic)
                self.end = self._written = len(form.magic)
        except OSError:
            os.close(self._handle)
            raise

    def add(self, kind: str, description: str, content: bytes = b"") -> None:
        """Append a frame; it is certain to be in the file after the next commit.

        Args:
            kind: One of the format's kinds.
            description: JSON.
            content: Any bytes.

        Raises:
            OSError: The frames so far can't be written.
        """
        text = description.encode()
        number = self._kinds.index(kind)
        header = _HEADER.pack(number, len(text), len(content), _checksum(number, text, content))
        self._buffer += [header, text, content]
        self._size += len(text) + len(content)
        if self._size > _BUFFER_BYTES:
            self._write()

    def commit(self) -> None:
        """Write all frames so far: they survive the end of the process.

        Raises:
            OSError: The frames can't be written; see `undo`.
        """
        self._write()
        self.end = self._written

    def undo(self) -> None:
        """Remove all frames since the last commit, as after a failed write."""
        self._buffer = []
        self._size = 0
        self._written = self.end
        with suppress(OSError):  # readers ignore the part that is cut off
            os.ftruncate(self._handle, self.end)
            os.lseek(self._handle, self.end, os.SEEK_SET)

    def sync(self) -> None:
        """Flush the journal to the disk, so that it survives a power cut, too.

        Raises:
            OSError: The disk failed.
        """
        sync(self._handle)

    def close(self, *, undo: bool = False) -> None:
        """Close the file; with `undo`, remove all frames since the last commit."""
        if self._handle < 0:
            return
        if undo:
            self.undo()
        handle = self._handle
        self._handle = -1
        with suppress(OSError):  # the needed content was synced before
            os.close(handle)

    def _write(self) -> None:
        content = b"".join(self._buffer)
        self._buffer = []
        self._size = 0
        write_all(self._handle, content)
        self._written += len(content)


def read_frames(path: Path, form: JournalFormat, start: int = 0) -> Iterator[Frame]:
    """Yield the complete frames of a journal; another process may be appending to it.

    Args:
        path: The file; nothing is yielded if there is none, or if it has another format.
        form: The format.
        start: The position of the first frame to yield [bytes]; 0: that of the first frame.

    Raises:
        ArtifactError: The file can't be read.
    """
    try:
        with open_input(path, ArtifactError) as file:
            if file.read(len(form.magic)) != form.magic:
                return
            file.seek(start or len(form.magic))
            yield from _complete_frames(file, form.kinds)
    except FileNotFoundError:
        return
    except OSError as error:
        raise ArtifactError(f"{path} can't be read: {error.strerror or error}") from error


def _complete_frames(file: BinaryIO, kinds: tuple[str, ...]) -> Iterator[Frame]:
    size = os.fstat(file.fileno()).st_size
    start = file.tell()
    while len(header := file.read(_HEADER.size)) == _HEADER.size:
        number, text_bytes, content_bytes, checksum = _HEADER.unpack(header)
        end = start + _HEADER.size + text_bytes + content_bytes
        # Sizes are checked before reading: a damaged one must not request all memory.
        if number >= len(kinds) or end > size:
            return
        text = file.read(text_bytes)
        content = file.read(content_bytes)
        if _checksum(number, text, content) != checksum:
            return
        try:
            description = json.loads(text)
        except (ValueError, RecursionError):
            return
        yield Frame(kinds[number], description, content, start, end)
        start = end


def _checksum(number: int, text: bytes, content: bytes) -> int:
    return zlib.crc32(content, zlib.crc32(text, number + len(text)))
