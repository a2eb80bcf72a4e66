"""Reports as text, Markdown and HTML: what is written can be read back."""

import re
from base64 import b64decode, b64encode
from hashlib import sha256
from html.parser import HTMLParser
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from navirl_cli.documents.document import Bullets, Heading, Paragraph, Picture, Report
from navirl_cli.documents.inline import Mark, Run, plain_of, runs_of
from navirl_cli.documents.markdown import to_markdown
from navirl_cli.documents.page import to_html
from navirl_cli.documents.tables import Column, Spread, Table
from navirl_cli.documents.text import to_text
from navirl_cli.errors import ArtefactError

DETERMINISTIC = settings(derandomize=True, deadline=None, max_examples=150)
VOID = {"meta", "link", "img", "wbr", "hr"}
#: Whatever has a meaning in one of the two outputs, between plain characters.
SPECIAL = "ab1 *_`|\\<>&#-+=~[]()!.:$\"'\n\t\x00é距\u2028\ud800\u00a0"
PIECES = [*SPECIAL, "# ", "- ", "2. ", "**", "&amp;", "</td>", "<script>"]
TEXTS = st.lists(st.sampled_from(PIECES), max_size=12).map("".join)


class Page(HTMLParser):
    """Elements of a page in order, each with attributes and text; refuses what is not closed in order."""

    def __init__(self, text):
        super().__init__()
        self.elements, self.open = [], []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        element = {"tag": tag, "text": "", **dict(attrs)}
        self.elements.append(element)
        if tag not in VOID:
            self.open.append(element)

    def handle_endtag(self, tag):
        assert self.open.pop()["tag"] == tag

    def handle_data(self, data):
        for element in self.open:
            element["text"] += data

    def all(self, *tags):
        return [element for element in self.elements if element["tag"] in tags]


def markdown(*blocks, folder=Path()):
    return to_markdown(Report("t", blocks), folder).removeprefix("# t\n\n").removesuffix("\n")


def texts(header, *rows, caption=""):
    return Table(tuple(map(Column, header)), rows, caption)


@pytest.fixture
def picture(tmp_path):
    Image.new("RGB", (31, 20), "red").save(tmp_path / "red.png")
    return tmp_path / "red.png"


def test_marks_differ_from_characters_that_look_like_them():
    runs = [("a ", Mark.NONE), ("b*", Mark.CODE), (" ", Mark.NONE), ("c d", Mark.STRONG), (".", Mark.NONE)]
    assert runs_of("a `b*` **c d**.") == tuple(Run(text, mark) for text, mark in runs)
    for text in ("2 ** 3 ** 4", "a ` b", "``a``", "``a`", "** a **", "****", "a*b*c", "`", "**a"):
        assert runs_of(text) == (Run(text, Mark.NONE),)


def test_blanks_become_one_space_and_unprintable_characters_a_sign():
    assert plain_of("  a\r\n\t b\u2028c\x00\ud800 ") == "a b c\ufffd\ufffd"
    assert plain_of("3\u00a0m") == "3\u00a0m"


@DETERMINISTIC
@given(TEXTS, TEXTS)
def test_every_text_can_be_read_back_from_the_page(one, other):
    report = Report(
        "t" + one,
        (Paragraph(one), Bullets((one, other)), Heading(other), texts((one, other), (other, one), caption=other)),
        "f" + other,
    )
    text = to_html(report)
    text.encode()
    page = Page(text)
    assert [element["text"] for element in page.all("title", "h1")] == [plain_of("t" + one)] * 2
    assert [element["text"] for element in page.all("p")] == [plain_of(one), plain_of("f" + other)]
    assert [element["text"] for element in page.all("li")[1:]] == [plain_of(one), plain_of(other)]
    assert [element["text"] for element in page.all("a", "h2")] == [plain_of(other)] * 2
    cells = [plain_of(one), plain_of(other), plain_of(other or "-"), plain_of(one or "-")]
    assert [element["text"] for element in page.all("th", "td")] == cells
    for mark, tag in ((Mark.CODE, "code"), (Mark.STRONG, "strong")):
        runs = [run.text for run in runs_of(one) if run.mark is mark]
        assert [element["text"] for element in Page(to_html(Report("t", (Paragraph(one),)))).all(tag)] == runs


@DETERMINISTIC
@given(st.lists(st.tuples(TEXTS, TEXTS, TEXTS), min_size=1, max_size=4))
def test_rows_of_a_markdown_table_keep_their_cells(rows):
    lines = markdown(texts(*rows)).split("\n")
    assert len(lines) == len(rows) + 1
    for line, row in zip((lines[0], *lines[2:]), rows, strict=True):
        cells = re.split(r"(?<!\\)(?:\\\\)*\|", line)
        assert len(cells) == len(row) + 2
        assert (cells[0], cells[-1]) == ("", "")
    assert re.fullmatch(r"\|( -+:? \|){3}", lines[1])


