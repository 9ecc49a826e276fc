"""What keeps a release from being made before anything is built."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from fmu_src.platforms import release


def tag(monkeypatch: pytest.MonkeyPatch, version: str) -> None:
    monkeypatch.setattr("setuptools_scm.get_version", lambda *_, **__: version)


def test_the_version_without_a_tag_is_no_release(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    tag(monkeypatch, "0.1.0.post1.dev7+gabc")
    assert release.judged_version() == "0.1.0.post1.dev7+gabc"
    assert "no release" in capsys.readouterr().err


def test_a_tag_that_the_files_do_not_know_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    tag(monkeypatch, "9.9.9")
    with pytest.raises(release.ReleaseError, match=r"9\.9\.9, but pyproject\.toml has no line"):
        release.judged_version()


def test_a_tag_that_the_files_know_is_a_release(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(release, "ROOT", tmp_path)
    (tmp_path / "pyproject.toml").write_text('[tool.setuptools_scm]\nfallback_version = "9.9.9"\n')
    (tmp_path / "CITATION.cff").write_text("title: x\nversion: 9.9.9\n")
    (tmp_path / "CHANGELOG.md").write_text("# Changelog\n\n## 9.9.9\n")
    tag(monkeypatch, "9.9.9")
    assert release.judged_version() == "9.9.9"
    assert not capsys.readouterr().err


def test_a_package_index_gets_a_readme_whose_links_lead_somewhere() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "hatch_fancy_pypi_readme"],
        cwd=release.ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.startswith("# mixed-order-game\n")
    assert "## Cite and licence" in done.stdout
    assert [link for link in re.findall(r"\]\(([^)]*)\)", done.stdout) if not link.startswith("https:")] == []
