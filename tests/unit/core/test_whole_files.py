"""Files that are written whole or not at all."""

import pytest

from mbf_abstract.whole_files import replacing, write_whole


def test_an_error_names_the_file_that_was_asked_for_and_not_the_temporary_one(tmp_path):
    missing, folder = tmp_path / "missing" / "plan.png", tmp_path / "folder.png"
    folder.mkdir()
    for file, error in ((missing, FileNotFoundError), (folder, OSError)):
        with pytest.raises(error) as raised:
            write_whole(file, "text")
        assert raised.value.filename == str(file) and ".part" not in str(raised.value)
    assert list(tmp_path.iterdir()) == [folder]


def test_an_error_about_another_file_stays_as_it_is(tmp_path):
    with pytest.raises(FileNotFoundError) as raised, replacing(tmp_path / "a.txt"):
        (tmp_path / "other.txt").read_text()
    assert raised.value.filename == str(tmp_path / "other.txt")
