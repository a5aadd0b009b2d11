"""Files from elsewhere: pipes and devices are refused, arrays are read only if they fit."""

import os
import tracemalloc
import zipfile

import numpy as np
import pytest

from mbf_abstract.config.bounded_files import ArrayFileError, read_arrays, special_file


def test_what_is_no_file_with_contents_is_named(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "file").touch()
    assert special_file(tmp_path / "pipe") == "a pipe"
    assert special_file(tmp_path / "/dev/null") == "a device"
    for usual in ("file", ".", "missing", "null\0"):
        assert special_file(tmp_path / usual) == ""


def test_arrays_come_back_as_numpy_wrote_them(tmp_path):
    written = {"a": np.arange(6.0).reshape(2, 3), "b": np.array("text"), "c": np.zeros(0, np.int8)}
    np.savez(tmp_path / "plain.npz", **written)
    np.savez_compressed(tmp_path / "small.npz", **written)
    for name in ("plain.npz", "small.npz"):
        read = read_arrays(tmp_path / name, 100)
        assert read.keys() == written.keys()
        for key, values in written.items():
            np.testing.assert_array_equal(read[key], values, strict=True)
    assert list(read_arrays(tmp_path / "plain.npz", 100, ("b", "z"))) == ["b"]


def test_arrays_that_take_too_much_are_refused_before_they_get_memory(tmp_path):
    np.savez_compressed(tmp_path / "bomb.npz", small=np.zeros(2), large=np.zeros(4_000_000))
    tracemalloc.start()
    with pytest.raises(ArrayFileError, match="take 32000016 bytes, the limit is 32000015"):
        read_arrays(tmp_path / "bomb.npz", 32_000_015)
    assert tracemalloc.get_traced_memory()[1] < 1_000_000
    tracemalloc.stop()
    assert read_arrays(tmp_path / "bomb.npz", 16, ("small",))["small"].size == 2, "only what is wanted counts"


def member(header: bytes, magic: bytes = b"\x93NUMPY\x01\x00") -> bytes:
    return magic + len(header).to_bytes(2, "little") + header


def test_an_array_of_less_than_nothing_makes_no_room_for_one_that_is_too_large(tmp_path):
    with zipfile.ZipFile(tmp_path / "both.npz", "w") as archive:
        for name, count in (("less", -1_000_000), ("large", 1_000_000)):
            header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({count},)}}\n"
            archive.writestr(f"{name}.npy", member(header.encode()))
    with pytest.raises(ArrayFileError, match=r"^'less.npy' has the shape \(-1000000,\)$"):
        read_arrays(tmp_path / "both.npz", 1000)


@pytest.mark.parametrize(
    "content",
    [
        member(b"{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999999999999, 9)}\n"),
        member(b"{'descr': '<f8', 'fortran_order': False, 'shape': (-1,)}\n"),
        member(b"{'descr': '<f8', 'fortran_order': False, 'shape': (3,)}\n"),  # and no data
        member(b"{'descr': '|O', 'fortran_order': False, 'shape': (1,)}\n") + b"cos\nsystem\n(S'true'\ntR.",
        member(b"__import__('os').mkdir('victim')\n"),
        member(b"{}", magic=b"\x93NUMPY\x03\x00"),
        b"short",
        b"",
    ],
)
def test_a_nasty_array_is_refused_and_runs_nothing(tmp_path, monkeypatch, content):
    monkeypatch.chdir(tmp_path)
    with zipfile.ZipFile("nasty.npz", "w") as archive:
        archive.writestr("z.npy", content)
    with pytest.raises(ArrayFileError):
        read_arrays(tmp_path / "nasty.npz", 1_000_000)
    assert not (tmp_path / "victim").exists()


def test_damage_anywhere_in_the_file_is_one_kind_of_error(tmp_path):
    np.savez_compressed(tmp_path / "good.npz", z=np.random.default_rng(0).random(50), dx=1.0)
    good = (tmp_path / "good.npz").read_bytes()
    rng, errors = np.random.default_rng(1), []
    for _ in range(300):
        content = bytearray(good)
        for _ in range(rng.integers(1, 4)):
            content[rng.integers(len(content))] = rng.integers(256)
        (tmp_path / "damaged.npz").write_bytes(content[: rng.integers(1, len(content) + 1)])
        try:
            read_arrays(tmp_path / "damaged.npz", 10_000)
        except ArrayFileError as error:
            errors.append(str(error))
    assert len(errors) > 200
    assert not any("\n" in error for error in errors)
