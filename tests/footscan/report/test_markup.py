import pytest

from footscan.report.markup import number, table, text, words


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ("<b>", "&lt;b&gt;"),
        ('"x"', "&quot;x&quot;"),
        ("a&b's", "a&amp;b&#x27;s"),
        ("a\x00\u202eb", "a\ufffd\ufffdb"),
        ("two\nlines", "two\nlines"),
        (7, "7"),
    ],
)
def test_text_is_no_markup(value, expected):
    assert text(value) == expected


@pytest.mark.parametrize(
    ("value", "decimals", "expected"),
    [
        (265.04, 1, "265.0"),
        (-12.34, 1, "−12.3"),
        (-0.04, 1, "0.0"),
        (1234567.8, 0, "1\u202f234\u202f568"),
        (0, 0, "0"),
    ],
)
def test_numbers(value, decimals, expected):
    assert number(value, decimals) == expected


def test_words():
    assert words("ball_girth") == "Ball girth"


def test_numeric_columns_are_set_to_the_right():
    assert '<tr><th scope="row">a</th><td class="n">1</td></tr>' in table(["x", "y"], [["a", "1"]], numeric=[1])
