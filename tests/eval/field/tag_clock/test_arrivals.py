"""Arrival files: what one must be, and one line that names file and place where it is not."""

import numpy as np
import pytest

from tagtrack.eval.field.tag_clock.arrivals import Arrivals, read_arrivals, write_arrivals


@pytest.fixture
def refusal(tmp_path):
    """The message with which ``read_arrivals`` refuses a file: one line that begins with the file's path."""

    def message_of(content):
        path = tmp_path / "arrivals.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        with pytest.raises(ValueError) as caught:
            read_arrivals(path)
        message = str(caught.value)
        assert message.startswith(str(path)) and "\n" not in message
        return message.removeprefix(str(path))

    return message_of


def test_a_written_file_is_read_as_it_was(tmp_path):
    written = Arrivals(np.array([0.5, 0.54876, 1e9 + 0.12346]), np.array([117, 121, 117]))
    write_arrivals(tmp_path / "arrivals.csv", written)
    read = read_arrivals(tmp_path / "arrivals.csv")
    np.testing.assert_allclose(read.time, written.time, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(read.code, written.code)
    assert read.codes == [117, 121]
    np.testing.assert_allclose(read.of_code(117), [0.5, 1e9 + 0.12346])


def test_other_columns_and_hours_of_silence_are_no_mistake(tmp_path):
    (tmp_path / "a.csv").write_text("code,strength,t_s\n117,80,0\n117,75,99999\n")
    np.testing.assert_array_equal(read_arrivals(tmp_path / "a.csv").time, [0.0, 99999.0])


def test_two_codes_may_arrive_at_once(tmp_path):
    (tmp_path / "a.csv").write_text("t_s,code\n1,117\n1,121\n")
    assert read_arrivals(tmp_path / "a.csv").codes == [117, 121]


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        ("", ": line 1 must name the columns t_s,code, got nothing"),
        ("time,id\n1,117\n", ": line 1 must name the columns t_s,code, got time,id"),
        ("t_s,code\n", " holds no arrivals; give one row for each code that was heard"),
        ("t_s,code\n1,117\nsoon,117\n", ": line 3: t_s must be a number, got 'soon'"),
        ("t_s,code\n,117\n", ": line 2: t_s must be a number, got ''"),
        ("t_s,code\nnan,117\n", ": line 2: t_s must be finite, got 'nan'"),
        ("t_s,code\n1,inf\n", ": line 2: code must be a whole number from 0 to 2147483647, got 'inf'"),
        ("t_s,code\n1,11.7\n", ": line 2: code must be a whole number from 0 to 2147483647, got '11.7'"),
        ("t_s,code\n1,-1\n", ": line 2: code must be a whole number from 0 to 2147483647, got '-1'"),
        ("t_s,code\n1\n", ": line 2: expected 2 fields as in line 1, got 1"),
        ("t_s,code\n5,117\n3,121\n", ": line 3: times must rise, got 3.00000 after 5.00000; sort the file"),
        ("t_s,code\n5,117\n5,121\n5,117\n", ": line 4: code 117 arrives twice at 5.00000 s; remove the duplicate"),
        (b"t_s,code\n\xff\xfe,117\n", r": line 2: t_s must be a number, got '\udcff\udcfe'"),
        ("t_s,code\n" + "1" * 200_000, ": line 2: not a csv text file"),
    ],
)
def test_a_wrong_file_is_refused_with_its_line(refusal, content, complaint):
    assert refusal(content).startswith(complaint)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match="no arrival file .*none.csv; give a csv with columns t_s,code"):
        read_arrivals(tmp_path / "none.csv")
    with pytest.raises(FileNotFoundError, match="no arrival file"):
        read_arrivals(tmp_path)
