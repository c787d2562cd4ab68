"""Compressed images of a log: what they hold, what they have lost, and hostile ones."""

import struct
import zlib
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image

from semgp.classes import MISSING
from semgp.errors import InputError
from semgp.logs.pixels import colours_of, depth_of, labels_of
from semgp.logs.stills import PNG
from tests.log_encoders import compressed_depth, jpeg, png
from tests.log_samples import message

RNG = np.random.default_rng(0)
MILLIMETRES = np.where(RNG.random((12, 17)) < 0.2, 0, RNG.integers(300, 9000, (12, 17))).astype(np.uint16)
METRES = np.where(MILLIMETRES == 0, np.nan, MILLIMETRES / 1000).astype(np.float32)
LABELS = RNG.integers(0, 20, (12, 17)).astype(np.uint8)
SMOOTH = np.stack(np.broadcast_arrays(np.arange(48)[:, None] * 4, np.arange(64) * 3, 30), axis=-1).astype(np.uint8)


def image(data: bytes, what: str) -> Any:
    return message(data=np.frombuffer(data, np.uint8), format=what)


@pytest.mark.parametrize(
    ("data", "what"),
    [
        (png(MILLIMETRES), "png"),
        (png(MILLIMETRES), ""),
        (png(MILLIMETRES), "16UC1; png compressed "),
        (png(MILLIMETRES), "mono16; png compressed mono16"),
        (compressed_depth(MILLIMETRES, "png"), "16UC1; compressedDepth png"),
        (compressed_depth(MILLIMETRES, "png"), "16UC1; compressedDepth"),
        (compressed_depth(MILLIMETRES, "png"), "16UC1"),
        (compressed_depth(MILLIMETRES, "rvl"), "16UC1; compressedDepth rvl"),
    ],
)
def test_depth_in_millimetres(data: bytes, what: str) -> None:
    np.testing.assert_array_equal(depth_of(image(data, what)), MILLIMETRES / 1000)


@pytest.mark.parametrize("codec", ["png", "rvl"])
def test_depth_in_metres_is_quantised(codec: str) -> None:
    found = depth_of(image(compressed_depth(METRES, codec), f"32FC1; compressedDepth {codec}"))
    np.testing.assert_array_equal(np.isnan(found), MILLIMETRES == 0)
    error = np.abs(found - METRES)[MILLIMETRES > 0]
    step = METRES[MILLIMETRES > 0] ** 2 / (100 * 101)  # |d(a / z)| = a / z² |dz|: one level of the quantisation
    assert (error <= 1.01 * step).all()


def test_depth_in_metres_by_hand() -> None:
    """With a = 10100 and b = -1009: raw 0 is none, 4041 is 10100 / 5050 = 2 m, 1 is 10 m."""
    body = png(np.array([[0, 4041, 1]], np.uint16))
    found = depth_of(image(struct.pack("<iff", 0, 10100, -1009) + body, "32FC1; compressedDepth png"))
    np.testing.assert_allclose(found, [[np.nan, 2.0, 10.0]], rtol=1e-12)
    beyond = struct.pack("<iff", 0, 100, 4041) + body  # nothing is at or behind infinity
    assert np.isnan(depth_of(image(beyond, "32FC1; compressedDepth png"))).all()


def test_labels() -> None:
    for pixels, what in (
        (LABELS, "mono8; png compressed "),
        (LABELS, "png"),
        (LABELS.astype(np.uint16), "16UC1; png compressed"),
    ):
        with_gap = pixels.copy()
        with_gap[3, 4] = np.iinfo(pixels.dtype).max
        found = labels_of(image(png(with_gap), what), None)
        assert found[3, 4] == MISSING
        assert (found == LABELS).sum() == LABELS.size - 1


def test_colours() -> None:
    np.testing.assert_array_equal(colours_of(image(png(SMOOTH), "bgr8; png compressed bgr8")), SMOOTH)
    np.testing.assert_array_equal(colours_of(image(png(SMOOTH), "rgb8; png compressed rgb8")), SMOOTH[..., ::-1])
    with_alpha = np.concatenate([SMOOTH, np.full((48, 64, 1), 9, np.uint8)], axis=-1)
    np.testing.assert_array_equal(colours_of(image(png(with_alpha), "png")), SMOOTH)
    for what in ("jpeg", "rgb8; jpeg compressed bgr8", "bayer_rggb8; jpeg compressed bgr8"):
        found = colours_of(image(jpeg(SMOOTH, comment=b"hello", exif=_exif()), what))
        assert found.shape == SMOOTH.shape
        assert np.abs(found.astype(int) - SMOOTH).max() < 12


