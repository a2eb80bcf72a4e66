"""A report's page in a browser: it opens, sorts, enlarges, prints, and can be read on a phone and in the dark."""

import re
from base64 import b64decode, b64encode

import pytest
from browser import CHROMIUM, Browser
from PIL import Image

from navirl_cli.documents.document import Bullets, Heading, Paragraph, Picture, Report
from navirl_cli.documents.page import to_html
from navirl_cli.documents.tables import Column, Spread, Table

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium found; on Debian: apt-get install chromium")


#: Names of the files of one picture for other screens.
SCREENS = ("dark", "narrow", "narrow_dark")


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    """A browser that has the page of a report open."""
    folder = tmp_path_factory.mktemp("page")
    Image.new("RGB", (1400, 800), "#0072B2").save(folder / "wide.png")
    for name, colour in (("light", "#ffffff"), ("dark", "#141414"), ("narrow", "#ff0000"), ("narrow_dark", "#00ff00")):
        Image.new("RGB", (200 if "narrow" in name else 1200, 2400), colour).save(folder / f"{name}.png")
    (folder / "line.svg").write_text(
        "<svg xmlns='http://www.w3.org/2000/svg' width='90' height='60'><path style='fill: red' d='M0 0H90V60z'/></svg>"
    )
    (folder / "report.html").write_text(to_html(report_with(folder)), encoding="utf-8")
    browser = Browser(folder / "profile")
    browser.path = folder / "report.html"
    yield browser
    browser.close()


@pytest.fixture
def page(browser):
    """The page as it opens on a desk."""
    browser.show()
    browser.open(browser.path)
    return browser


def report_with(folder):
    values = (
        ("b", Spread(2.5, 0.5)),
        ("a", None),
        ("p10", 10.0),
        ("p9", -1.0),
        ("c", "not known"),
        ("d", float("nan")),
        ("e", float("inf")),
        ("f", 2.25),
    )
    wide = tuple(Column(f"column{j}" if j else "", decimals=1) for j in range(12))
    return Report(
        "What a `robot` learnt",
        (
            Paragraph(f"Some **strong** words, and a long one: {'x' * 300}."),
            Heading("Numbers"),
            Table((Column("who"), Column("length")), values, "By participant."),
            Table(wide, ((1234567.5,) * 12,) * 60, "Wide, and longer than a sheet."),
            Table((Column("file"), Column("hash")), (("`demos.json`", f"`{'0123456789abcdef' * 4}`"),)),
            Heading("Figures of " + "n" * 31),
            Bullets(("one", "two")),
            Picture(folder / "wide.png", "A `wide` one.", "blue"),
            Picture(folder / "line.svg", "A drawing."),
            Table((Column("trial"), Column("condition")), (("participant-with-a-name/1", "autonomous"),) * 2),
            Picture(folder / "light.png", "Of every screen.", "screens", *(folder / f"{n}.png" for n in SCREENS)),
        ),
        "Made by a test.",
    )


def column(page, index):
    return page.run(f"[...document.querySelector('tbody').rows].map(row => row.cells[{index}].textContent)")


def sorted_as(page):
    return page.run("[...document.querySelectorAll('thead')[0].rows[0].cells].map(cell => cell.ariaSort)")


def complaints(page):
    kinds = ("Log.entryAdded", "Runtime.consoleAPICalled", "Runtime.exceptionThrown")
    return [event["params"] for event in page.events if event["method"] in kinds]


def test_it_opens_from_a_file_without_messages_or_requests(page):
    images = "[...document.querySelectorAll('figure img')]"
    assert page.run(f"{images}.map(image => image.complete && image.naturalWidth)") == [1400, 90, 1200]
    assert page.run("document.title") == "What a robot learnt"
    assert complaints(page) == []
    sent = [
        event["params"]["request"]["url"] for event in page.events if event["method"] == "Network.requestWillBeSent"
    ]
    assert sent[0] == page.path.as_uri()
    assert all(url.startswith("data:") for url in sent[1:])


def test_it_has_no_access_to_the_network_and_runs_no_other_script(page):
    refused = page.run("""new Promise(resolve => {
        const refused = [];
        document.addEventListener("securitypolicyviolation", event => {
            refused.push(event.effectiveDirective);
            if (refused.length === 3) resolve(refused.sort());
        });
        document.body.append(Object.assign(new Image(), {src: "http://127.0.0.1:9/x.png"}));
        document.body.append(Object.assign(document.createElement("script"), {textContent: "globalThis.ran = 1"}));
        fetch("http://127.0.0.1:9/").catch(() => {});
    })""")
    assert refused == ["connect-src", "img-src", "script-src-elem"]
    assert page.run("globalThis.ran") is None
    assert complaints(page) != []


def test_a_click_sorts_numbers_before_words_and_missing_values_last(page):
    assert sorted_as(page) == [None, None]
    length = "table:first-of-type th:nth-child(2) button"
    page.click(length)
    assert column(page, 1) == ["\N{MINUS SIGN}1.00", "2.25", "2.50 ± 0.50", "10.00", "inf", "not known", "-", "-"]
    assert sorted_as(page) == [None, "ascending"]
    page.click(length)
    assert column(page, 1) == ["inf", "10.00", "2.50 ± 0.50", "2.25", "\N{MINUS SIGN}1.00", "not known", "-", "-"]
    assert column(page, 0) == ["e", "p10", "b", "f", "p9", "c", "a", "d"]
    assert sorted_as(page) == [None, "descending"]
    page.click(length)
    assert column(page, 0) == ["b", "a", "p10", "p9", "c", "d", "e", "f"]
    assert sorted_as(page) == [None, None]


