"""Archives of arrays: what could unpack to more than anybody counts is refused before."""

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from fleet2d.bounds import LEARNED_BYTES
from fleet2d.storage.archives import read_arrays


def packed(path: Path, method) -> Path:
    content = io.BytesIO()
    np.save(content, np.arange(3.0))
    with zipfile.ZipFile(path, "w", method) as archive:
        archive.writestr("a.npy", content.getvalue())
    return path


def test_an_array_is_read_packed_and_not(tmp_path):
    for method in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        found = read_arrays(packed(tmp_path / "a.npz", method), LEARNED_BYTES)
        assert [0.0, 1.0, 2.0] == found["a"].tolist()


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_another_compression_is_refused_before_it_is_unpacked(tmp_path, method):
    with pytest.raises(ValueError, match="'a' is compressed in another way"):
        read_arrays(packed(tmp_path / "a.npz", method), LEARNED_BYTES)
