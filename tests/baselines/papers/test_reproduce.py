"""Reproductions: every figure of every paper is drawn, every claim tested, and the ledger in the tree is up to date."""

from __future__ import annotations

import dataclasses
import json
import pathlib
import re
import struct

import pytest

from baselines.papers import PAPERS
from baselines.papers.ledger import ledger
from baselines.papers.paper import Finding
from baselines.papers.runs import Runs
from baselines.reproduce import main, reproduce

#: The figures that can be drawn again, by their numbers in the papers.
FIGURES = {
    "varga": list(range(2, 15)),
    "faitli": list(range(2, 7)),
    "khan": list(range(3, 20)),
    "zhang": [2, 3, 4, 6, 7, 8, 9],
}
#: One figure for each function that draws and each episode; the others are in the slow run.
OF_EACH_KIND = {"varga": [2, 5, 6, 8, 9, 11], "khan": [3, 7, 8, 11, 14, 18, 19]}
VERDICTS = ("reproduced", "contradicted", "depends", "not testable")
STEPS = 60
TREE = pathlib.Path(__file__).parents[3] / "docs" / "papers.md"
REMEDY = "write it with `python -m baselines.reproduce --ledger docs/papers.md`"

papers = pytest.mark.parametrize("name", PAPERS)


def strict(text):
    """JSON as the standard has it, without NaN and infinity."""

    def refuse(constant):
        raise AssertionError(f"{constant} is no JSON")

    return json.loads(text, parse_constant=refuse)


def one_line(text):
    return bool(text.strip()) and text == text.strip() and "\n" not in text


def test_all_papers_and_figures_are_there():
    assert {name: [f.number for f in paper.figures] for name, paper in PAPERS.items()} == FIGURES


@papers
def test_texts_fit_the_ledger(name):
    paper = PAPERS[name]
    assert paper.name == name
    assert len({claim.name for claim in paper.claims}) == len(paper.claims)
    assert len({claim.text for claim in paper.claims}) == len(paper.claims)
    for text in (paper.title, *paper.readings, *(f.title for f in paper.figures)):
        assert one_line(text)
    for claim in paper.claims:
        for text in (claim.name, claim.text, claim.where, claim.how):
            assert one_line(text)
            assert "|" not in text


@pytest.mark.parametrize(
    ("name", "numbers"),
    [(name, OF_EACH_KIND.get(name, FIGURES[name])) for name in PAPERS]
    + [
        pytest.param(name, [number for number in FIGURES[name] if number not in kinds], marks=pytest.mark.slow)
        for name, kinds in OF_EACH_KIND.items()
    ],
)
def test_a_short_run_draws_and_tests_everything(name, numbers, tmp_path, monkeypatch):
    paper = dataclasses.replace(PAPERS[name], figures=tuple(f for f in PAPERS[name].figures if f.number in numbers))
    monkeypatch.setitem(PAPERS, name, paper)
    found = reproduce([name], steps=STEPS, out=tmp_path)[name]
    assert list(found) == [claim.name for claim in paper.claims]
    for finding in found.values():
        assert finding.verdict in VERDICTS
        assert one_line(finding.evidence)
    files = sorted(p.name for p in (tmp_path / name).iterdir())
    assert files == sorted([*(f"figure-{f.number:02d}.png" for f in paper.figures), "numbers.json"])
    for figure in paper.figures:
        content = (tmp_path / name / f"figure-{figure.number:02d}.png").read_bytes()
        assert content.startswith(b"\x89PNG\r\n\x1a\n")
        width, height = struct.unpack(">II", content[16:24])
        assert 1000 <= width <= 2000
        assert 300 <= height <= 3000
        assert len(content) > 8000, f"figure {figure.number} seems to be empty"
    written = strict((tmp_path / name / "numbers.json").read_text())
    assert list(written["figures"]) == [f"figure {number}" for number in numbers]
    assert all(len(values) > 1 for values in written["figures"].values())
    assert {claim: values["verdict"] for claim, values in written["claims"].items()} == {
        claim: finding.verdict for claim, finding in found.items()
    }
    assert (tmp_path / "papers.md").read_text() == ledger([paper], {name: found})


