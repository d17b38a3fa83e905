"""The report is one page that needs nothing else."""

import base64
import json
import re
import shutil
import subprocess
from html.parser import HTMLParser

import pytest

from bt_tasksim.core.errors import InputError
from bt_tasksim.report.report import NO_VIDEO, report_page, write_report


class Page(HTMLParser):
    """Collects scripts by id, and all attributes."""

    def __init__(self, text):
        super().__init__()
        self.scripts, self.attributes, self._in, self.ids = {}, [], None, []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        self.attributes += attrs.items()
        self.ids += [attrs["id"]] if "id" in attrs else []
        if tag == "script":
            self._in = attrs.get("id", "code")
            self.scripts[self._in] = ""

    def handle_endtag(self, tag):
        if tag == "script":
            self._in = None

    def handle_data(self, data):
        if self._in is not None:
            self.scripts[self._in] += data


def test_the_page_holds_everything(run, recorded):
    film = bytes(range(256)) * 10
    text = report_page(run, recorded.runner.tree, film)
    page = Page(text)
    data = json.loads(page.scripts["data"])
    assert data["about"]["why"] == recorded.result.why
    assert base64.b64decode(page.scripts["video"]) == film
    assert "%%" not in text
    assert {f"node-{k}" for k in range(6)} <= set(page.ids)
    assert len(page.ids) == len(set(page.ids))


def test_nothing_comes_from_elsewhere(run, recorded):
    text = report_page(run, recorded.runner.tree)
    elsewhere = set(re.findall(r"(?:https?:)?//[\w.]+\.\w+[^\s\"'<]*", text)) - {"http://www.w3.org/2000/svg"}
    assert not elsewhere
    assert not [a for a in Page(text).attributes if a[0] in ("src", "href", "srcset", "data")]
    assert "@import" not in text and "url(" not in text


def test_every_id_that_the_script_asks_for_exists(run, recorded):
    page = Page(report_page(run, recorded.runner.tree))
    asked = set(re.findall(r'byId\("([\w-]+)"\)', page.scripts["code"]))
    assert asked and asked <= set(page.ids)


def test_names_cannot_break_out(renamed, recorded):
    evil = '</script><script>alert(1)</script><img src=x onerror="alert(2)">'
    page = Page(report_page(renamed(evil, evil), recorded.runner.tree, None, evil))
    data = json.loads(page.scripts["data"])
    assert data["nodes"][0]["name"] == evil and data["noVideo"] == evil
    assert data["messages"][0][2] == evil
    assert sorted(page.scripts) == ["code", "data", "video"]
    assert ("src", "x") not in page.attributes


def test_without_a_video_it_says_so(run, recorded):
    page = Page(report_page(run, recorded.runner.tree))
    assert page.scripts["video"].strip() == ""
    assert json.loads(page.scripts["data"])["noVideo"] == NO_VIDEO


def test_small(run, recorded, tmp_path):
    write_report(tmp_path / "report.html", run, recorded.runner.tree)
    assert (tmp_path / "report.html").stat().st_size < 200_000


def test_missing_video(run, recorded, tmp_path):
    with pytest.raises(InputError, match="there is no video"):
        write_report(tmp_path / "report.html", run, recorded.runner.tree, tmp_path / "no.mp4")
    assert list(tmp_path.iterdir()) == []


MEASURE = """<script>{
const list = document.getElementById("messages");
for (let k = 0; k < 80; k++) list.append(Object.assign(document.createElement("li"), {textContent: "said"}));
const film = document.getElementById("film");
film.innerHTML = '<div style="height: 300px"></div>';
document.title = "film " + film.clientHeight + " of " + film.scrollHeight;
}</script>"""


@pytest.mark.skipif(shutil.which("chromium") is None, reason="a layout needs a browser")
def test_many_messages_leave_the_film_its_size(run, recorded, tmp_path):
    """The list of messages scrolls; the film above it is not cut."""
    page = tmp_path / "report.html"
    text = report_page(run, recorded.runner.tree)
    page.write_text(text.replace("</body>", MEASURE + "</body>"), encoding="utf-8")
    flags = ["--headless", "--no-sandbox", "--disable-gpu", "--window-size=1366,768", "--dump-dom"]
    done = subprocess.run(
        ["chromium", *flags, f"--user-data-dir={tmp_path}", page.as_uri()],
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    found = re.search(r"<title>film (\d+) of (\d+)<", done.stdout)
    assert found is not None and found[1] == found[2] and int(found[2]) >= 300


def test_the_film_does_not_shrink(run, recorded):
    """The same without a browser: the rule by which the film keeps its size."""
    text = report_page(run, recorded.runner.tree)
    assert re.search(r"#film[^{}]*\{[^}]*flex: none", text)
