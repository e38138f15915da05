import sys

import numpy as np
import pytest

from fleet2d.bounds import PICTURE_BYTES
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.files import read_file
from fleet2d.homes.formats.raster import grey_picture

SHADES = np.arange(12, dtype=np.uint8).reshape(3, 4) * 20


def write(folder, content, name="map.pgm"):
    path = folder / name
    path.write_bytes(content)
    return path


def read_grey(path):
    return grey_picture(read_file(path, PICTURE_BYTES), path)


def packed(values, white=255):
    rows, columns = values.shape
    body = values.astype(np.uint8 if white < 256 else ">u2").tobytes()
    return f"P5\n{columns} {rows}\n{white}\n".encode() + body


def plain(values, white=255):
    rows, columns = values.shape
    body = "\n".join(" ".join(map(str, row)) for row in values.tolist())
    return f"P2\n{columns} {rows}\n{white}\n{body}\n".encode()


# --- PGM ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("encode", [packed, plain])
@pytest.mark.parametrize(("factor", "white"), [(1, 255), (1, 220), (200, 65535), (1, 256)])
def test_pgm_of_either_kind_and_depth_comes_back_as_written(tmp_path, encode, factor, white):
    values = SHADES.astype(np.int64) * factor

    picture = read_grey(write(tmp_path, encode(values, white)))  # type: ignore[operator]

    assert white == picture.white
    assert np.array_equal(values, picture.values)
    assert picture.clear is None


@pytest.mark.parametrize(
    "header",
    [
        b"P5 4 3 255 ",
        b"P5\n# CREATOR: map_saver 0.050 m/pix\n4 3\n255\n",
        b"P5 # one\n# two\n 4\t# 9 9\n3\r\n# 7\n255\n",
        b"P5\n4 3\n255# last\n",
    ],
)
def test_pgm_header_may_hold_comments_and_any_white_space(tmp_path, header):
    picture = read_grey(write(tmp_path, header + SHADES.tobytes()))

    assert np.array_equal(SHADES, picture.values)


def test_packed_pixels_that_look_like_white_space_and_comments_are_pixels(tmp_path):
    values = np.frombuffer(b"# \n\r\t  #\n\n \n", np.uint8).reshape(3, 4)

    assert np.array_equal(values, read_grey(write(tmp_path, packed(values))).values)


def test_plain_pixels_may_be_followed_by_comments(tmp_path):
    content = plain(SHADES).replace(b"20 40", b"20 # 1 2 3\n40")

    assert np.array_equal(SHADES, read_grey(write(tmp_path, content)).values)


@pytest.mark.parametrize("encode", [packed, plain])
@pytest.mark.parametrize(
    ("size", "message"), [(b"4 4", "it is cut off"), (b"4 2", "its header is wrong")]
)
def test_pgm_of_another_size_than_its_header_is_refused(tmp_path, encode, size, message):
    content = encode(SHADES + 1).replace(b"4 3", size)  # type: ignore[operator]

    with pytest.raises(FloorPlanError, match=rf"holds 12 pixels.*{message}"):
        read_grey(write(tmp_path, content))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"P5\n4 3\n", "no PGM header"),
        (b"P5\n-4 3\n255\n", "no PGM header"),
        (b"P5", "no PGM header"),
        (b"P5 " + b"9" * 5000 + b" 3 255\n", "no PGM header"),
        (b"P5\n0 3\n255\n", "it is empty"),
        (b"P5\n4 3\n0\n" + bytes(12), "PGM allows 1 to 65535"),
        (b"P5\n4 3\n70000\n" + bytes(12), "PGM allows 1 to 65535"),
        (b"P5\n4 3\n9\n" + bytes([10] * 12), "a pixel of 10, above its white, 9"),
        (b"P2\n2 1\n65535\n1 65536", "a pixel of 65536, above its white"),
        (b"P2\n2 1\n255\n1 x", "the pixel 'x'"),
        (b"P2\n2 1\n255\n1 -1", "the pixel '-1'"),
        (b"P5\n100000 100000\n255\n", "at most 16777216 are read"),
        (b"P6\n4 3\n255\n" + bytes(36), "neither PGM"),
        (b"\xff\xd8\xff\xe0", "is a damaged JPEG"),
        (b"\xfa\xfb", "neither PGM"),
        (b"", "neither PGM"),
    ],
)
def test_damaged_or_foreign_image_is_refused_with_the_reason(tmp_path, content, message):
    path = write(tmp_path, content)

    with pytest.raises(FloorPlanError, match=message) as caught:
        read_grey(path)

    assert str(path) in str(caught.value)


# --- PNG ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["L", "RGB", "RGBA", "LA", "P", "I;16"])
def test_png_of_any_kind_gives_its_shades(tmp_path, mode):
    images = pytest.importorskip("PIL.Image")
    path = tmp_path / "map.png"
    if mode == "I;16":
        images.fromarray(SHADES.astype(np.uint16) * 257).save(path)
    else:
        images.fromarray(SHADES).convert(mode).save(path)

    picture = read_grey(path)

    assert np.allclose(SHADES / 255, picture.values / picture.white, atol=1e-12)
    assert picture.clear is None


def test_png_colours_are_averaged_and_what_is_not_opaque_is_clear(tmp_path):
    images = pytest.importorskip("PIL.Image")
    pixels = np.array([[[255, 0, 0, 255], [10, 20, 31, 254]]], np.uint8)
    images.fromarray(pixels).save(tmp_path / "map.png")

    picture = read_grey(tmp_path / "map.png")

    assert [[255, 61]] == picture.values.tolist()
    assert picture.clear is not None
    assert [[False, True]] == picture.clear.tolist()


def test_truncated_png_is_refused(tmp_path):
    images = pytest.importorskip("PIL.Image")
    noise = np.random.default_rng(0).integers(0, 255, (60, 60)).astype(np.uint8)
    images.fromarray(noise).save(tmp_path / "map.png")
    content = (tmp_path / "map.png").read_bytes()

    for length in (10, 40, len(content) // 2):
        with pytest.raises(
            FloorPlanError, match=r"damaged PNG|holds 29 rows, but its header says 60"
        ):
            read_grey(write(tmp_path, content[:length], "map.png"))


def test_png_without_pillow_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "PIL", None)
    path = write(tmp_path, b"\x89PNG\r\n\x1a\n")

    with pytest.raises(FloorPlanError, match=r'pip install "fleet2d\[viz\]"'):
        read_grey(path)