class TestCommandLine:
    def run(self, capsys, *arguments):
        code = main(list(map(str, arguments)))
        return code, *capsys.readouterr()

    def test_figures_alone(self, capsys, tmp_path):
        code, out, err = self.run(
            capsys, "--paper", "zhang", "--figure", 9, 3, "--steps", STEPS, "--out", tmp_path / "new"
        )
        assert code == 0
        files = sorted(p.relative_to(tmp_path / "new").as_posix() for p in (tmp_path / "new").rglob("*.*"))
        assert files == ["zhang/figure-03.png", "zhang/figure-09.png", "zhang/numbers.json"]
        numbers = strict((tmp_path / "new" / "zhang" / "numbers.json").read_text())
        assert set(numbers["figures"]) == {"figure 3", "figure 9"}
        assert numbers["claims"] == {}
        assert "figure-09.png: Iteration count" in err
        assert str(tmp_path / "new") in out

    def test_a_paper_prints_its_findings(self, capsys, tmp_path, monkeypatch):
        """All of its figures are drawn above."""
        zhang = PAPERS["zhang"]
        monkeypatch.setitem(PAPERS, "zhang", dataclasses.replace(zhang, figures=zhang.figures[:1]))
        code, out, _ = self.run(capsys, "--paper", "zhang", "--steps", STEPS, "--out", tmp_path)
        assert code == 0
        for claim in PAPERS["zhang"].claims:
            assert re.search(rf"^zhang +({'|'.join(VERDICTS)}) +{re.escape(claim.name)}: ", out, re.MULTILINE)

    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            (["--paper", "zang"], r"no paper 'zang'.*Did you mean 'zhang'"),
            (["--paper", "zhang", "--figure", 5], r"paper 'zhang' has no figure 5 to be drawn again; it has \[2, 3, 4"),
            (["--paper", "varga", "zhang", "--figure", 2, 14], r"paper 'zhang' has no figure 14"),
            (["--steps", 0], r"steps: expected a whole number of at least 1, got 0"),
            (["--paper", "zhang", "--ledger", "papers.md"], r"ledger: needs all papers"),
            (["--ledger", "papers.md", "--figure", 2], r"ledger: needs all papers, all figures"),
            (["--ledger", "papers.md", "--steps", STEPS], r"ledger: needs all papers.* whole episodes"),
        ],
    )
    def test_what_cannot_be_is_one_line_and_2(self, capsys, tmp_path, monkeypatch, arguments, message):
        monkeypatch.chdir(tmp_path)
        code, out, err = self.run(capsys, *arguments, "--out", "out")
        assert code == 2
        assert out == ""
        assert err.count("\n") == 1
        assert err.startswith("error: ")
        assert re.search(message, err)
        assert list(tmp_path.iterdir()) == []

    def test_a_folder_that_cannot_be_is_said(self, capsys, tmp_path):
        (tmp_path / "file").write_text("")
        code, _, err = self.run(
            capsys, "--paper", "zhang", "--figure", 9, "--steps", STEPS, "--out", tmp_path / "file" / "in"
        )
        assert code == 2
        assert err.splitlines()[-1].startswith("error: ")


def cells(line):
    """The cells of a row of a Markdown table."""
    return [cell.strip().replace("\\|", "|") for cell in re.split(r"(?<!\\)\|", line)[1:-1]]


def read(text):
    """The findings that a ledger tells of, by paper and claim."""
    sections = {part.split("\n", 1)[0]: part for part in re.split(r"^## ", text, flags=re.MULTILINE)[1:]}
    findings = {}
    for paper in PAPERS.values():
        assert paper.title in sections, f"docs/papers.md has no section {paper.title!r}: {REMEDY}"
        # The rule below the head has no blank behind its first bar.
        head, *rows = [cells(line) for line in sections[paper.title].split("\n") if line.startswith("| ")] or [[]]
        rows = [dict(zip(head, row, strict=True)) for row in rows]
        findings[paper.name] = of = {}
        texts = {claim.text: claim.name for claim in paper.claims}
        for row in rows:
            assert row["claim"] in texts, (
                f"docs/papers.md has a row {row['claim']!r} that no claim stands behind: {REMEDY}"
            )
            verdict = row["verdict"].strip("*")
            assert verdict in VERDICTS
            of[texts[row["claim"]]] = Finding(verdict, row["what came out"], {})
        missing = [claim.name for claim in paper.claims if claim.name not in of]
        assert not missing, f"docs/papers.md lacks the claims {missing} of {paper.name}: {REMEDY}"
    return findings


def in_the_tree():
    assert TREE.is_file(), f"docs/papers.md is missing: {REMEDY}"
    return TREE.read_text(encoding="utf-8")


def test_the_ledger_is_of_these_claims():
    """All but verdicts and evidence is compared here, which needs no run: order, words, counts, readings, layout."""
    text = in_the_tree()
    assert ledger(list(PAPERS.values()), read(text)) == text, f"docs/papers.md is out of date: {REMEDY}"