@pytest.mark.parametrize(
    ("text", "written"),
    [
        # as two independent readers of GitHub's dialect take it
        ("a_p and sigma_p, _x_", r"a_p and sigma_p, \_x\_"),
        ("2 * 3 ** 4 ~5~ $6$", r"2 \* 3 \*\* 4 \~5\~ \$6\$"),
        ("<b> & R&D &amp; &#35;", r"\<b> & R\&D \&amp; \&#35;"),
        ("[a](b) ![c] \\ `", r"\[a\](b) !\[c\] \\ \`"),
        ("# a", r"\# a"),
        ("C# ##", r"C# \##"),
        ("- a", r"\- a"),
        ("---", r"\---"),
        ("-3.5 m", "-3.5 m"),
        ("> a", r"\> a"),
        ("1. a", r"1\. a"),
        ("12) a", r"12\) a"),
        ("1.5 m", "1.5 m"),
        ("http://a.b/c_d www.a_b.c", r"http\://a.b/c_d www\.a_b.c"),
        ("line\n# other", r"line \# other"),
        ("`a*|<b>` **c_d**", "`a*|<b>` **c_d**"),
        ("**Note:** x", "**Note:** x"),
        ("**Note:**x", "<strong>Note:</strong>x"),
        ("x**(a)** x", "x<strong>(a)</strong> x"),
    ],
)
def test_markdown_escapes_its_own_characters(text, written):
    assert markdown(Paragraph(text)) == written


WHOLE = r"""# Two `drives`

What was seen.

## Numbers

| who  |  length m | says            |
| ---- | --------: | --------------- |
| a\|b | 6.5 ± 0.1 | <code>\|</code> |
| c    |         - | -1              |

Nobody drove `c`.

Nothing **yet**.

| empty |
| ----- |

- one
- \- two

### Deeper

![A \*red\* field.](red.png)

A \*red\* `field`.

---

Made by a test.
"""


def test_a_report_in_markdown(picture, tmp_path):
    report = Report(
        "Two `drives`",
        (
            Paragraph("What was seen."),
            Heading("Numbers"),
            Table(
                (Column("who"), Column("length m", decimals=1), Column("says")),
                (("a|b", Spread(6.5, 0.1), "`|`"), ("c", None, "-1")),
                note="Nobody drove `c`.",
            ),
            texts(("empty",), caption="Nothing **yet**."),
            Bullets(("one", "- two")),
            Heading("Deeper", 3),
            Picture(picture, "A *red* `field`."),
        ),
        "Made by a test.",
    )
    assert to_markdown(report, tmp_path) == WHOLE


def test_a_report_as_text(picture):
    blocks = (
        Heading("Log `a`"),
        Bullets(("2 s", "clock: **wrong**")),
        Table((Column("topic"), Column("n")), (("/odom", 3),), "Topics.", "`-`: none."),
        Paragraph(""),
        Paragraph("Name it with `frame`."),
        Picture(picture, "A **red** square."),
        Heading("Empty"),
        Bullets(()),
    )
    assert to_text(blocks) == (
        "Log `a`\n- 2 s\n- clock: wrong\n\n"
        "Topics.\ntopic  n\n/odom  3\n`-`: none.\n\n"
        "Name it with `frame`.\n\nA red square.\n\nEmpty"
    )


def test_markdown_links_pictures_from_its_own_folder(tmp_path, monkeypatch):
    there = tmp_path / "fig (ä)"
    there.mkdir()
    Image.new("RGB", (2, 2)).save(there / "a b.png")
    (tmp_path / "out" / "deep").mkdir(parents=True)
    monkeypatch.chdir(tmp_path)
    Path("link").symlink_to(tmp_path / "out" / "deep")
    block = Picture(Path("fig (ä)/a b.png"), "", "x")
    assert markdown(block, folder=Path("out")) == "![x](../fig%20%28%C3%A4%29/a%20b.png)"
    assert markdown(block, folder=Path("link")) == "![x](../../fig%20%28%C3%A4%29/a%20b.png)"
    Image.new("RGB", (2, 2)).save("link/c.png")
    assert markdown(Picture(Path("link/c.png"), "", "x"), folder=Path("out")) == "![x](deep/c.png)"


def test_pictures_are_in_the_page_byte_for_byte(picture, tmp_path):
    drawing = tmp_path / "line.svg"
    drawing.write_text("<svg xmlns='http://www.w3.org/2000/svg' width='9' height='9'/>")
    blocks = (Picture(picture, 'Red & "square".'), Picture(drawing, "", "a line"), Picture(drawing, ""))
    images = Page(to_html(Report("t", blocks))).all("img")
    assert [image["alt"] for image in images] == ['Red & "square".', "a line", "line"]
    for image, path, kind in zip(images, (picture, drawing, drawing), ("png", "svg+xml", "svg+xml"), strict=True):
        head, data = image["src"].split(",")
        assert head == f"data:image/{kind};base64"
        assert b64decode(data) == path.read_bytes()
    assert (images[0]["width"], images[0]["height"]) == ("16", "10")  # half of 31 by 20
    assert "width" not in images[1]


