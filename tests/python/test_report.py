"""The report: one page that needs no network, looked at in a headless Chromium."""

import base64
import json
import re
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from mixed_order_game import GameError, ResultError, Verdict, build_fmu, read_model, run
from mixed_order_game.cli.app import app
from mixed_order_game.game.new import Recipe, new_game
from mixed_order_game.game.parameters import game_parameters
from mixed_order_game.reporting.evidence import (
    Evidence,
    energy_so_far,
    evidence_of_game,
    evidence_of_result,
    shared_signal,
    sphere_switches,
)
from mixed_order_game.reporting.figures import MOST_PLAYERS, figures
from mixed_order_game.reporting.page import render_page, report
from mixed_order_game.results.unknown_term import unknown_term
from tests.chromium import chromium, needs_chromium, wait_for

EVERY_FIGURE = [
    "actions",
    "velocities",
    "plane",
    "error",
    "estimates",
    "consensus",
    "network",
    "weights",
    "control",
]


def mog(*arguments: object) -> Result:
    return CliRunner(env={"COLUMNS": "200", "NO_COLOR": "1"}).invoke(app, [str(each) for each in arguments])


@pytest.fixture(scope="module")
def evidence(fmu: Path) -> Evidence:
    return evidence_of_game(fmu)


@pytest.fixture(scope="module")
def page(evidence: Evidence, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(render_page(evidence), encoding="utf-8")
    return path


class Elements(HTMLParser):
    """Every element with its attributes, and the text outside of scripts."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self._inside = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        self.text += " "
        self._inside = tag

    def handle_data(self, data: str) -> None:
        if self._inside not in ("script", "style"):
            self.text += data


def test_every_figure_of_the_paper_example(evidence: Evidence) -> None:
    assert [figure.name for figure in figures(evidence)] == EVERY_FIGURE
    assert evidence.passed
    assert evidence.abscissa == pytest.approx(-6.031, abs=0.001)


def test_figures_are_what_plotly_takes(evidence: Evidence) -> None:
    from plotly.graph_objects import Figure

    for figure in figures(evidence):
        drawn = Figure(data=figure.data, layout=figure.layout, frames=figure.frames)  # validates every name
        assert len(drawn.data) >= 2


def values(packed: dict[str, str]) -> np.ndarray:
    return np.frombuffer(base64.b64decode(packed["bdata"]), dtype="<f4")


def test_curves_are_whole_and_the_tolerance_is_shaded(evidence: Evidence) -> None:
    drawn = {figure.name: figure for figure in figures(evidence)}
    for name, copies in (("error", 1), ("consensus", 5)):
        curves = {trace["name"]: values(trace["y"]) for trace in drawn[name].data}
        assert all(np.isfinite(curve).all() for curve in curves.values())
        assert len(curves["neither perturbed nor robust"]) == len(curves["this run"])
        floor = np.sqrt(copies * 10.0) * 1e-10 * (0.5 + 0.01)
        assert curves["within the tolerance of integration"] == pytest.approx(floor)
        assert "relative tolerance of 1e-10" in drawn[name].caption


def test_the_equilibrium_is_drawn_as_it_was_at_each_time(fmu: Path) -> None:
    changes = {0.5: {"cost_linear[1,1]": -6.0}}
    result = run(fmu, stop_time=1.0, step=0.1, outputs=["x", "nash_error"], changes=changes)
    drawn = {figure.name: figure for figure in figures(evidence_of_result(result))}
    (level,) = (trace for trace in drawn["actions"].data if trace["name"] == "x*[1,1]")
    assert level["line"]["shape"] == "vh"
    assert values(level["x"]) == pytest.approx([0.0, 0.5, 0.6, 1.0])
    np.testing.assert_allclose(values(level["y"]), result["x_star[1,1]"][[0, 5, 6, 10]], rtol=1e-6)
    assert values(level["y"])[1] != values(level["y"])[2]
    crosses = {
        trace["name"]: values(trace["x"]) for trace in drawn["plane"].data if trace["mode"] == "markers"
    }
    assert crosses["equilibrium before"] == pytest.approx([-0.5])


def test_unknown_term_is_what_drives_the_plant(fmu: Path) -> None:
    """Order 1: x' = u + g + d; order 2: v' = u + g + d; by central differences of a fine run."""
    result = run(fmu, stop_time=6.0, step=0.002, tolerance=1e-9, outputs=["x", "v", "u"])
    unknown = unknown_term(game_parameters(read_model(fmu)), result)
    moved = np.where(np.isnan(result.v), result.x, result.v)
    rate = np.gradient(moved, result.time, axis=0)
    late = result.time > 2.0
    np.testing.assert_allclose(rate[late][:-1], (result.u + unknown)[late][:-1], atol=0.02)
    assert np.abs(unknown[late]).max() > 4.0


def test_unknown_term_of_an_unperturbed_run_is_the_input(fmu: Path) -> None:
    game = game_parameters(read_model(fmu))
    still = run(fmu, stop_time=0.1, outputs=["x"], start_values={"perturbed": False, "d_ext[2,1]": 3.0})
    expected = np.zeros((len(still.time), 5, 2))
    expected[:, 1, 0] = 3.0
    np.testing.assert_array_equal(unknown_term(game, still), expected)


def test_sphere_switches_are_among_the_located_events(evidence: Evidence) -> None:
    result = evidence.result
    switches = sphere_switches(result)
    events = result["solver_events"]
    assert 0 < len(switches) <= events[-1] == 22.0
    for sample, *_ in switches:
        assert events[sample] > events[sample - 1]
    columns = {(i, k) for _, i, k, _ in switches}
    for column in columns:
        states = [enters for _, i, k, enters in switches if (i, k) == column]
        assert states == [position % 2 == 0 for position in range(len(states))]  # enters first, then in turn


def test_energy_and_shared_signals(evidence: Evidence) -> None:
    result = evidence.result
    energy = energy_so_far(result)
    expected = np.trapezoid(np.sum(result.u[:, 2] ** 2, axis=1), result.time)
    assert energy[-1, 2] == pytest.approx(expected)
    assert (np.diff(energy, axis=0) >= 0.0).all()
    shared = shared_signal(result)
    assert shared is not None
    np.testing.assert_array_equal(shared[:, 0], result.z[:, 0])
    np.testing.assert_array_equal(shared[:, 4], result.x[:, 4])


def test_the_page_is_self_contained(page: Path) -> None:
    read = Elements(page.read_text(encoding="utf-8"))
    links = [
        (tag, name, value)
        for tag, attributes in read.elements
        for name, value in attributes.items()
        if name in ("src", "href", "action", "data", "poster", "srcset")
    ]
    assert {tag for tag, *_ in links} == {"a", "link"}
    assert all(str(value).startswith(("#", "data:")) for *_, value in links)
    policy = next(each for tag, each in read.elements if tag == "meta" and "http-equiv" in each)["content"]
    assert str(policy).startswith("default-src 'none'")
    assert page.stat().st_size < 3e6


def test_the_page_tells_claims_parameters_and_provenance(page: Path, evidence: Evidence) -> None:
    text = Elements(page.read_text(encoding="utf-8")).text
    assert "Every claim holds" in text
    assert evidence.validation is not None
    for claim in evidence.validation.claims:
        assert claim.statement in text
        assert claim.reason in text
    for part in (
        "Communication graph: 1-2, 1-5, 2-3, 3-4, 4-5",
        "ours: the paper prints none",
        evidence.result.guid,
    ):
        assert part in text
    assert "differs from the FMU" not in text
    assert evidence.analysis is not None
    for verdict in evidence.analysis.verdicts:
        assert verdict in text
    assert page.read_text(encoding="utf-8").count("<math") > 20


def test_equal_evidence_gives_equal_pages(evidence: Evidence, page: Path) -> None:
    assert render_page(evidence) == page.read_text(encoding="utf-8")


def test_changed_parameters_are_listed_and_the_claims_left_out(fmu: Path) -> None:
    changed = evidence_of_game(fmu, changes={"k3": 40.0, "a[1,3]": 0.5, "robust": False}, stop_time=1.0)
    assert changed.validation is None
    text = Elements(render_page(changed)).text
    assert "this run has changed parameters" in text
    words = " ".join(text.split())
    assert "parameter here start value k3 40 50 a[1,3] 0.5 0 robust false true" in words


def test_pages_of_long_runs_stay_small(evidence: Evidence) -> None:
    """Noise hardly compresses: samples are left out."""
    count = 20_000
    rng = np.random.default_rng(3)
    columns = {name: rng.normal(size=count) ** 2 for name in evidence.result.columns}
    longer = replace(evidence.result, time=np.linspace(0.0, 20.0, count), columns=columns)
    page = render_page(replace(evidence, result=longer, unknown=None))
    assert len(page) < 3e6


def test_a_claim_that_fails_is_told(evidence: Evidence) -> None:
    assert evidence.validation is not None
    first, *rest = evidence.validation.claims
    failed = replace(evidence.validation, claims=(replace(first, verdict=Verdict.FAILS), *rest))
    broken = replace(evidence, validation=failed)
    assert not broken.passed
    assert f"Of {len(failed.claims)} claims: {len(rest)} hold, 1 fails" in Elements(render_page(broken)).text


def test_stored_results(fmu: Path, tmp_path: Path) -> None:
    result = run(fmu, stop_time=1.0)
    for suffix in (".parquet", ".csv"):
        path = result.save(tmp_path / f"run{suffix}")
        written = report(path, tmp_path / f"run{suffix}.html")
        assert written.passed
        text = Elements(written.path.read_text(encoding="utf-8")).text
        assert "made from a stored run" in text
        assert ("k1" in text) is (suffix == ".parquet")
        names = [figure.name for figure in figures(written.evidence)]
        assert names == [name for name in EVERY_FIGURE if name != "estimates"]
    few = run(fmu, stop_time=1.0, outputs=["x"]).save(tmp_path / "few.parquet")
    assert [figure.name for figure in figures(report(few, tmp_path / "few.html").evidence)] == [
        "actions",
        "plane",
        "error",
    ]
    with pytest.raises(GameError, match="takes neither parameters"):
        report(few, tmp_path / "few.html", changes={"k1": 1.0})


@pytest.mark.parametrize(("players", "dimension"), [(3, 1), (2, 3), (MOST_PLAYERS + 2, 2)])
def test_other_sizes(players: int, dimension: int, tmp_path: Path) -> None:
    game = tmp_path / "game.toml"
    shown = 'expose = "outputs"\n' if players > MOST_PLAYERS else ""  # what is drawn of many players
    game.write_text(shown + new_game(Recipe(players, dimension, graph="path")))
    fmu = build_fmu(game, tmp_path / "game.fmu")
    evidence = evidence_of_game(fmu, claims=False, stop_time=1.0)
    drawn = {figure.name: figure for figure in figures(evidence)}
    assert ("plane" in drawn) is (dimension >= 2)
    assert ("estimates" in drawn) is (players < 12)
    assert ("first 40 of 42 players" in drawn["actions"].caption) is (players > MOST_PLAYERS)
    assert render_page(evidence)


def hostile(fmu: Path, folder: Path) -> Path:
    """A game whose names try to be code."""
    with zipfile.ZipFile(fmu) as archive:
        text = archive.read("resources/game.toml").decode()
    text = text.replace(
        "Connectivity control of five vehicles", "</script><script>window.broken = 1</script>"
    )
    text = text.replace("vehicle 1", "<img src=x onerror='window.broken = 1'>")
    game = folder / "hostile.toml"
    game.write_text(text, encoding="utf-8")
    return build_fmu(game, folder / "hostile.fmu")


def test_names_are_text_not_code(fmu: Path, tmp_path: Path) -> None:
    page = render_page(evidence_of_game(hostile(fmu, tmp_path), claims=False, stop_time=0.2))
    assert "</script><script>window" not in page
    assert "<img src=x" not in page
    tags = [tag for tag, _ in Elements(page).elements]
    assert tags.count("script") == 3
    assert "img" not in tags


@pytest.fixture(scope="module")
def open_page() -> Iterator[Callable[[Path], Any]]:
    """Opens a page in Chromium and waits until it is drawn."""
    with chromium() as browser:

        def visit(path: Path) -> Any:
            browser.get(path.as_uri())
            wait_for(lambda: browser.execute_script("return document.body.dataset.ready") == "true")
            return browser

        yield visit


CURVES = """
return [...document.querySelectorAll(".plot")].map(plot => [plot.id,
  [...plot.querySelectorAll(".scatterlayer .trace path")].filter(path => {
    const box = path.getBBox();
    return box.width + box.height > 1;
  }).length]);
"""


@needs_chromium
def test_in_chromium_every_figure_is_drawn_and_nothing_complains(
    page: Path, open_page: Callable[[Path], Any]
) -> None:
    browser = open_page(page)
    browser.get_log("performance")  # what earlier pages asked for
    browser = open_page(page)
    curves = dict(browser.execute_script(CURVES))
    assert list(curves) == [f"plot-{name}" for name in EVERY_FIGURE]
    assert all(count >= 2 for count in curves.values()), curves
    assert curves["plot-actions"] >= 20  # ten actions, ten levels
    assert browser.get_log("browser") == []
    messages = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    asked = {
        each["params"]["request"]["url"] for each in messages if each["method"] == "Network.requestWillBeSent"
    }
    assert {url for url in asked if not url.startswith("data:")} <= {page.as_uri()}


@needs_chromium
def test_in_chromium_the_reader_chooses_and_plays(page: Path, open_page: Callable[[Path], Any]) -> None:
    browser = open_page(page)
    script = browser.execute_script

    network = "document.getElementById('plot-network')"
    select = "document.querySelector('select[data-figure=network]')"
    shown = f"return {network}.data.filter(trace => trace.visible).map(trace => trace.name)"
    assert script(shown)[0] == "g[1,1] + d[1,1]"
    script(f"{select}.value = '9'; {select}.dispatchEvent(new Event('change'))")
    wait_for(lambda: script(shown)[0] == "g[5,2] + d[5,2]")

    limits = "return document.getElementById('plot-actions').layout.xaxis.range"
    assert script(limits)[1] < 5.0
    script("document.querySelector('button[data-figure=actions][data-range=\"1\"]').click()")
    wait_for(lambda: script(limits) == [0, 20])

    place = "return [...document.querySelectorAll('#plot-plane .point')].at(-1).getAttribute('transform')"
    before = script(place)
    script(
        "Plotly.animate('plot-plane', null, {frame: {duration: 5, redraw: false}, transition: {duration: 0}})"
    )
    wait_for(lambda: script(place) != before)
    wait_for(lambda: script("return document.getElementById('plot-plane').layout.sliders[0].active") > 100)
    assert browser.get_log("browser") == []


@needs_chromium
def test_in_chromium_the_play_button_plays(page: Path, open_page: Callable[[Path], Any]) -> None:
    from selenium.webdriver.common.by import By

    browser = open_page(page)
    (play,) = (
        each
        for each in browser.find_elements(By.CSS_SELECTOR, "#plot-plane .updatemenu-button")
        if "Play" in each.get_attribute("textContent")
    )
    browser.execute_script("document.getElementById('plane').scrollIntoView()")
    play.click()
    active = "return document.getElementById('plot-plane').layout.sliders[0].active"
    wait_for(lambda: browser.execute_script(active) > 3)


@needs_chromium
def test_in_chromium_names_are_not_run(fmu: Path, tmp_path: Path, open_page: Callable[[Path], Any]) -> None:
    path = tmp_path / "hostile.html"
    path.write_text(render_page(evidence_of_game(hostile(fmu, tmp_path), claims=False, stop_time=0.2)))
    browser = open_page(path)
    assert browser.execute_script("return window.broken") is None
    assert browser.execute_script("return document.querySelectorAll('img').length") == 0
    assert browser.title == "</script><script>window.broken = 1</script>"
    assert browser.get_log("browser") == []


@needs_chromium
def test_in_chromium_on_a_telephone(page: Path, open_page: Callable[[Path], Any]) -> None:
    """390 px wide: nothing but tables and formulas in boxes of their own is wider than the screen."""
    browser = open_page(page)
    size = {"width": 390, "height": 800, "deviceScaleFactor": 1, "mobile": True}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    width = "return [document.documentElement.scrollWidth, document.documentElement.clientWidth]"
    wait_for(lambda: browser.execute_script(width) == [390, 390])
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def seen(browser: Any, script: str, expected: object) -> bool:
    return bool(browser.execute_script(script) == expected)


@needs_chromium
def test_in_chromium_the_figures_follow_the_dark_mode(page: Path, open_page: Callable[[Path], Any]) -> None:
    browser = open_page(page)
    colours = """
        const plot = document.getElementById("plot-error");
        return [getComputedStyle(document.body).backgroundColor, plot._fullLayout.paper_bgcolor,
          plot._fullLayout.font.color];"""
    assert browser.execute_script(colours) == ["rgb(255, 255, 255)", "white", "#222222"]
    for scheme, expected in (
        ("dark", ["rgb(22, 22, 24)", "#161618", "#e6e6e6"]),
        ("light", ["rgb(255, 255, 255)", "white", "#222222"]),
    ):
        features = {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", features)
        wait_for(partial(seen, browser, colours, expected))
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
    assert browser.get_log("browser") == []


def test_command(fmu: Path, tmp_path: Path) -> None:
    output = tmp_path / "report.html"
    done = mog("report", fmu, "--output", output, "--no-claims", "--stop-time", 1)
    assert (done.exit_code, done.stdout) == (0, f"{output}\n")
    assert output.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    changed = mog("report", fmu, "-o", output, "--set", "k3=40", "--set", "a[1,3]=1", "--stop-time", 1)
    assert changed.exit_code == 0
    assert "mog report" in mog("report", "--help").stdout.split("Example")[1]


def test_command_fails_with_the_claims(tmp_path: Path) -> None:
    game = tmp_path / "slow.toml"
    text = new_game(Recipe(3, 1, orders="second"))
    game.write_text(re.sub(r"^k3 = .*$", "k3 = 0.3", text, flags=re.MULTILINE))
    output = tmp_path / "slow.html"
    done = mog("report", game, "-o", output)
    assert (done.exit_code, done.stdout) == (1, f"{output}\n")
    assert re.fullmatch(r"mog: .*theorem_2_stability.*: fails\n", done.stderr)
    assert "fails" in Elements(output.read_text(encoding="utf-8")).text


@pytest.mark.parametrize(
    ("arguments", "status", "told"),
    [
        (["--output", "report.pdf"], 2, "must end in .html"),
        (["--set", "k1"], 2, "expected"),
        (["--nonsense"], 2, "nonsense"),
        (["--set", "k5=1"], 1, "there is no variable k5"),
        (["nothing.fmu"], 1, "there is no FMU"),
        (["nothing.parquet"], 1, "there is no result file"),
        (["nothing.txt"], 1, "expected an FMU"),
        (["no_such_game"], 1, "no_such_game"),
    ],
)
def test_wrong_commands(
    arguments: list[str], status: int, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = mog("report", *arguments)
    assert done.exit_code == status
    assert told in done.stderr
    if status == 1:
        assert done.stderr.startswith("mog: ")
        assert done.stderr.count("\n") == 1


def test_a_page_that_cannot_be_written(evidence: Evidence, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    stored = evidence.result.save(tmp_path / "run.parquet")
    with pytest.raises(ResultError, match="cannot write"):
        report(stored, tmp_path / "file" / "report.html")


def test_evidence_of_a_result_has_no_claims(evidence: Evidence) -> None:
    alone = evidence_of_result(evidence.result)
    assert alone.passed
    assert alone.unknown is None
    assert [figure.name for figure in figures(alone)] == EVERY_FIGURE
