"""The page of a study, while it runs and at its end."""

import re

import pytest
from study_examples import failing_study, small, wait_for

from motorgrad.studies import Study, _driver, _partition


def text_of(page):
    """The words of a page, without its markup, style and pictures."""
    content = page.read_text(encoding="utf-8")
    return " ".join(re.sub(r"<style>.*?</style>|<[^>]*>", " ", content, flags=re.DOTALL).split())


@pytest.mark.ci
def test_the_page_shows_a_study_that_runs(tmp_path, monkeypatch):
    monkeypatch.setattr(_driver, "PAUSE", 0.01)
    monkeypatch.setattr(_driver, "SHARE", 1.0)
    train, seen, page = _partition.train, [], tmp_path / "study" / "index.html"

    def train_when_the_page_is_there(*arguments, **options):
        if seen:  # the first job is done
            wait_for(lambda: page.exists() and f"{len(seen)} done" in text_of(page))
        seen.append((text_of(page), page.read_text()) if seen else ("", ""))
        return train(*arguments, **options)

    monkeypatch.setattr(_partition, "train", train_when_the_page_is_there)
    small().run(tmp_path / "study", progress=False)
    words, content = seen[-1]
    assert "study running" in words
    assert "8 settings × 2 seeds × 400 decisions, in 4 jobs" in words
    assert "3 done" in words
    assert "1 waiting" in words
    assert "http-equiv" in content  # it comes again by itself
    assert "data:image/svg+xml" in content
    assert "http-equiv" not in page.read_text()
    assert "study done" in text_of(page)


@pytest.mark.ci
def test_the_page_ranks_settings_for_each_task(tmp_path):
    study = Study(
        task=["three-state", "chain"], agent={"learning_rate": [0.001, 0.2]}, steps=400, seeds=4, window=100, lanes=100
    )
    results = study.run(tmp_path / "study", progress=False)
    words = text_of(results.path / "index.html")
    for task in results.tasks:
        best = results.best(where=task)
        assert len(best) == 2
        assert best[0].value.words() in words
    assert re.search("three-state learning_rate mean .* chain learning_rate mean", words)
    assert "other seeds chose the settings" in words
    assert (results.path / "curves.svg").exists()


def test_the_page_has_failures_with_their_messages(tmp_path):
    results = failing_study(tmp_path / "study")
    words = text_of(results.path / "index.html")
    assert "1 done · 1 set aside" in words
    (failure,) = results.failures
    assert f"after 2 attempts: {failure['message']}" in words
    assert "Traceback (most recent call last)" in words


def test_what_a_message_says_is_text_on_the_page(tmp_path, monkeypatch):
    def fail(*arguments, **options):
        raise RuntimeError("<script>alert(1)</script>")

    monkeypatch.setattr(_partition, "train", fail)
    results = small().run(tmp_path / "study", progress=False, attempts=1)
    content = (results.path / "index.html").read_text()
    assert "<script>" not in content
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in content