@pytest.mark.parametrize("write", [to_html, lambda report: to_markdown(report, Path())], ids=["page", "markdown"])
def test_files_that_are_not_pictures_are_refused(write, tmp_path):
    (tmp_path / "text.png").write_text("no picture")
    (tmp_path / "plot.pdf").write_bytes(b"%PDF")
    for name, problem in (
        ("gone.png", r"expected a picture for the report, cannot read it \(No such file or directory\); draw it again"),
        (".", r"cannot read it \(Is a directory\)"),
        ("text.png", r"expected a PNG or SVG picture, found another file"),
        ("plot.pdf", r"expected a PNG or SVG picture, found another file"),
    ):
        path = tmp_path / name
        with pytest.raises(ArtefactError, match=f"^{re.escape(str(path))}: .*{problem}"):
            write(Report("t", (Picture(path, "c"),)))


@DETERMINISTIC
@given(st.lists(st.sampled_from(["A", "a", "A 2", "a-2", "Größe", "距離", "!!!", "section", "", "A 2 2"]), max_size=7))
def test_every_heading_has_its_own_name_and_the_contents_lead_there(titles):
    page = Page(to_html(Report("t", tuple(Heading(title, 2 + i % 2) for i, title in enumerate(titles)))))
    headings = page.all("h2", "h3")
    names = [heading["id"] for heading in headings]
    assert len(set(names)) == len(titles)
    assert all(re.fullmatch(r"\S+", name) for name in names)
    first = [(f"#{element['id']}", element["text"]) for element in headings if element["tag"] == "h2"]
    assert [(link["href"], link["text"]) for link in page.all("a")] == first
    assert len(page.all("nav")) == bool(first)


def test_names_of_headings_are_their_words():
    titles = ("What was `seen`?", "Größe", "距離", "!!!", "Größe")
    page = Page(to_html(Report("t", tuple(map(Heading, titles)))))
    assert [heading["id"] for heading in page.all("h2")] == ["what-was-seen", "grösse", "距離", "section", "grösse-2"]


def test_the_page_is_complete_and_requests_nothing(picture):
    blocks = (
        Heading("A"),
        Table((Column("who"), Column("n")), (("a", 1), ("b", 2)), note="By **hand**."),
        Table((Column("n"),), ((-3,),)),
        Picture(picture, ""),
    )
    text = to_html(Report("Title", blocks, "foot"))
    assert text.startswith('<!DOCTYPE html>\n<html lang="en">')
    page = Page(text)
    assert [element["text"] for element in page.all("h1")] == ["Title"]
    metas = {meta.get("name") or meta.get("http-equiv") or "charset": meta for meta in page.all("meta")}
    assert metas["charset"]["charset"] == "utf-8"
    assert metas["viewport"]["content"] == "width=device-width, initial-scale=1"
    policy = dict(part.split(" ", 1) for part in metas["Content-Security-Policy"]["content"].split("; "))
    assert policy.pop("default-src") == policy.pop("base-uri") == policy.pop("form-action") == "'none'"
    assert policy.pop("img-src") == "data:"
    for tag in ("style", "script"):
        (element,) = page.all(tag)
        digest = b64encode(sha256(element["text"].encode()).digest()).decode()
        assert policy.pop(f"{tag}-src") == f"'sha256-{digest}'"
    assert policy == {}
    addresses = [element[key] for element in page.elements for key in ("src", "href") if key in element]
    assert all(address.startswith(("data:", "#")) for address in addresses)
    assert not re.search(r"@import|url\(|style=", text)
    cells = [f"{cell['text']} {cell.get('scope', '')} {cell.get('class', '')}" for cell in page.all("th", "td")]
    assert cells == [
        "who col ",
        "n col number",
        "a row ",
        "1  number",
        "b row ",
        "2  number",
        "n col number",
        "\N{MINUS SIGN}3  number",
    ]
    assert [element["text"] for element in page.all("p")] == ["By hand.", "foot"]


def test_empty_reports_and_tables_are_pages_too():
    empty = Report("Nothing", ())
    assert to_markdown(empty, Path()) == "# Nothing\n"
    assert [element["text"].strip() for element in Page(to_html(empty)).all("main")] == [""]
    page = Page(to_html(Report("t", (texts(("a", "b")), Bullets(()), Paragraph("")))))
    assert (len(page.all("th")), len(page.all("td")), len(page.all("ul"))) == (2, 0, 0)


def test_equal_reports_give_equal_bytes(picture):
    def report():
        return Report("t", (Heading("A"), Table((Column("x"),), ((1,),)), Picture(picture, "c")), "f")

    assert to_html(report()) == to_html(report())
    assert to_markdown(report(), picture.parent) == to_markdown(report(), picture.parent)


def test_a_heading_needs_a_level_below_the_title():
    with pytest.raises(ValueError, match="2 to 6, found 1"):
        Heading("a", 1)
