"""Tables in a terminal: whole where they fit, turned where they do not."""

import pytest

from gaitopt.cli.display import print_table

HEAD = ["gait", "period\n[s]", "a long name of a metric", "another long name", "and a third one"]
ROWS = [[f"square-{n}", f"{n}", "123.45", "12.3 to 45.6", "met"] for n in range(9)]


@pytest.fixture(params=[60, 80, 200])
def lines(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> tuple[int, list[str]]:
    """The width of a terminal, and a table in it."""
    monkeypatch.setenv("COLUMNS", str(request.param))
    print_table(HEAD, ROWS)
    return request.param, capsys.readouterr().out.splitlines()


def test_no_line_is_wider_than_the_terminal_and_no_cell_is_broken(lines: tuple[int, list[str]]) -> None:
    width, text = lines
    assert max(map(len, text)) <= width
    assert not any("…" in line for line in text)
    for cell in ("a long name of a metric", *(row[0] for row in ROWS)):
        assert sum(cell in line for line in text) >= 1
    assert sum(line.count("12.3 to 45.6") for line in text) == len(ROWS)


def test_a_table_is_turned_only_where_it_does_not_fit(lines: tuple[int, list[str]]) -> None:
    width, text = lines
    turned = any(line.strip().startswith("a long name of a metric") for line in text)
    assert turned == (width < 85)


def test_words_that_fit_in_no_column_are_wrapped(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    print_table(["name", "about"], [["one", "word " * 40]])
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= 80
    assert text.count("word") == 40
