"""Archives from untrusted sources: their unpacked size is bounded before it is in memory."""

import io
import struct
from pathlib import Path
from typing import Any
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile

import numpy as np
from numpy.typing import NDArray

from fleet2d.bounds import Bound, read_bytes

# The list of members of a ZIP archive takes this much for some ten thousand [bytes].
_LIST_BYTES = 1 << 20
# The end of a ZIP archive has a mark, the size of that list, and a comment.
_END_MARK = b"PK\5\6"
_LIST_SIZE_AT = 12
_END_BYTES = 22


def read_arrays(path: Path, bound: Bound) -> dict[str, NDArray[Any]]:
    """Read a .npz file, without pickle: its arrays of numbers, truth values and texts, by name.

    Args:
        path: The file.
        bound: The bound on its bytes, packed and unpacked.

    Raises:
        Exception: The file is damaged or forged: a damaged archive raises almost anything.
        InputError: The file is beyond the bound, or no regular file.
    """
    content = read_bytes(path, bound)
    end = content.rfind(_END_MARK)
    if end < 0 or len(content) < end + _END_BYTES:
        raise ValueError("it is no .npz archive")
    if struct.unpack_from("<I", content, end + _LIST_SIZE_AT)[0] > _LIST_BYTES:
        raise ValueError("it has too many arrays")
    arrays = {}
    with ZipFile(io.BytesIO(content)) as file:
        members = file.infolist()
        bound.check(sum(member.file_size for member in members), path)
        for member in members:
            name = member.filename.removesuffix(".npy")
            # With other compressions, a few bytes can unpack to gigabytes before they are counted.
            if member.compress_type not in (ZIP_STORED, ZIP_DEFLATED):
                raise ValueError(f"{name!r} is compressed in another way than NumPy does it")
            if name in arrays:
                raise ValueError(f"it has {name!r} twice")
            arrays[name] = _array(name, bytearray(file.read(member)))
    return arrays


def _array(name: str, content: bytearray) -> NDArray[Any]:
    """Return an array with all of its values, as its header may state any shape."""
    header = io.BytesIO(content)
    version = np.lib.format.read_magic(header)
    read = np.lib.format.read_array_header_1_0
    read = read if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, is_transposed, kind = read(header)
    if kind.kind not in "biufU" or min(shape, default=0) < 0:
        raise ValueError(f"{name!r} is not an array of numbers, truth values or texts")
    at = header.tell()
    return np.ndarray(shape, kind, content, at, order="F" if is_transposed else "C")
