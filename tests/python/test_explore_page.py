"""The page of mog explore in a headless Chromium: what a visitor turns, drags and presses."""

import json
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mixed_order_game import run
from tests.chromium import chromium, needs_chromium, wait_for
from tests.explored import Served, served_page

pytestmark = needs_chromium


class Page:
    """The page in the browser, and what is seen there."""

    def __init__(self, browser: Any, served: Served) -> None:
        self.browser = browser
        self.address = f"http://{served[0]}:{served[1]}/"

    def open(self, state: str = "") -> None:
        self.browser.get("about:blank")
        self.browser.get_log("browser")
        self.browser.get(self.address + state)
        self.drawn()

    def script(self, text: str, *arguments: object) -> Any:
        return self.browser.execute_script(text, *arguments)

    def drawn(self) -> None:
        """Waits until what is shown is what was wished last."""
        wait_for(
            lambda: self.script(
                "const there = window.explored;"
                "return there !== undefined && document.body.dataset.drawn === there.shown.text"
            )
        )

    def turn(self, name: str, value: float) -> None:
        """A slider, by its event, to a value."""
        self.script(
            "const slider = document.querySelector(`input[type=range][data-name='${arguments[0]}']`);"
            "slider.value = Math.log10(arguments[1]);"
            "slider.dispatchEvent(new Event('input', { bubbles: true }));",
            name,
            value,
        )
        self.drawn()

    def curves(self, name: str = "lines") -> np.ndarray:
        """Places of the curves of a picture, (curves, 2, T), as drawn."""
        found = self.script(
            "return window.explored.pictures[arguments[0]].paths.data.xs.map((xs, k) =>"
            "[Array.from(xs), Array.from(window.explored.pictures[arguments[0]].paths.data.ys[k])])",
            name,
        )
        return np.array(found)

    def text(self, element: str) -> str:
        return str(self.script("return document.getElementById(arguments[0]).textContent", element))

    def element(self, selector: str) -> Any:
        return self.browser.find_element("css selector", selector)

    def press(self, selector: str, *keys: str) -> None:
        """Keys where the keyboard is after the element took it."""
        self.script("document.querySelector(arguments[0]).focus()", selector)
        self.browser.switch_to.active_element.send_keys(*keys)

    def complaints(self) -> list[str]:
        return [entry["message"] for entry in self.browser.get_log("browser") if entry["level"] != "INFO"]


@pytest.fixture(scope="module")
def page(fmu: Path) -> Iterator[Page]:
    with ExitStack() as stack:
        served = stack.enter_context(served_page(fmu))
        yield Page(stack.enter_context(chromium()), served)


def test_a_slider_moves_the_curves_and_the_command_repeats_the_run(page: Page, fmu: Path) -> None:
    page.open()
    before = page.curves()
    page.turn("k1", 3.98)
    after = page.curves()
    assert np.abs(after[:, 1] - before[:, 1]).max() > 0.1
    expected = run(fmu, start_values={"k1": 3.98}, step=0.1)
    for k in (1, 2, 5, 50):
        seen = [np.interp(0.1 * k, times, places) for times, places in after]
        np.testing.assert_allclose(seen, expected.x[k].ravel(), atol=2e-2)
    assert page.text("command").endswith("--set k1=3.98")
    wait_for(lambda: page.script("return location.hash") == "#k1=3.98")
    assert "Answered in" in page.text("pace")
    field = page.element("input[type=number][data-name=k1]")
    assert field.get_attribute("value") == "3.98"
    assert page.complaints() == []


def test_an_unstable_loop_is_told_and_what_stops_a_run_is_a_sentence(page: Page) -> None:
    page.open("#k1=5&k3=5&k4=5")
    wait_for(lambda: page.text("verdict") == "unstable")
    assert page.text("reason").startswith("A mode grows at ")
    page.turn("k3", 50.0)
    wait_for(lambda: page.text("verdict") == "stable")
    assert page.script("return document.getElementById('problem').hidden")
    page.open("#x0[2,1]=60")
    assert "player 2 grows without bound" in page.text("problem")
    assert page.curves().shape[2] > 5
    page.open("#nonsense=1")
    assert page.text("problem").startswith("there is no variable nonsense")
    page.element("#reset").click()
    page.drawn()
    assert page.script("return document.getElementById('problem').hidden")
    assert page.complaints() == []


