"""The check of the language complains about long sentences, odd turns, a high median and too many words."""

import plain_english
import pytest
from plain_english import LONGEST, complaints, sentences_of


@pytest.mark.acceptance
def test_docs_readme_and_help_are_plain():
    assert plain_english.main() == 0


@pytest.mark.parametrize(
    "page",
    [
        "One {} two.",
        "- an item with {} words",
        "| cell | another with {} words |",
        "Short. A second one with {} of `a b c`\nover two lines. Short.",
    ],
)
def test_a_long_sentence_is_named_with_its_page(page):
    short = sentences_of("One short sentence follows. " * 9, "other.md")
    assert complaints([*short, *sentences_of(page.format("word " * (LONGEST - 10)), "page.md")]) == []
    lines = complaints([*short, *sentences_of(page.format("word " * LONGEST), "page.md")])
    assert [line.partition(":")[0] for line in lines] == ["page.md"]


def test_code_headings_and_links_are_no_prose():
    text = "\n\n".join(
        [
            "# " + "word " * 40,
            "```text\n" + "word " * 40 + "\n```",
            "<!-- " + "word " * 40 + " -->",
            "See [the page](a/very-long-target-of-many-words-that-nobody-reads.md#and-its-anchor) of this.",
        ]
    )
    assert [sentence.words for sentence in sentences_of(text, "page.md")] == [5]


def test_an_odd_turn_is_named_unless_it_asks():
    assert complaints(sentences_of("The report says what is wrong.", "page.md")) != []
    assert complaints(sentences_of("What is wrong with it?", "page.md")) == []


def test_a_high_median_is_named():
    assert complaints(sentences_of("word " * 20, "page.md")) != []
    assert complaints(sentences_of("word " * 10, "page.md")) == []


def test_too_many_words_are_counted(tmp_path, monkeypatch, capsys):
    (tmp_path / "docs").mkdir()
    (tmp_path / "README.md").write_text("A short page of few words.\n", encoding="utf-8")
    (tmp_path / "docs" / "page.md").write_text("A few short words here.\n" * 7000, encoding="utf-8")
    monkeypatch.setattr(plain_english, "ROOT", tmp_path)
    monkeypatch.setattr(plain_english, "help_sentences", list)
    assert plain_english.main() == 1
    assert "35000 words" in capsys.readouterr().out
