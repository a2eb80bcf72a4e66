"""Answers to a questionnaire: what is read, what is refused and how, and the shares of the levels."""

import pytest

from navirl_cli.errors import ArtefactError
from navirl_cli.study.questionnaire import Answer, read_answers, shares

HEADER = "participant,question,modality,answer\n"


@pytest.fixture
def read(tmp_path):
    """Write a file and read it."""

    def write_and_read(content, levels=5):
        path = tmp_path / "answers.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_answers(path, levels)

    return write_and_read


def test_answers_are_read_in_the_order_of_the_file(read):
    found = read(HEADER + "p02,Was it easy?,joystick,4\np01,Was it easy?,force,1\n")
    assert found == [Answer("p02", "Was it easy?", "joystick", 4), Answer("p01", "Was it easy?", "force", 1)]


def test_columns_may_stand_in_any_order(read):
    (found,) = read("answer,modality,participant,question\n5,force,p01,Fun?\n")
    assert found == Answer("p01", "Fun?", "force", 5)


@pytest.mark.parametrize("content", ["participant,question,answer\np01,Fun?,3\n", HEADER + "p01,Fun?,,3\n"])
def test_a_question_may_be_about_no_modality(read, content):
    assert read(content) == [Answer("p01", "Fun?", "", 3)]


def test_files_of_a_german_excel_are_read(read):
    text = "participant;question;modality;answer\r\np01;Fühlten Sie sich sicher, auch nah?;force;2\r\n;;;\r\n"
    assert read(text.encode("utf-8-sig")) == [Answer("p01", "Fühlten Sie sich sicher, auch nah?", "force", 2)]


def test_a_table_that_was_copied_from_a_spreadsheet_is_read(read):
    assert read("participant\tquestion\tanswer\np01\tFun, or not?\t3\n") == [Answer("p01", "Fun, or not?", "", 3)]


def test_the_header_that_chooses_the_separator_may_stand_below_empty_lines(read):
    assert read("\n\nparticipant;question;answer\np01;Fun?;3\n") == [Answer("p01", "Fun?", "", 3)]


def test_texts_in_quotes_may_hold_separators_quotes_and_new_lines(read):
    (found,) = read(HEADER + 'p01,"Was it ""easy"",\nor not?",force,2\n')
    assert found.question == 'Was it "easy", or not?'


def test_a_separator_in_a_text_alone_does_not_choose_it(read):
    assert read(HEADER + "p01,Easy; or not?,force,2\n")[0].question == "Easy; or not?"


def test_space_around_texts_and_empty_lines_are_nothing(read):
    assert read("\n" + HEADER + "\n p01 , Fun?  , force, 2 \n\n") == [Answer("p01", "Fun?", "force", 2)]


@pytest.mark.parametrize(("answer", "levels"), [("1", 5), ("5", 5), ("7", 7), ("2", 2)])
def test_every_level_is_an_answer(read, answer, levels):
    assert read(f"{HEADER}p01,Fun?,force,{answer}", levels)[0].answer == int(answer)


@pytest.mark.parametrize(
    ("answer", "levels"),
    [
        ("0", 5),
        ("6", 5),
        ("5", 4),
        ("-1", 5),
        ("2.5", 5),
        ("3.0", 5),
        ("yes", 5),
        ("1_0", 11),
        ("٣", 5),
        ("9" * 5000, 5),
    ],
)
def test_what_is_no_level_is_refused(read, answer, levels):
    message = rf"answers\.csv: line 3, column answer: expected a whole number from 1 to {levels}, found '{answer[:50]}"
    with pytest.raises(ArtefactError, match=message + r".*; correct the answer$"):
        read(f"{HEADER}p01,Fun?,force,1\np02,Fun?,force,{answer}\n", levels)


def test_no_answer_is_refused_with_what_to_do(read):
    with pytest.raises(ArtefactError, match=r"line 2, column answer: .*, found nothing; remove the line"):
        read(HEADER + "p01,Fun?,force,\n")


@pytest.mark.parametrize(("row", "column"), [(",Fun?,force,1", "participant"), ("p01, ,force,1", "question")])
def test_an_empty_text_is_refused(read, row, column):
    with pytest.raises(ArtefactError, match=rf"line 2, column {column}: expected a text, found nothing; fill it in$"):
        read(HEADER + row)