def test_edges_toggle_by_pointer_by_keyboard_and_between_two_players(page: Page) -> None:
    page.open()
    edge = "[data-edge='a[1,3]']"

    def checked() -> str:
        return str(
            page.script("return document.querySelector(arguments[0]).getAttribute('aria-checked')", edge)
        )

    before = page.curves()
    assert checked() == "false"
    page.script("document.querySelector(arguments[0]).scrollIntoView({ block: 'center' })", edge)
    click = "dispatchEvent(new MouseEvent('click', { bubbles: true }))"
    page.script(f"document.querySelector(arguments[0] + ' .hit').{click}", edge)
    page.drawn()
    assert checked() == "true"
    assert page.text("command").endswith("--set 'a[1,3]=1'")
    assert np.abs(page.curves() - before).max() > 1e-3
    page.press(edge, " ")
    page.drawn()
    assert checked() == "false"
    assert page.script("return document.activeElement.dataset.edge") == "a[1,3]"  # the keyboard stays there
    np.testing.assert_array_equal(page.curves(), before)
    page.press("[data-player='3'].node", "\ue007")
    page.press("[data-player='1'].node", "\ue007")
    page.drawn()
    assert checked() == "true"
    page.open("#a[1,2]=0&a[1,5]=0")
    assert "separate groups {1}, {2, 3, 4, 5}" in page.text("problem")
    assert page.complaints() == []


def test_a_player_is_dragged_and_moved_by_keys(page: Page) -> None:
    from selenium.webdriver.common.action_chains import ActionChains

    page.open()
    handle = page.element(".handle[data-player='3']")
    ActionChains(page.browser).click_and_hold(handle).move_by_offset(-40, 30).release().perform()
    page.drawn()
    x, y = (float(page.script("return window.explored.shown.start(3, arguments[0])", k)) for k in (1, 2))
    assert x < 1.0
    assert y < 8.0
    np.testing.assert_allclose(page.curves("plane")[2, :, 0], [x, y], rtol=1e-6)
    page.press(".handle[data-player='3']", "\ue014", "\ue013")  # right, up
    page.drawn()
    moved = page.curves("plane")[2, :, 0]
    assert moved[0] > x
    assert moved[1] > y
    assert handle.get_attribute("aria-label") == "start of player 3, vehicle 3"
    assert handle.get_attribute("aria-valuetext") == ", ".join(
        str(page.script("return window.explored.shown.start(3, arguments[0])", k)) for k in (1, 2)
    )
    assert page.complaints() == []


def test_a_push_while_it_plays_a_pin_and_the_address(page: Page) -> None:
    page.open()
    before = page.curves()
    page.element("#pin").click()
    page.element("#play").click()
    wait_for(lambda: float(page.text("moment-text").split()[0]) > 0.5)
    # in one go, as a slow machine may play to the end between two commands
    page.script(
        "const moment = document.getElementById('moment'); moment.value = 0.1;"
        "moment.dispatchEvent(new Event('input')); document.getElementById('play').click();"
        "document.getElementById('push-now').click()"
    )
    page.drawn()
    (push,) = page.script("return window.explored.shown.pushes")
    assert push == [2, 1, 1, 100, 0.2]
    times, pushed = page.curves()[0]
    still = np.interp(times, *before[0])
    assert np.abs(pushed - still)[times < push[0]].max() < 2e-2
    assert np.abs(pushed - still)[times > push[0]].max() > 0.1
    assert page.text("command").endswith("--disturbance pushes.csv")
    page.turn("k1", 20.0)
    shown = page.curves()
    wait_for(lambda: page.script("return location.hash").startswith("#k1=20&push="))
    state = page.script("return location.hash")
    assert state.endswith("&pinned=")
    page.open(state)
    np.testing.assert_array_equal(page.curves(), shown)
    wait_for(lambda: len(page.script("return document.querySelectorAll('#figures tbody td')")) == 10)
    np.testing.assert_array_equal(
        page.script("return Array.from(window.explored.pictures.lines.pinned.data.ys[0])"), before[0, 1]
    )
    assert page.complaints() == []


def test_claims_are_judged(page: Page) -> None:
    page.open("#k1=5&k3=5&k4=5")
    page.script("document.getElementById('judge').click()")
    wait_for(lambda: page.script("return document.querySelectorAll('#claims dt').length") > 5)
    assert "fails Theorem 2: the unperturbed loop is exponentially stable" in page.text("claims")
    assert page.complaints() == []