def test_a_key_sorts_too(page):
    page.run("document.querySelector('thead button').focus()")
    page.press("Enter", 13, "\r")
    assert column(page, 0) == ["a", "b", "c", "d", "e", "f", "p9", "p10"]
    page.press(" ", 32, " ")
    assert column(page, 0) == ["p10", "p9", "f", "e", "d", "c", "b", "a"]
    assert sorted_as(page) == ["descending", None]


def test_only_headers_with_a_name_and_something_to_sort_are_buttons(page):
    buttons = "[...document.querySelectorAll('table')].map(table => table.querySelectorAll('button').length)"
    assert page.run(buttons) == [2, 11, 0, 2]


def test_a_figure_is_enlarged_by_click_or_key_and_closed_again(page):
    is_open = "document.querySelector('dialog').open"
    width = "document.querySelector('{} img').getBoundingClientRect().width"
    before = page.run(width.format("figure"))
    page.click("figure img")
    assert page.run(is_open)
    assert page.run("document.querySelector('dialog img').alt") == "blue"
    assert page.run(width.format("dialog")) > before
    page.press("Escape", 27)
    assert not page.run(is_open)
    assert page.run("document.activeElement === document.querySelector('figure button.enlarge')")
    page.press("Enter", 13, "\r")
    assert page.run(is_open)
    page.click("dialog img")
    assert not page.run(is_open)


@pytest.mark.parametrize("width", [360, 800])
def test_only_wide_tables_scroll_sideways(page, width):
    page.show(width=width, height=740)
    assert page.run("[document.documentElement.scrollWidth, innerWidth]") == [width, width]
    inside = "[...document.querySelectorAll('.scroll')].map(box => box.scrollWidth > box.clientWidth)"
    assert page.run(inside)[:2] == [False, True]
    if width == 360:
        page.click("figure img")
        assert page.run("document.querySelector('dialog').scrollWidth") == 2.5 * width


CONTRASTS = """(() => {
    const parse = text => (text.match(/[\\d.]+/g) ?? []).map(Number);
    const linear = v => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
    const light = ([r, g, b]) => 0.2126 * linear(r / 255) + 0.7152 * linear(g / 255) + 0.0722 * linear(b / 255);
    const ground = element => {
        const colour = parse(getComputedStyle(element).backgroundColor);
        return colour[3] === 0 ? (element.parentElement ? ground(element.parentElement) : [255, 255, 255]) : colour;
    };
    const found = {};
    for (const element of document.querySelectorAll("body *")) {
        if (![...element.childNodes].some(node => node.nodeType === 3 && node.data.trim())) continue;
        if (element.localName === "script") continue;
        const pair = [light(parse(getComputedStyle(element).color)), light(ground(element))].sort((a, b) => b - a);
        found[element.localName] = Math.min(found[element.localName] ?? 21, (pair[0] + 0.05) / (pair[1] + 0.05));
    }
    return {found, paper: light(ground(document.body)), card: ground(document.querySelector("figure img"))};
})()"""


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_texts_stand_out_and_figures_stay_on_white(page, scheme):
    page.show(scheme=scheme)
    measured = page.run(CONTRASTS)
    assert {"h1", "p", "a", "td", "th", "code", "button", "figcaption", "strong", "li"} <= set(measured["found"])
    assert min(measured["found"].values()) >= 4.5, measured["found"]
    assert (measured["paper"] < 0.05) == (scheme == "dark")
    assert measured["card"] == [255, 255, 255]


@pytest.mark.parametrize(
    ("width", "scheme", "name"),
    [(1280, "light", "light"), (1280, "dark", "dark"), (360, "light", "narrow"), (360, "dark", "narrow_dark")],
)
def test_a_picture_is_that_of_the_screen(page, width, scheme, name):
    page.show(width=width, scheme=scheme)
    page.open(page.path)
    image = "document.querySelector('picture img')"
    address = b64encode((page.path.parent / f"{name}.png").read_bytes()).decode()
    assert page.run(f"{image}.currentSrc") == f"data:image/png;base64,{address}"
    ground = page.run(f"getComputedStyle({image}).backgroundColor")
    assert ground == ("rgb(20, 20, 20)" if scheme == "dark" else "rgb(255, 255, 255)")
    page.run(f"{image}.click()")
    assert page.run("document.querySelector('dialog img').src").endswith(address)
    assert page.run("getComputedStyle(document.querySelector('dialog')).backgroundColor") == ground


def test_names_in_tables_are_not_broken(page):
    page.show(width=360)
    lines = """[...document.querySelectorAll('tbody th, tbody td')]
        .filter(cell => /^(participant-with-a-name.1|autonomous)$/.test(cell.textContent))
        .map(cell => { const range = document.createRange(); range.selectNodeContents(cell);
            return new Set([...range.getClientRects()].map(box => Math.round(box.top))).size; })"""
    assert page.run(lines) == [1] * 4


def test_no_figure_leaves_half_of_a_sheet_empty(page):
    page.call("Emulation.setEmulatedMedia", media="print")
    boxes = "[...document.querySelectorAll('figure img')].map(one => one.getBoundingClientRect())"
    sizes = page.run(f"{boxes}.map(box => [box.width, box.height])")
    page.call("Emulation.setEmulatedMedia", media="")
    assert max(height for _, height in sizes) <= 95 / 25.4 * 96 + 1  # mm
    assert pytest.approx(sizes[0], abs=1) == [1400 / 300 * 96, 800 / 300 * 96], "as wide as on paper"


def test_it_prints_on_a4(page):
    printed = b64decode(page.call("Page.printToPDF", preferCSSPageSize=True)["data"])
    assert printed.startswith(b"%PDF")
    sheets = re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", printed)
    assert len(sheets) >= 3
    assert {(round(float(width)), round(float(height))) for width, height in sheets} == {(595, 842)}
