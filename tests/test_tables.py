"""Tables: what a numeric column is, how numbers look, and that all formats hold the same."""

import csv
import io
import json
import re
from math import inf, nan, pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navirl_cli.documents.sheets import read_sheet
from navirl_cli.documents.tables import Column, Format, Interval, Spread, Table, is_missing, sort_key, written

DETERMINISTIC = settings(derandomize=True, deadline=None, max_examples=150)
NUMBERS = st.one_of(
    st.integers(-(10**6), 10**6),
    st.floats(-1e6, 1e6),
    st.builds(Spread, st.floats(-1e6, 1e6), st.floats(0, 1e3)),
    st.builds(Interval, st.floats(-1e6, 0), st.floats(0, 1e6)),
    st.none(),
)


def one_column(column, *cells):
    return Table((column,), tuple((cell,) for cell in cells))


def shown(column, *cells):
    return [row[0] for row in one_column(column, *cells).shown()]


@pytest.mark.parametrize(
    ("numeric", "cells"),
    [
        (True, (1, None, 2.5)),
        (True, (Spread(1.0, nan), Interval(-1.0, 2.0), nan)),
        (True, (np.float64(1.5), np.int64(3), np.float32(2))),
        (False, ("nominal", "new", "n/a")),  # words are words, whatever they begin with
        (False, ("2026-01-31", "3 m", "-1")),
        (False, (1, "not known", 2)),
        (False, (True, False)),
        (False, (None, nan, "", Spread(nan, nan))),
        (False, ()),
    ],
)
def test_a_column_is_numeric_where_all_its_values_are_numbers(numeric, cells):
    assert one_column(Column("x"), *cells).numeric == (numeric,)


def test_text_is_left_and_numbers_are_right():
    columns = (Column("path"), Column("n"), Column("length_m", "length m", decimals=2))
    table = Table(columns, (("nominal", 6, 6.3), ("driven", 10, -10.0), ("-5", None, nan)))
    assert written(table).split("\n") == [
        "path      n  length m",
        "nominal   6      6.30",
        "driven   10    -10.00",
        "-5        -         -",
    ]


def test_digits_are_those_of_the_column():
    assert shown(Column("x", decimals=2), 1, 2.345, Spread(-3, 0.5), Interval(1, 20)) == [
        "1.00",
        "2.35",
        "-3.00 ± 0.50",
        "1.00 to 20.00",
    ]
    assert shown(Column("x"), 1, 20, None) == ["1", "20", "-"]
    assert shown(Column("x"), 0.00123456, -12.3456, 0) == ["0.00", "-12.35", "0.00"]
    assert shown(Column("x", significant=2), 0.00123456, 0.5) == ["0.00", "0.50"]
    assert shown(Column("x"), 1e-12, 2.5e-13) == ["1.000e-12", "2.500e-13"]
    assert shown(Column("x"), 1.5e20) == ["1.500e+20"]
    assert shown(Column("x"), 0.0, inf, -inf) == ["0.000", "inf", "-inf"]


def test_signs_units_and_zero():
    assert shown(Column("x", decimals=1, sign=True), 1, -1, 0.01, -0.01) == ["+1.0", "-1.0", "0.0", "0.0"]
    assert shown(Column("x", decimals=1), -0.01) == ["0.0"]
    assert shown(Column("share", "share %", decimals=0, scale=100), 0.61, Interval(0.5, 0.7)) == ["61", "50 to 70"]
    assert shown(Column("angle_rad", "angle deg", decimals=0, scale=180 / pi), -pi / 2) == ["-90"]


def test_missing_and_spread_without_a_spread():
    assert shown(Column("x", decimals=1), Spread(2.0, nan), Spread(nan, 1.0), Interval(nan, nan), None, "") == [
        "2.0",
        "-",
        "-",
        "-",
        "-",
    ]
    assert shown(Column("x"), True, False, None) == ["yes", "no", "-"]


def test_what_cells_are_sorted_by():
    cells = (2, np.float64(0.5), Spread(-3.0, 1.0), Interval(4.0, 5.0), inf)
    assert [sort_key(cell) for cell in cells] == [2.0, 0.5, -3.0, 4.0, inf]
    assert [sort_key(cell) for cell in ("2", "", None, nan, True)] == [None] * 5
    assert [is_missing(cell) for cell in ("2", "", None, nan, True, 0, False)] == [
        False,
        True,
        True,
        True,
        *[False] * 3,
    ]


def test_the_minus_sign_is_that_of_the_format():
    table = Table((Column("a-b"), Column("x", decimals=1)), (("c-d", -1.5), ("e", Interval(-2, -1))))
    assert "c-d          -1.5\ne    -2.0 to -1.0" in written(table)
    assert "| c-d |         -1.5 |" in written(table, Format.MARKDOWN)
    assert r"c-d & $-$1.5 \\" in written(table, Format.LATEX)
    assert r"e & $-$2.0 to $-$1.0 \\" in written(table, Format.LATEX)