def test_by_the_keyboard_alone(page: Page) -> None:
    """Every control is reached by Tab, has a name, and acts on keys."""
    page.open()
    names: list[str] = []
    page.script("document.activeElement.blur()")
    for _ in range(90):
        page.browser.switch_to.active_element.send_keys("\ue004")
        active = page.browser.switch_to.active_element
        if active.tag_name == "body":
            break
        names.append(active.accessible_name)
    assert all(names)
    assert len(names) == len(set(names))
    players = {f"{kind}{i}, vehicle {i}" for kind in ("player ", "start of player ") for i in range(1, 6)}
    buttons = {"Play", "Push now", "Pin this run", "Copy as command", "Game file", "FMU", "Judge them"}
    assert players | buttons | {"Time shown", "k1 in 1/s", "edge 1-2", "robust"} <= set(names)
    page.press("input[type=range][data-name=k2]", "\ue014", "\ue014")  # right
    page.drawn()
    assert page.script("return window.explored.shown.value('k2')") > 1.0


def test_on_a_telephone(page: Page) -> None:
    page.open()
    page.browser.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": True},
    )
    try:
        width = "return [document.documentElement.scrollWidth, document.documentElement.clientWidth]"
        wait_for(lambda: page.script(width) == [390, 390])
        figures = "[...document.querySelectorAll('figure')]"
        visible = f"return {figures}.filter(each => each.offsetParent).map(each => each.id)"
        assert page.script(visible) == ["plane"]
        page.element("[data-picture=error]").click()
        assert page.script(visible) == ["error"]
        wait_for(
            lambda: (
                page.script("return document.querySelector('#error .plot').firstElementChild.offsetWidth")
                > 300
            )
        )
        page.script("document.querySelector('[data-file=\".fmu\"]').scrollIntoView({ block: 'center' })")
        top = "return document.getElementById('pictures').getBoundingClientRect().top"
        wait_for(lambda: page.script(top) == 0)  # stays in sight
        page.turn("k4", 20.0)
    finally:
        page.browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    assert page.complaints() == []


def test_the_page_asks_its_own_server_alone_and_times_each_change(page: Page) -> None:
    page.browser.get_log("performance")
    page.open()
    page.script("performance.clearMeasures()")
    for value in np.geomspace(5.0, 20.0, 12):
        page.turn("k1", value)
    messages = [json.loads(entry["message"])["message"] for entry in page.browser.get_log("performance")]
    asked = {
        each["params"]["request"]["url"] for each in messages if each["method"] == "Network.requestWillBeSent"
    }
    assert {url for url in asked if not url.startswith(("data:", "about:", page.address))} == set()
    paces = page.script("return performance.getEntriesByName('change to picture').map(each => each.duration)")
    assert len(paces) >= 6  # python -m tests.bench.page_pace measures them


@pytest.mark.parametrize(
    ("game", "picture"), [("energy_peak_price", "lines"), ("underwater_vehicles", "plane")]
)
def test_other_games(game: str, picture: str, page: Page) -> None:
    with served_page(game) as served:
        other = Page(page.browser, served)
        other.open()
        flat = picture == "lines"
        assert other.script("return document.getElementById('plane').hidden") is flat
        assert "near x*" in other.text("reason")
        assert len(other.browser.find_elements("css selector", f"#{picture} .handle")) == (5 if flat else 4)
        before = other.curves(picture)
        other.press(f"#{picture} .handle[data-player='1']", "\ue013")
        other.drawn()
        assert other.curves(picture)[0, 1, 0] > before[0, 1, 0]
        parameter = {"energy_peak_price": "h[1]", "underwater_vehicles": "w"}[game]
        other.script(
            "const field = document.querySelector(`input[data-name='${arguments[0]}']`); field.value = 9;"
            "field.dispatchEvent(new Event('change'))",
            parameter,
        )
        other.drawn()
        assert other.text("problem") == ""
        if not flat:
            other.script(
                "const axes = document.getElementById('axes'); axes.value = '2,3';"
                "axes.dispatchEvent(new Event('change'))"
            )
            assert other.curves("plane")[0, 1, 0] == pytest.approx(
                other.script("return window.explored.shown.start(1, 3)")
            )
        assert other.complaints() == []