NUMBER = re.compile(r"(?<![\w.])[-−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def numbers_in(evidence):
    return [float(n.replace("−", "-")) for n in NUMBER.findall(evidence)]


def is_time(evidence):
    """Whether a clock has measured it, rather than the simulation counted it."""
    return re.search(r"\bµs\b|\bmedian times?\b|\btimes \(median\)", evidence) is not None


def differs(now, then):
    """Why two pieces of evidence say different things: numbers by more than 5 %, or other numbers; None if not.

    What is below 1e-9 is rounding, which is another on every machine.
    """
    a, b = numbers_in(now), numbers_in(then)
    if len(a) != len(b):
        return f"{len(a)} numbers instead of {len(b)}"
    for x, y in zip(a, b, strict=True):
        if abs(x - y) > 0.05 * max(abs(x), abs(y)) and max(abs(x), abs(y)) > 1e-9:
            return f"{x:g} instead of {y:g}"
    return None


#: Claims whose episodes have many times the steps of all others together, variants of methods side by side. They are
#: tested where the ledger is written; a change of a method shows in the other rows, and in the tests of its variants.
LONG = {
    "varga": {"printed step", "limit reached"},
    "khan": {
        *("compensates position", "compensates orientation"),
        *("compensates manufacturing", "needs precise measurement"),
        *("counter-rotation", "12 dimensions", "Dineva's iteration", "J_Prev_a"),
        *("no exploration", "less hectic", "sign works for two joints", "sign variant"),
    },
}
#: Claims that measure time, which has to have the machine for itself: they are tested where the ledger is written, too.
TIMED = {
    "varga": {"offline only", "time proportional", "multipliers cost more"},
    "zhang": {"18 × 18", "n = 2, λ = 0"},
}


@pytest.mark.parametrize("left_out", [LONG, TIMED], ids=["long", "timed"])
def test_claims_that_are_left_out_are_there(left_out):
    for name, claims in left_out.items():
        assert {claim.name for claim in PAPERS[name].claims} > claims


def test_claims_that_measure_time_are_named():
    for name, claims in read(in_the_tree()).items():
        assert {claim for claim, finding in claims.items() if is_time(finding.evidence)} == TIMED.get(name, set())


@pytest.mark.slow
@papers
def test_the_ledger_is_up_to_date(name):
    """Whole episodes."""
    written, runs, wrong = read(in_the_tree())[name], Runs(), []
    for claim in PAPERS[name].claims:
        if claim.name in LONG.get(name, ()) or claim.name in TIMED.get(name, ()):
            continue
        finding, then = claim.test(runs), written[claim.name]
        if finding.verdict != then.verdict:
            wrong.append(f"{claim.name}: {finding.verdict} instead of {then.verdict}: {finding.evidence}")
        elif why := differs(finding.evidence, then.evidence):
            wrong.append(f"{claim.name}: {why}: {finding.evidence}")
    assert not wrong, f"docs/papers.md is out of date: {REMEDY}\n" + "\n".join(wrong)


class TestTheTestsThemselves:
    """A ledger that is out of date has to be found out."""

    @pytest.fixture
    def text(self):
        findings = {
            paper.name: {
                claim.name: Finding(VERDICTS[i % len(VERDICTS)], f"{i} | {i}.5e-3 m", {})
                for i, claim in enumerate(paper.claims)
            }
            for paper in PAPERS.values()
        }
        return ledger(list(PAPERS.values()), findings)

    def test_a_ledger_is_read_as_it_was_written(self, text):
        findings = read(text)
        assert ledger(list(PAPERS.values()), findings) == text
        assert next(iter(findings["varga"].values())).evidence == "0 | 0.5e-3 m"

    def test_another_claim(self, text):
        claim = PAPERS["varga"].claims[1].text
        with pytest.raises(AssertionError, match="no claim stands behind"):
            read(text.replace(claim, "Pigs fly."))

    def test_a_claim_less(self, text):
        lines = text.split("\n")
        del lines[next(i for i, line in enumerate(lines) if PAPERS["zhang"].claims[-1].text in line)]
        with pytest.raises(AssertionError, match="lacks the claims"):
            read("\n".join(lines))

    @pytest.mark.parametrize("what", ["where", "how"])
    def test_other_words(self, text, what):
        changed = text.replace(getattr(PAPERS["zhang"].claims[3], what), "elsewhere", 1)
        assert ledger(list(PAPERS.values()), read(changed)) != changed

    @pytest.mark.parametrize(
        ("now", "then", "same"),
        [
            ("error 1.02 m", "error 1.00 m", True),
            ("error 1.2 m", "error 1.0 m", False),
            ("3e-11 m, 2 rad", "1e-10 m, 2 rad", True),
            ("3e-9 m", "1e-9 m", False),
            ("−2.0 m", "2.0 m", False),
            ("1 m and 2 m", "1 m", False),
            ("no number", "no number", True),
        ],
    )
    def test_numbers(self, now, then, same):
        assert (differs(now, then) is None) == same

    def test_times(self):
        assert is_time("12 µs")
        assert is_time("1.3 times the median time")
        assert not is_time("12 µm, 3 mm, 4 terms, beyond 90° for half of the time, from 12 ms on")