@pytest.mark.parametrize(
    ("header", "found"),
    [
        ("participant,question,modality", r"found no column answer but 'participant,question,modality'; name the"),
        ("Participant,question,answer", r"found no column participant but 'Participant,question,answer'"),
        ("participant,question,answer,age", r"found an unknown column 'age'; remove it"),
        ("participant,question,answer,", r"found an unknown column ''; remove it"),
        ("participant,question,answer,answer", r"found a second column 'answer'; remove it"),
        ("", r"found nothing; give the file with the answers$"),
    ],
)
def test_other_columns_are_refused(read, header, found):
    expected = r"answers\.csv: line 1: expected a header of participant,question,modality,answer, "
    with pytest.raises(ArtefactError, match=expected + found):
        read(header and f"{header}\np01,Fun?,3,3\n")


@pytest.mark.parametrize("row", ["p01,Fun, or not?,force,1", "p01,Fun?,force"])
def test_a_row_of_another_length_is_refused(read, row):
    count = row.count(",") + 1
    message = rf"line 2: expected 4 columns as in the header, found {count}; put .* in double quotes"
    with pytest.raises(ArtefactError, match=message):
        read(f"{HEADER}{row}\n")


def test_a_second_answer_to_the_same_question_is_refused(read):
    rows = "p01,Fun?,force,1\np01,Fun?,joystick,1\np02,Fun?,force,1\n\np01,Fun?,force,1\n"
    message = (
        r"line 6: expected one answer of 'p01' to 'Fun\?' about 'force', found a second after that of line 2; remove"
    )
    with pytest.raises(ArtefactError, match=message):
        read(HEADER + rows)
    with pytest.raises(ArtefactError, match=r"line 3: expected one answer of 'p01' to 'Fun\?', found a second"):
        read("participant,question,answer\np01,Fun?,1\np01,Fun?,2\n")


def test_a_header_alone_is_refused(read):
    with pytest.raises(
        ArtefactError, match=r"answers\.csv: expected answers below the header, found none; add one line"
    ):
        read(HEADER)


@pytest.mark.parametrize(
    ("content", "found"),
    [
        (
            (HEADER + "p01,Fun?,force,1\np02,Für?,force,2\n").encode("cp1252"),
            "line 3: expected UTF-8, found the byte 0xfc",
        ),
        ((HEADER + "p01,Fun?,force,1\n").encode("utf-16"), "line 1: expected UTF-8, found the byte 0xff"),
    ],
)
def test_another_encoding_is_refused(read, content, found):
    with pytest.raises(ArtefactError, match=rf'answers\.csv: {found}; save it as "CSV UTF-8"$'):
        read(content)


@pytest.mark.parametrize("row", ['p01,"Fun?,force,1\n', 'p01,"Fun"?,force,1\n', f"p01,{'x' * 200000},force,1\n"])
def test_what_is_no_csv_is_refused(read, row):
    with pytest.raises(ArtefactError, match=r'answers\.csv: line 2: expected CSV, found: .*; save it as "CSV UTF-8"$'):
        read(HEADER + row)


def test_a_file_that_cannot_be_read_is_refused(tmp_path):
    with pytest.raises(
        ArtefactError, match=r"none\.csv: expected a CSV file, cannot be read: No such file or directory"
    ):
        read_answers(tmp_path / "none.csv")


def answers(*rows):
    return [Answer(f"p{number}", *row) for number, row in enumerate(rows)]


def test_shares_count_levels_by_question_and_modality_in_the_order_of_the_file():
    found = shares(
        answers(
            ("B?", "joystick", 1), ("A?", "force", 5), ("B?", "force", 2), ("A?", "joystick", 3), ("B?", "joystick", 1)
        )
    )
    assert [(one.question, one.modality, one.counts.tolist()) for one in found] == [
        ("B?", "joystick", [2, 0, 0, 0, 0]),
        ("B?", "force", [0, 1, 0, 0, 0]),
        ("A?", "joystick", [0, 0, 1, 0, 0]),  # modalities stand in the same order in every question
        ("A?", "force", [0, 0, 0, 0, 1]),
    ]
    assert [one.count for one in found] == [2, 1, 1, 1]


@pytest.mark.parametrize(("given", "median"), [((4,), 4.0), ((1, 2, 5), 2.0), ((1, 1, 4, 5), 2.5), ((3, 3, 3, 1), 3.0)])
def test_the_median_of_a_share(given, median):
    (found,) = shares(answers(*(("A?", "", level) for level in given)), 5)
    assert found.median == median


def test_shares_have_as_many_levels_as_the_scale():
    assert shares(answers(("A?", "", 7)), 7)[0].counts.tolist() == [0, 0, 0, 0, 0, 0, 1]
    assert shares([], 5) == []
