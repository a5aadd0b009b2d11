import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mbf_abstract.config.findings import ConfigError, describe_value, format_key_path, suggest
from mbf_abstract.config.yaml_source import load_yaml, read_yaml


def write(folder, text):
    path = folder / "c.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_values_and_their_lines_are_kept(tmp_path):
    document = load_yaml(write(tmp_path, "a: 1\nb:\n  - x: 1e-3\n  - {y: .inf,\n     z: yes}\nc: ~\n"))
    assert document.data == {"a": 1, "b": [{"x": 0.001}, {"y": float("inf"), "z": True}], "c": None}
    assert document.line(("a",)) == 1
    assert document.line(("b",)) == 2
    assert document.line(("b", 0)) == 3
    assert document.line(("b", 1, "z")) == 5
    assert document.line(("b", 1, "unknown", 7)) == 4
    assert document.line(("unknown",)) == 1


BOMB = "a: &a [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{name}: &{name} [{', '.join(['*' + old] * 9)}]\n" for old, name in zip("abcdefg", "bcdefgh", strict=True)
)


@pytest.mark.parametrize(
    ("text", "line", "expected"),
    [
        ("", 1, "expected a mapping of keys to values, got an empty file"),
        ("# only a comment\n", 1, "got an empty file"),
        ("\n- a\n- b\n", 2, "expected a mapping of keys to values, got a list of 2 items"),
        ("just text", 1, "got 'just text'"),
        ("a: 1\nb: [1, 2\nc: 3\n", 3, "expected YAML"),
        ("a: 1\n b: 2\n", 2, "expected YAML"),
        ("a: 1\n---\nb: 2\n", 2, "expected YAML"),
        ("a: 1\nb: 2\na: 3\n", 3, "a: expected each key once, got 'a' a second time (first in line 1)"),
        ("a: 1\n2: 3\n", 2, "expected a text as key, got '2'"),
        ("a: 1\n? [x, y]\n: 3\n", 2, "expected a text as key"),
        ("base: &b {x: 1}\nc:\n  <<: *b\n", 3, "c: expected a text as key, got '<<'"),
        ("a: 1\nb: !!python/object/apply:os.system ['true']\n", 2, "b: expected a plain value, got the YAML tag"),
        ("a: 1\nb: !!python/name:os.system x\n", 2, "b: expected a plain value, got the YAML tag"),
        ("a: 1\nb: !!set {x}\n", 2, "b: expected a plain value, got the YAML tag"),
        ("a: 2020-13-45\n", 1, "a: expected a plain value"),
        ("a: 1\nb: " + "9" * 5000 + "\n", 2, "b: expected a plain value, got '999"),
        ("a: 0x" + "f" * 5000 + "\n", 1, "a: expected a whole number of at most 63 bits, got '0xfff"),
        (f"a: {2**63}\n", 1, "a: expected a whole number of at most 63 bits, got '9223372036854775808'"),
        ("a: *nowhere\n", 1, "expected YAML, got found undefined alias"),
        ("a: &a [*a]\n", 1, "aliases expanded"),
        ("x: &x 1\ny: [" + "*x, " * 101 + "]\n", 2, "expected at most 100 aliases, got more"),
        ("a: " + "[" * 40 + "]" * 40, 1, "expected at most 32 levels of nesting, got more"),
        ("a: " + "[" * 5000, 1, "expected at most 32 levels of nesting, got more"),
        (BOMB, 1, "expected at most 100000 values"),
        (b"a: 1\nb: \xff\n", 2, "expected UTF-8 text, got byte 0xff"),
        (b"a: \x00\n", 1, "expected YAML"),
        ("a: " + "x" * 1_000_000, 1, "expected at most 1000000 bytes"),
    ],
)
def test_a_bad_file_is_refused_with_line_and_reason(tmp_path, text, line, expected):
    with pytest.raises(ConfigError) as error:
        load_yaml(write(tmp_path, text))
    assert [finding.line for finding in error.value.findings] == [line]
    assert expected in str(error.value)
    assert str(error.value).startswith(f"{tmp_path / 'c.yaml'}:{line}:")
    assert len(str(error.value)) < 400 + len(str(tmp_path))


def test_the_largest_whole_number_has_63_bits(tmp_path):
    assert load_yaml(write(tmp_path, f"a: [{2**63 - 1}, {1 - 2**63}]")).data == {"a": [2**63 - 1, 1 - 2**63]}


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    for path, reason in ((tmp_path / "no.yaml", "No such file"), (tmp_path, "Is a directory")):
        with pytest.raises(ConfigError, match=reason):
            load_yaml(path)


def test_several_findings_come_in_one_error_in_line_order(tmp_path):
    findings = []
    document = read_yaml(write(tmp_path, "a: 1\n3: 4\na: 2\nb: {c: 1, c: 2}\n"), findings)
    assert document.data == {"a": 1, "b": {"c": 1}}
    assert [finding.line for finding in findings] == [2, 3, 4]
    assert str(ConfigError(reversed(findings))).count("\n") == 2


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.one_of(
        st.binary(max_size=80),
        st.text(alphabet="ab:-[]{}&*!<>|?%@`'\"#,\n\t 01.~=", max_size=80).map(str.encode),
    )
)
def test_any_bytes_give_a_mapping_or_findings_and_never_another_error(tmp_path, content):
    findings = []
    document = read_yaml(write(tmp_path, content), findings)
    assert findings or isinstance(document.data, dict)
    assert all(finding.expected and finding.got and finding.line >= 1 for finding in findings)


def test_the_texts_of_findings_are_short():
    assert format_key_path(("planners", 0, "type")) == "planners[0].type"
    assert format_key_path(()) == ""
    assert describe_value({"a": 1}) == "a block of 1 keys"
    assert len(describe_value("x" * 500)) == 60
    assert suggest("planer", ["planner", "controller"]) == "did you mean 'planner'?"
    assert suggest("zzz", ["planner"]) == ""
