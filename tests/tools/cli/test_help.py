"""The help of every command: 80 columns, an example first, options in groups, short sentences."""

import re
from statistics import median

import pytest
from test_every_command import names_of_commands

from trihedron.tools import cli

GROUPS = ("", "plan", "instrument", "reproduce")
EVERY = (*GROUPS, *sorted(names_of_commands()))


def shown(name: str, capsys: pytest.CaptureFixture[str]) -> str:
    assert cli.main([*name.split(), "--help"]) == 0
    return capsys.readouterr().out


def sentences(text: str) -> list[str]:
    """Return the sentences of a help: the text, and the words of each argument and option."""
    prose = text.split("\n\n", 2)[2]
    entries = re.split(r"\n\n|\n  (?=\S)", prose.replace("e.g.", "as"))
    words = [re.sub(r"\[(default|choices|required)[^\]]*\]|^\S.*:$|^-\S+( [A-Z|.]+)*", "", entry) for entry in entries]
    split = [re.split(r"(?<=[.!?;:])\s+", " ".join(entry.split())) for entry in words]
    return [sentence for entry in split for sentence in entry if len(re.findall(r"[A-Za-z]+", sentence)) > 3]


@pytest.mark.parametrize("name", EVERY)
def test_help_holds_80_columns_and_shows_an_example_first(name: str, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    text = shown(name, capsys)
    assert [line for line in text.splitlines() if len(line) > 80] == []
    usage, examples, *_ = text.split("\n\n")
    assert usage.startswith(f"Usage: trihedron {name}".rstrip())
    assert re.match(rf"Examples?:\n  trihedron {name}", examples)
    assert "\n\n\n" not in text


@pytest.mark.parametrize("name", EVERY)
def test_no_sentence_of_the_help_is_over_30_words(name: str, capsys):
    lengths = {sentence: len(sentence.split()) for sentence in sentences(shown(name, capsys))}
    assert [sentence for sentence, length in lengths.items() if length > 30] == []
    assert median(lengths.values()) < 16


def test_options_stand_in_groups(capsys):
    text = shown("calibrate", capsys)
    headings = re.findall(r"(?m)^([A-Z][A-Za-z ]+):$", text)
    assert headings[1:] == [
        "Arguments", "Noise", "Reading the file", "Model", "Bench with gyros", "Without a table",
        "Several records", "Results",
    ]  # fmt: skip
    assert "  --json PATH" in text.partition("\nResults:\n")[2]


@pytest.mark.parametrize("name", EVERY)
def test_help_of_a_command_is_what_its_option_shows(name: str, capsys):
    expected = shown(name, capsys)
    assert cli.main(["help", *name.split()]) == 0
    assert capsys.readouterr().out == expected


def test_help_of_an_unknown_command_names_the_nearest(capsys):
    assert cli.main(["help", "calibrat"]) == 2
    assert 'Did you mean "calibrate"?' in capsys.readouterr().err


@pytest.mark.parametrize("option", ["-v", "--version"])
def test_the_version_has_two_spellings(option: str, capsys):
    assert cli.main([option]) == 0
    assert re.fullmatch(r"\d+\.\d+\.\d+\n", capsys.readouterr().out)
