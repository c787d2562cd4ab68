"""The report: a page that stands alone, with our numbers and those of others."""

import base64
import re
from dataclasses import replace
from html.parser import HTMLParser
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from semgp.classes import Classes
from semgp.conventions import NYU13, SEMANTIC_KITTI
from semgp.errors import InputError
from semgp.evaluation.figures import Figure, picture_figure
from semgp.evaluation.published import KITTI_QUERIES, NYU_FRAMES, PAPER, REFERENCES
from semgp.evaluation.report import write_report
from semgp.evaluation.tables import class_table, score_table
from semgp.evaluation.task import Result
from tests.results import patches_task, results_of

VOID = {"meta", "img"}


class Page(HTMLParser):
    """Cells of each table row, tags, and whatever is loaded; fails on tags that do not match."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.rows: list[list[str]] = []
        self.tags: set[str] = set()
        self.links: list[str] = []
        self._open: list[str] = []
        self.feed(text)
        assert not self._open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.links += [value or "" for name, value in attrs if name in ("src", "href", "srcset", "data")]
        if tag not in VOID:
            self._open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.rows and self._open and {"td", "th"} & set(self._open):
            self.rows[-1][-1] += data

    def row(self, start: str) -> list[str]:
        """Return the one row whose first cell is this."""
        (row,) = [row for row in self.rows if row and row[0] == start]
        return row


@pytest.fixture(scope="module")
def results() -> list[Result]:
    return results_of(*(patches_task(frame, seed=int(frame)) for frame in ("282", "374")))


@pytest.fixture(scope="module")
def figure() -> Figure:
    return picture_figure("a-figure", "Dots & <dashes>", np.full((4, 5, 3), 200, np.uint8))


def page(folder: Path, results: list[Result], *figures: Figure, **options: Any) -> Page:
    chosen: dict[str, Any] = {"title": "A title", "settings": {"classes": 13}, "seed": 7} | options
    return Page(write_report(folder, results, figures, **chosen).read_text(encoding="utf-8"))


def test_page_stands_alone(tmp_path: Path, results: list[Result], figure: Figure) -> None:
    made = page(tmp_path, results, figure, classes=NYU13)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "script" not in made.tags
    assert "link" not in made.tags
    assert not re.search(r"https?://|url\(|@import", text)
    assert [link.partition(",")[0] for link in made.links] == ["data:image/png;base64"]
    assert base64.b64decode(made.links[0].partition(",")[2]) == figure.png
    assert (tmp_path / "a-figure.png").read_bytes() == figure.png
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a-figure.png", "report.html"]


def test_page_says_how_it_was_made(tmp_path: Path, results: list[Result], figure: Figure) -> None:
    page(tmp_path, results, figure, title="<b>&", command="semgp 'a b' <c>", settings={"frames": "<282>"})
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<h1>&lt;b&gt;&amp;</h1>" in text
    assert "<dt>command</dt><dd>semgp &#x27;a b&#x27; &lt;c&gt;</dd>" in text
    assert "<dt>frames</dt><dd>&lt;282&gt;</dd>" in text
    assert "<dt>seed</dt><dd>7</dd>" in text
    assert f"<dt>numpy</dt><dd>{np.__version__}</dd>" in text
    assert f"<dt>semgp</dt><dd>{version('semgp')}</dd>" in text
    assert "Dots &amp; &lt;dashes&gt;" in text


def test_table_holds_scenes_means_and_others(results: list[Result]) -> None:
    made = Page(score_table(results))
    assert made.rows[0][:4] == ["method", "AUC 282", "AUC 374", "mean AUC"]
    octomap = [result for result in results if result.method == "octomap"]
    auc = [result.scores.auc_total for result in octomap]
    nll = np.mean([result.scores.nll for result in octomap])
    assert made.row("Semantic OctoMap")[1:4] == [f"{v:.4f}" for v in (*auc, np.mean(auc))]
    assert made.row("Semantic OctoMap")[made.rows[0].index("NLL")] == f"{nll:.4f}"
    assert made.row("Semantic OctoMap, published")[1:4] == ["0.8852", "0.8625", "0.8739"]
    at = [row[0] for row in made.rows]
    assert at.index("Semantic OctoMap, published") == at.index("Semantic OctoMap") + 1
    assert at.index("GPSM, published") > at.index("k-NN")  # it has no method to stand below
    assert {len(row) for row in made.rows} == {len(made.rows[0])}


def test_best_of_a_column_is_bold(results: list[Result]) -> None:
    text = score_table(results)
    best = {
        name: [np.mean([getattr(r.scores, name) for r in results if r.method == m]) for m in ("octomap", "knn")]
        for name in ("auc_total", "nll")
    }
    assert f"<b>{max(best['auc_total']):.4f}</b>" in text
    assert f"<b>{min(best['nll']):.4f}</b>" in text
    assert f"<b>{max(best['nll']):.4f}</b>" not in text
    assert "<b>" not in score_table([results[0]])


def test_one_scene_has_no_columns_of_scenes(results: list[Result]) -> None:
    assert Page(score_table(results[:2])).rows[0][:3] == ["method", "AUC", "accuracy"]


def test_scores_that_do_not_exist(results: list[Result]) -> None:
    scores = replace(results[0].scores, auc_total=float("nan"))
    made = Page(score_table([replace(results[0], scores=scores)]))
    assert made.row("Semantic OctoMap")[1] == "–"


def test_class_table_names_the_classes_present(results: list[Result]) -> None:
    made = Page(class_table(results, NYU13))
    assert made.rows[0] == ["method", "bed", "books", "ceiling", "chair"]
    iou = np.mean([result.scores.iou[:4] for result in results if result.method == "knn"], axis=0)
    assert made.row("k-NN")[1:] == [f"{v:.4f}" for v in iou]


@pytest.mark.parametrize(
    ("frame", "experiment", "classes"),
    [
        ("283", "sparse", NYU13),
        ("282", "another", NYU13),
        ("282", "sparse", Classes.numbered(40)),
        ("08", "keep-1", SEMANTIC_KITTI),
    ],
)
def test_numbers_of_others_stay_with_their_scenes(frame: str, experiment: str, classes: Classes) -> None:
    (result,) = results_of(patches_task(frame, experiment, classes), methods=["knn"])
    assert not any(reference.goes_with(result) for reference in REFERENCES)


def test_numbers_of_others_on_kitti() -> None:
    (result,) = results_of(patches_task("08", "keep-1", SEMANTIC_KITTI), methods=["knn"])
    same = replace(result, scores=replace(result.scores, n_points=KITTI_QUERIES))
    rows = [reference for reference in REFERENCES if reference.goes_with(same)]
    assert {(r.method, r.scores["miou"]) for r in rows} >= {("csm", 0.3963), ("bki", 0.4026), ("knn", 0.4044)}


def test_the_papers_numbers_are_there() -> None:
    paper = {(r.experiment, r.method): list(r.auc.values()) for r in REFERENCES if r.source == PAPER}
    assert paper == {
        ("sparse", "gpsm"): [0.9624, 0.9622, 0.9675, 0.9644],
        ("sparse", "octomap"): [0.88525, 0.86251, 0.88648, 0.83569],
        ("noisy", "gpsm"): [0.7192, 0.7625, 0.7032, 0.8612],
        ("noisy", "octomap"): [0.68402, 0.73552, 0.66881, 0.77456],
    }
    assert all(tuple(r.auc) == NYU_FRAMES for r in REFERENCES if r.source == PAPER)
    assert len({(r.experiment, r.method, r.label) for r in REFERENCES}) == len(REFERENCES)


def test_what_a_report_refuses(tmp_path: Path, results: list[Result], figure: Figure) -> None:
    with pytest.raises(InputError, match="needs results"):
        page(tmp_path, [])
    with pytest.raises(InputError, match="share a name"):
        page(tmp_path, results, figure, figure)
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot make the folder"):
        page(tmp_path / "file", results)
    assert not list(tmp_path.glob("*.html"))


def test_page_is_whole_or_the_old_one(tmp_path: Path, results: list[Result], monkeypatch: Any) -> None:
    page(tmp_path, results, title="the first")

    def fail(*_: object, **__: object) -> int:
        raise OSError("no space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_text", fail)
        with pytest.raises(OSError, match="no space"):
            page(tmp_path, results, title="the second")
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]
    assert "the first" in (tmp_path / "report.html").read_text(encoding="utf-8")
