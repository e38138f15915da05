"""Journals: complete frames are read, whatever follows them."""

from pathlib import Path

import pytest

from fleet2d.errors import ArtifactError
from fleet2d.storage import files
from fleet2d.storage.files import FrameWriter, JournalFormat, read_frames

NOTES = JournalFormat(b"notes 1\n", ("note", "end"))


def written(path: Path, texts) -> FrameWriter:
    writer = FrameWriter(path, NOTES)
    for text in texts:
        writer.add("note", f'"{text}"', text.encode() * 3)
        writer.commit()
    return writer


def texts_of(path: Path, start=0):
    return [frame.description for frame in read_frames(path, NOTES, start)]


def test_frames_are_read_up_to_where_they_were_cut_off(tmp_path):
    path = tmp_path / "journal"
    written(path, ["one", "two"]).close()
    whole = path.read_bytes()
    frames = list(read_frames(path, NOTES))
    assert [b"oneoneone", b"twotwotwo"] == [frame.content for frame in frames]
    assert ["two"] == texts_of(path, frames[1].start)
    for size in range(len(whole)):
        path.write_bytes(whole[:size])
        assert ["one", "two"][: sum(frame.end <= size for frame in frames)] == texts_of(path)


def test_a_journal_goes_on_behind_a_frame(tmp_path):
    path = tmp_path / "journal"
    written(path, ["one", "two"]).close()
    first = next(read_frames(path, NOTES))
    writer = FrameWriter(path, NOTES, first.end)
    writer.add("note", '"three"')
    assert ["one"] == texts_of(path)
    writer.commit()
    writer.close()
    assert ["one", "three"] == texts_of(path)


def test_a_new_journal_replaces_a_link_and_what_was_there(tmp_path):
    (tmp_path / "theirs").write_text("precious")
    (tmp_path / "journal").symlink_to(tmp_path / "theirs")
    written(tmp_path / "journal", ["one"]).close()
    written(tmp_path / "journal", ["two"]).close()
    assert ["two"] == texts_of(tmp_path / "journal")
    assert "precious" == (tmp_path / "theirs").read_text()


def test_a_failed_write_is_undone(tmp_path, monkeypatch):
    writer = written(tmp_path / "journal", ["one"])
    write_all = files.write_all

    def half(handle, content):
        write_all(handle, content[: len(content) // 2])
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(files, "write_all", half)
        writer.add("note", '"two"')
        with pytest.raises(OSError, match="No space"):
            writer.commit()
    writer.undo()
    writer.add("note", '"three"')
    writer.commit()
    writer.close()
    assert ["one", "three"] == texts_of(tmp_path / "journal")


def test_frames_end_at_a_kind_that_the_journal_does_not_have(tmp_path):
    path = tmp_path / "journal"
    written(path, ["one"]).close()
    first = next(read_frames(path, NOTES))
    later = JournalFormat(NOTES.magic, (*NOTES.kinds, "of a later version"))
    writer = FrameWriter(path, later, first.end)
    writer.add("of a later version", '"two"')
    writer.commit()
    writer.close()
    assert ["one"] == texts_of(path)


def test_other_files_have_no_frames(tmp_path):
    assert [] == texts_of(tmp_path / "nothing")
    (tmp_path / "text").write_text("hello")
    assert [] == texts_of(tmp_path / "text")
    with pytest.raises(ArtifactError, match="can't be read"):
        texts_of(tmp_path)


def test_a_changed_byte_ends_the_journal_before_its_frame(tmp_path):
    path = tmp_path / "journal"
    written(path, ["one", "two"]).close()
    whole = path.read_bytes()
    ends = [frame.end for frame in read_frames(path, NOTES)]
    for at in range(len(NOTES.magic), len(whole)):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
        assert ["one", "two"][: sum(end <= at for end in ends)] == texts_of(path)


def test_a_size_beyond_the_file_is_not_read(tmp_path):
    """A few bytes requested all memory."""
    path = tmp_path / "journal"
    written(path, ["one"]).close()
    with path.open("ab") as file:
        file.write(files._HEADER.pack(0, 1, 1 << 62, 0) + b"7")
    assert ["one"] == texts_of(path)