def test_csv_and_json_hold_plain_numbers_in_their_own_units():
    table = Table(
        (
            Column("group"),
            Column("length_m", "length m", decimals=1),
            Column("difference_m", decimals=1),
            Column("contact_share", "contact %", scale=100),
            Column("learnt"),
        ),
        (
            ('a, "b"', Spread(6.54321, 0.1), Interval(-1.0, 2.5), 0.61, True),
            ("c", Spread(2.0, nan), None, nan, False),
            ("-", 3, Interval(nan, nan), 1, None),
        ),
        "Caption.",
        "Note.",
    )
    names = ("group", "length_m_mean", "length_m_std", "difference_m_lower", "difference_m_upper", "contact_share")
    rows = [
        ('a, "b"', 6.54321, 0.1, -1.0, 2.5, 0.61, True),
        ("c", 2.0, None, None, None, None, False),
        ("-", 3, None, None, None, 1, None),
    ]
    records = [dict(zip((*names, "learnt"), row, strict=True)) for row in rows]
    assert table.records() == records
    assert json.loads(written(table, Format.JSON)) == records
    read = list(csv.reader(io.StringIO(written(table, Format.CSV))))
    assert read == [
        [*names, "learnt"],
        *[["" if value is None else str(value) for value in row] for row in rows],
    ]
    assert (
        written(
            one_column(
                Column("x"),
            ),
            Format.CSV,
        )
        == "x"
    )


@DETERMINISTIC
@given(st.lists(st.tuples(NUMBERS, NUMBERS), min_size=1, max_size=5))
def test_every_number_comes_back_from_csv(rows):
    table = Table((Column("a"), Column("b")), tuple(rows))
    names = list(table.records()[0])
    read = list(csv.DictReader(io.StringIO(written(table, Format.CSV))))
    assert [[row[name] and float(row[name]) for name in names] for row in read] == [
        ["" if value is None else value for value in record.values()] for record in table.records()
    ]


@DETERMINISTIC
@given(st.lists(NUMBERS, min_size=1, max_size=6))
def test_numbers_of_a_column_have_equally_many_decimals(cells):
    texts = [text for text in shown(Column("x"), *cells) if text != "-"]
    numbers = [number for text in texts for number in re.split(" ± | to ", text)]
    assert len({len(number.partition("e")[0].partition(".")[2]) for number in numbers}) <= 1


def test_columns_without_a_value_can_be_left_out():
    table = Table((Column("a"), Column("b"), Column("c")), ((1, None, "x"), (2, nan, None)), "Caption.")
    assert written(table.without_empty()) == "Caption.\na  c\n1  x\n2  -"


def test_captions_and_notes_stand_around():
    table = Table((Column("a"),), ((1,),), "Of **it**: 50 %.", "Why: `x_y`.")
    assert written(table) == "Of it: 50 %.\na\n1\nWhy: `x_y`."
    assert written(table, Format.MARKDOWN) == "Of **it**: 50 %.\n\n|   a |\n| --: |\n|   1 |\n\nWhy: `x_y`."
    latex = written(table, Format.LATEX)
    assert latex.startswith(r"Of \textbf{it}: 50 \%." + "\n\n" + r"\begin{tabular}{r}")
    assert latex.endswith(r"\end{tabular}" + "\n\n" + r"Why: \texttt{x\_y}.")


def test_latex_escapes_what_latex_reads():
    table = Table((Column("a_b"), Column("c")), (("50 % of {x} & y", -1.5), ("#1 ~ ^ m²", Spread(2.0, 0.5))))
    assert written(table, Format.LATEX).splitlines() == [
        r"\begin{tabular}{lr}",
        r"\toprule",
        r"a\_b & c \\",
        r"\midrule",
        r"50 \% of \{x\} \& y & $-$1.500 \\",
        r"\#1 \textasciitilde{} \textasciicircum{} m$^2$ & 2.000 $\pm$ 0.500 \\",
        r"\bottomrule",
        r"\end{tabular}",
    ]


def test_what_is_no_table_is_refused():
    with pytest.raises(ValueError, match="2 columns cannot take the row"):
        Table((Column("a"), Column("b")), ((1, 2), (1,)))
    with pytest.raises(ValueError, match="at least one column"):
        Table((), ())
    with pytest.raises(TypeError, match=r"a text, a number, a composite or None in a cell, found \[1\]"):
        one_column(Column("a"), [1])


@pytest.mark.parametrize(
    "text", ["=1+1", "+cmd|' /C calc'!A0", "-2+3+cmd|x", "@SUM(A1)", "\t=1", "-name", "'=1", "''-x"]
)
def test_texts_that_begin_like_formulas_are_quoted_in_csv_and_read_back(tmp_path, text):
    table = Table((Column("name"), Column("value_m")), ((text, -1.5), ("plain", 2.0)))
    lines = written(table, Format.CSV).splitlines()
    cells = next(csv.reader(lines[1:2]))
    assert cells == [f"'{text}", "-1.5"]
    (tmp_path / "sheet.csv").write_text(written(table, Format.CSV))
    _, rows = read_sheet(tmp_path / "sheet.csv", ["name", "value_m"], ["name"], "rows")
    assert rows[0].cells["name"] == " ".join(text.split())


def test_coordinates_are_not_quoted_in_csv():
    table = Table((Column("nominal_m"),), (("-1.5,2; -3e-2,4",),))
    assert written(table, Format.CSV).splitlines()[1] == '"-1.5,2; -3e-2,4"'