@pytest.mark.parametrize(
    ("read", "data", "what", "problem"),
    [
        ("depth", jpeg(LABELS), "16UC1; jpeg compressed", "as JPEG, which changes numbers"),
        ("labels", jpeg(LABELS), "mono8; jpeg compressed", "changes numbers. Record it as PNG, or uncompressed"),
        ("labels", compressed_depth(MILLIMETRES, "png"), "16UC1; compressedDepth png", "makes large numbers 0"),
        ("depth", png(LABELS), "32FC1; png compressed", "was 32FC1 before it became a PNG of mono8"),
        ("labels", png(LABELS), "32SC1; png compressed", "was 32SC1"),
        ("depth", png(LABELS), "png", "'mono8', not one of 16UC1"),
        ("labels", png(SMOOTH), "png", "'rgb8', not one of mono8"),
        ("colours", png(LABELS), "png", "'mono8', not one of rgb8"),
        ("colours", compressed_depth(MILLIMETRES, "png"), "16UC1; compressedDepth", "Record it as PNG or JPEG"),
        ("colours", b"RIFF....WEBP", "webp", "in a way that is not known: 'webp'"),
        ("colours", b"", "jpeg", "not known"),
        ("depth", compressed_depth(MILLIMETRES, "png"), "", "neither of 16UC1 nor of 32FC1"),
        (
            "depth",
            compressed_depth(MILLIMETRES, "png")[:7],
            "16UC1; compressedDepth png",
            "ends within its header",
        ),
        ("depth", compressed_depth(MILLIMETRES, "rvl")[:17], "16UC1; compressedDepth rvl", "within its header"),
        ("depth", bytes(12) + png(LABELS), "16UC1; compressedDepth png", "of mono8, not of 16 bits"),
        ("depth", bytes(12) + png(MILLIMETRES), "32FC1; compressedDepth png", "quantised by a = 0"),
        ("depth", bytes(12) + struct.pack("<IIQ", 2**31, 2**31, 0), "16UC1; compressedDepth rvl", "declares"),
        ("depth", bytes(12) + bytes(20), "16UC1; compressedDepth rvl", "declares 0 x 0"),
        ("labels", PNG + b"\0\0\0\rIHDR", "png", "damaged or truncated"),
    ],
)
def test_images_that_are_refused(read: str, data: bytes, what: str, problem: str) -> None:
    reader: Any = {"depth": depth_of, "labels": lambda m: labels_of(m, None), "colours": colours_of}[read]
    with pytest.raises(InputError, match=problem):
        reader(image(data, what))


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def test_grey_of_few_bits_is_refused() -> None:
    """Decoders spread four bits over eight, which would change labels."""
    header = struct.pack(">IIBBBBB", 2, 1, 4, 0, 0, 0, 0)
    few = PNG + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(b"\0\x12")) + chunk(b"IEND", b"")
    with pytest.raises(InputError, match="PNG of colour type 0 and 4 bits"):
        labels_of(image(few, "png"), None)


@pytest.mark.parametrize("size", [(60_000, 60_000), (10_000, 9_500), (0, 5), (2**31 - 1, 1)])
def test_images_that_declare_too_much(size: tuple[int, int]) -> None:
    """A warning of Pillow, at 90 million pixels, would fail this test, too."""
    header = struct.pack(">IIBBBBB", *size, 16, 0, 0, 0, 0)
    bomb = PNG + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(bytes(1000))) + chunk(b"IEND", b"")
    for data, what in ((bomb, "png"), (bytes(12) + bomb, "16UC1; compressedDepth png")):
        with pytest.raises(InputError, match=r"its depth image cannot be read: it (declares|is damaged)"):
            depth_of(image(data, what))
    whole = jpeg(SMOOTH)
    at = whole.index(b"\xff\xc0") + 5
    wide = whole[:at] + struct.pack(">HH", 65_000, 65_000) + whole[at + 4 :]
    with pytest.raises(InputError, match="declares 65000 x 65000"):
        colours_of(image(wide, "jpeg"))


def test_what_images_carry_beside_their_pixels_is_not_read() -> None:
    """A damaged animation or EXIF makes Pillow warn."""
    whole = png(LABELS)
    animated = whole[:33] + chunk(b"acTL", bytes(8)) + chunk(b"eXIf", b"II*\0" + bytes(9)) + whole[33:]
    np.testing.assert_array_equal(labels_of(image(animated, "png"), None), LABELS)
    plain = jpeg(SMOOTH)
    remark = b"\xff\xe1" + struct.pack(">H", 40) + b"Exif\0\0II*\0\x08\0\0\0\xff\xff" + bytes(22)
    np.testing.assert_array_equal(
        colours_of(image(plain[:2] + remark + plain[2:], "jpeg")), colours_of(image(plain, "jpeg"))
    )


SAMPLES: list[tuple[bytes, str, Any]] = [
    (png(MILLIMETRES), "16UC1; png compressed", depth_of),
    (compressed_depth(MILLIMETRES, "png"), "16UC1; compressedDepth png", depth_of),
    (compressed_depth(METRES, "rvl"), "32FC1; compressedDepth rvl", depth_of),
    (png(LABELS), "png", lambda m: labels_of(m, None)),
    (png(SMOOTH), "rgb8; png compressed bgr8", colours_of),
    (jpeg(SMOOTH), "rgb8; jpeg compressed bgr8", colours_of),
    (jpeg(SMOOTH, progressive=True), "jpeg", colours_of),
]


def survives(read: Any, data: bytes, what: str) -> NDArray[Any] | None:
    try:
        found: NDArray[Any] = read(image(data, what))
    except InputError:
        return None
    return found


@given(st.sampled_from(SAMPLES), st.data())
def test_damaged_images(sample: tuple[bytes, str, Any], data: st.DataObject) -> None:
    whole, what, read = sample
    damaged = bytearray(whole)
    for _ in range(data.draw(st.integers(1, 6))):
        damaged[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    found = survives(read, bytes(damaged), what)
    assert found is None or found.ndim in (2, 3)


@given(st.sampled_from(SAMPLES), st.data())
def test_truncated_images(sample: tuple[bytes, str, Any], data: st.DataObject) -> None:
    whole, what, read = sample
    found = survives(read, whole[: data.draw(st.integers(0, len(whole) - 1))], what)
    assert found is None or found.shape == read(image(whole, what)).shape


@given(
    st.sampled_from([b"", PNG, b"\xff\xd8\xff", bytes(12) + PNG]),
    st.binary(max_size=300),
    st.text(max_size=20) | st.sampled_from([what for _, what, _ in SAMPLES]),
)
def test_any_bytes_at_all(begin: bytes, rest: bytes, what: str) -> None:
    for read in (depth_of, colours_of):
        assert survives(read, begin + rest, what) is None


def _exif() -> Any:
    exif = Image.Exif()
    exif[0x0112] = 6
    return exif
