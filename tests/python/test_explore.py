"""What the page of mog explore is answered: pictures, spectra, files, and who is refused."""

import http.client
import json
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mixed_order_game import GameError, MixedOrderGameError, Simulator, build_fmu, read_model, run
from mixed_order_game.explore.facts import facts_of
from mixed_order_game.explore.game_file import changed_game
from mixed_order_game.explore.picture import picture_of, sample_times
from mixed_order_game.explore.spectrum import spectrum_of
from mixed_order_game.explore.wish import Push, Wish, wish_of
from mixed_order_game.fmu.model import Value
from mixed_order_game.fmu.schedule import Disturbance
from mixed_order_game.game.new import Recipe, new_game
from tests.conftest import FmuOf
from tests.explored import Served, served_page

PAGE = Path(__file__).resolve().parents[2] / "python_harness" / "mixed_order_game" / "explore" / "page"


@pytest.fixture(scope="module")
def vehicles(fmu: Path) -> Iterator[Simulator]:
    with Simulator(fmu) as simulator:
        yield simulator


def unpacked(data: bytes, curves: int) -> tuple[dict[str, Any], list[np.ndarray]]:
    """Head, and x_star, time, error and the curves (N D, T), read as the page does."""
    length = int.from_bytes(data[:4], "little")
    assert length % 4 == 0
    head = json.loads(data[4 : 4 + length])
    floats = np.frombuffer(data[4 + length :], dtype="<f4")
    T = head["samples"]
    return head, [
        *np.split(floats[: curves + 2 * T], [curves, curves + T]),
        floats[curves + 2 * T :].reshape(curves, T),
    ]


def test_a_picture_is_the_run(vehicles: Simulator, fmu: Path) -> None:
    wish = wish_of(
        {"changes": {"k1": 14.0, "x0[2,1]": 3.0}, "pushes": [[1.0, 4, 2, 60.0, 0.3]]}, vehicles.model
    )
    picture = picture_of(vehicles, wish)
    disturbance = np.zeros((3, 5, 2))
    disturbance[1, 3, 1] = 60.0
    expected = run(
        fmu,
        start_values=wish.changes,
        inputs=Disturbance(np.array([0.0, 1.0, 1.3]), disturbance),
        step=0.1,
    )
    assert (picture.problem, picture.time[0], picture.time[-1]) == (None, 0.0, 20.0)
    for k in (10, 12, 13, 20, 200):
        seen = np.array([np.interp(0.1 * k, picture.time, column) for column in picture.x.reshape(-1, 10).T])
        np.testing.assert_allclose(seen, expected.x[k].ravel(), atol=2e-3)
    np.testing.assert_allclose(
        picture.error, np.linalg.norm(picture.x - picture.x_star, axis=(1, 2)), rtol=1e-6, atol=1e-9
    )
    head, (x_star, time, error, curves) = unpacked(picture.packed(), 10)
    assert head["figures"]["settling_time"] > 0.0
    np.testing.assert_allclose(x_star, -0.5, rtol=1e-6)
    np.testing.assert_allclose(time, picture.time, rtol=1e-6)
    np.testing.assert_allclose(error, picture.error, rtol=1e-6)
    np.testing.assert_allclose(curves[7], picture.x[:, 3, 1], rtol=1e-6)  # x[4,2]


def test_samples_are_close_where_something_happens() -> None:
    times = sample_times(Wish({}, (Push(5.0, 1, 1, 1.0, 0.5),), 20.0), 10)
    gaps = np.diff(times)
    assert gaps.min() > 0.0
    assert {0.0, 5.0, 5.5, 20.0} <= set(times.tolist())
    for moment in (0.0, 5.0, 5.5):
        assert gaps[times[:-1] == moment] < 1e-3
    assert len(sample_times(Wish({}, (), 20.0), 200)) == 201
    assert len(sample_times(Wish({}, (), 20.0), 10)) == 601


def test_a_run_that_escapes_is_drawn_as_far_as_it_went(vehicles: Simulator) -> None:
    picture = picture_of(vehicles, wish_of({"changes": {"x0[2,1]": 60.0}}, vehicles.model))
    assert picture.problem is not None
    assert "player 2 grows without bound" in picture.problem
    assert 0 < len(picture.time) < 601
    assert picture.metrics is None
    head, _ = unpacked(picture.packed(), 10)
    assert head["problem"] == picture.problem
    apart = wish_of({"changes": {"a[1,2]": 0, "a[1,5]": 0}}, vehicles.model)
    refused = picture_of(vehicles, apart)
    assert refused.problem is not None
    assert "{1}, {2, 3, 4, 5}" in refused.problem
    assert len(refused.time) == 0


def test_a_run_that_nobody_waits_for_ends_and_the_next_one_is_whole(vehicles: Simulator) -> None:
    wish = wish_of({}, vehicles.model)
    whole = picture_of(vehicles, wish)
    asked = iter(range(600))

    def go_on() -> None:
        if next(asked) == 20:
            raise InterruptedError

    with pytest.raises(InterruptedError):
        picture_of(vehicles, wish, go_on)
    np.testing.assert_array_equal(picture_of(vehicles, wish).x, whole.x)


@pytest.mark.parametrize(
    ("data", "told"),
    [
        ([], r"\[\] is not an object"),
        ({"nonsense": 1}, "there is no nonsense"),
        ({"changes": []}, "changes is"),
        ({"changes": {"k9": 1.0}}, "there is no variable k9"),
        ({"changes": {"k1": None}}, "k1 is a number, not None"),
        ({"changes": {"k1": -1}}, "k1 is -1, expected a positive number"),
        ({"changes": {"u[1,1]": 1}}, "cannot be set"),
        ({"stop_time": 0}, "the end of the run is 0 s"),
        ({"stop_time": "x"}, "stop_time is 'x'"),
        ({"pushes": 3}, "pushes is no list"),
        ({"pushes": [[]] * 101}, "at most 100"),
        ({"pushes": [[0, 1, 1, 1]]}, "is not a push"),
        ({"pushes": [[0, 6, 1, 1, 1]]}, "player is 6, expected 1 to 5"),
        ({"pushes": [[0, 1, 1.5, 1, 1]]}, "coordinate is 1.5, expected 1 to 2"),
        ({"pushes": [[-1, 1, 1, 1, 1]]}, "a time of at least 0"),
        ({"pushes": [[0, 1, 1, None, 1]]}, "size is None, expected a number"),
        ({"pushes": [[0, 1, 1, 1, 0]]}, "positive duration"),
    ],
)
def test_wishes_that_make_no_sense(data: Any, told: str, vehicles: Simulator) -> None:
    with pytest.raises(MixedOrderGameError, match=told):
        wish_of(data, vehicles.model)


def test_pushes_add_up_while_they_overlap(vehicles: Simulator) -> None:
    wish = wish_of({"pushes": [[1, 1, 1, 5, 2], [2, 1, 1, 7, 2], [2, 3, 2, -1, 1]]}, vehicles.model)
    rows = wish.disturbance(vehicles.model)
    assert rows is not None
    assert rows.time.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert rows.values[:, 0, 0].tolist() == [0.0, 5.0, 12.0, 7.0, 0.0]
    assert rows.values[:, 2, 1].tolist() == [0.0, 0.0, -1.0, 0.0, 0.0]


def test_the_spectrum_is_that_of_the_linearized_fmu(vehicles: Simulator) -> None:
    changes: dict[str, Value] = {"k2": 2.0, "a[1,3]": 0.7}
    spectrum = spectrum_of(vehicles, changes)
    kinds = [vehicles.model.indexed(stem) for stem in "xzvy"]
    first = [each.name for kind in kinds for index, each in kind.items() if index[-1] == 1]
    off: dict[str, Value] = {**changes, "robust": False, "perturbed": False}
    expected = np.linalg.eigvals(vehicles.jacobian(first, off))  # coordinates do not interact
    assert len(spectrum.eigenvalues) == len(expected) == 35
    np.testing.assert_allclose(
        np.poly(spectrum.eigenvalues / 50.0), np.poly(expected / 50.0), rtol=1e-6, atol=1e-9
    )
    assert spectrum.verdict == "stable"
    assert spectrum.reason == f"The slowest mode decays at {-expected.real.max():.4g} 1/s."


def test_verdicts(vehicles: Simulator, tmp_path: Path) -> None:
    unstable = spectrum_of(vehicles, {"k1": 5.0, "k3": 5.0, "k4": 5.0})
    assert unstable.verdict == "unstable"
    assert "A mode grows at" in unstable.reason
    apart = spectrum_of(vehicles, {"a[1,2]": 0.0, "a[1,5]": 0.0})
    assert (apart.verdict, len(apart.eigenvalues)) == ("not decided", 35)
    with Simulator("energy_peak_price") as simulator:
        near = spectrum_of(simulator, {})
        assert (near.verdict, len(near.eigenvalues)) == ("stable", 35)
        assert "near x*" in near.reason
        assert spectrum_of(simulator, {"k1": 1.0, "k3": 1.0, "k4": 1.0}).verdict == "unstable"
    game = tmp_path / "many.toml"
    game.write_text(new_game(Recipe(31, 1, graph="ring")), encoding="utf-8")
    with Simulator(build_fmu(game, tmp_path / "many.fmu")) as simulator:
        large = spectrum_of(simulator, {})
        assert (large.verdict, len(large.eigenvalues)) == ("stable", 0)
        told = "All 1,023 eigenvalues have negative real parts; they are too many to be drawn."
        assert large.reason == told
        assert spectrum_of(simulator, {"k3": 0.01}).verdict == "unstable"


DIFFERENT = """
[[player]]
name = "one"
order = 1
x0 = 1.0
y0 = "x0"
z0 = "x0"
cost = { quadratic = 1.0, linear = -1.0, coupling = [[2, 0.5]] }
[[player]]
name = "two"
order = 2
x0 = -2.0
gains = { k4 = 40.0 }
cost = { expression = "h[2] * (x[i] - price)^2" }
[[player]]
name = "three"
order = 1
x0 = 0.5
cost = { quadratic = 1.0, coupling = [[1, 0.5]] }
"""
HEAD = """
title = "Three that differ"   # a comment that stays
dimension = 1
[gains]
k1 = 10.0
k2 = 1.0
k3 = 50.0
k4 = 30.0
beta = 10.0
delta = 5.0
epsilon = 0.02
[rbf]
centers = [-1.0, 0.0, 1.0]
width = 3.0
W_max = 50.0
[graph]
directed = true
edges = [[1, 2], [2, 3, 2.0], [3, 1]]
[parameters]
price = { value = 3.0, min = 0.0 }
h = [1.0, 2.0]
S = [[1.0, 2.0], [3.0, 4.0]]
[defaults]
gains = { beta = 7.0 }
dynamics = { expression = "S[1,2] * 0.1 * sin(x[i])" }
"""


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("five_vehicles", {"k1": 12.0, "epsilon": 0.02, "a[1,3]": 0.5, "a[1,2]": 0.0, "x0[2,1]": 3.0}),
        ("five_vehicles", {"robust": False, "perturbed": False}),
        ("two_scalar_players", {"x0[1,1]": 2.5, "k3": 41.0}),
        ("energy_peak_price", {"x0[1,1]": 4.0, "p": 2.0, "h[3]": 6.5, "beta": 4.0}),
        ("rivalling_pairs", {"x0[2,2]": 0.5, "p[3,1]": 0.25, "robust": False}),
        ("different", {"k4[2]": 33.0, "beta[1]": 8.0, "k1[3]": 11.0, "a[1,2]": 0.5, "a[2,1]": 3.0}),
        ("different", {"x0[1,1]": 7.0, "price": 4.0, "h[2]": 1.5, "S[1,2]": 0.5, "a[1,3]": 0.25}),
    ],
)
def test_the_game_file_has_what_the_page_shows(
    name: str, changes: dict[str, Value], fmu_of: FmuOf, tmp_path: Path
) -> None:
    if name == "different":
        (tmp_path / "different.toml").write_text(HEAD + DIFFERENT, encoding="utf-8")
        model = read_model(tmp_path / "different.toml")
    else:
        model = read_model(fmu_of(name) if name in ("five_vehicles", "two_scalar_players") else name)
    game = changed_game(model, changes)
    made = read_model(game.build(tmp_path / "game.fmu"))
    assert made.start_values() == model.start_values(changes)
    with Simulator(made.path) as built, Simulator(model.path) as shown:
        stars = [variable.name for variable in model.indexed("x_star").values()]
        np.testing.assert_allclose(built.at_start(stars, {}), shown.at_start(stars, changes), rtol=1e-9)
    if name == "different":
        assert "# a comment that stays" in game.text()


def test_what_the_game_file_does_not_take(vehicles: Simulator) -> None:
    with pytest.raises(GameError, match=r"cost_quadratic\[1\] is not among what is written"):
        changed_game(vehicles.model, {"cost_quadratic[1]": 2.0})


def test_facts(vehicles: Simulator) -> None:
    facts = json.loads(json.dumps(facts_of(vehicles.model, "five_vehicles")))
    assert [control["name"] for control in facts["gains"]] == [
        "k1",
        "k2",
        "k3",
        "k4",
        "beta",
        "delta",
        "epsilon",
    ]
    assert [control["start"] for control in facts["switches"]] == [True, True]
    assert (facts["dimension"], facts["directed"], len(facts["players"])) == (2, False, 5)
    assert (facts["edges"]["a[1,2]"], facts["edges"]["a[1,3]"], facts["x0"]["x0[1,2]"]) == (1.0, 0.0, 8.0)
    h = facts_of(read_model("energy_peak_price"), "")["parameters"]
    assert [control["name"] for control in h][:4] == ["p", "peak", "Q", "h[1]"]


def test_no_control_for_a_gain_that_moves_no_player(tmp_path: Path) -> None:
    game = tmp_path / "quick.toml"
    game.write_text(new_game(Recipe(players=2, dimension=1, orders="second", graph="path")), encoding="utf-8")
    gains = facts_of(read_model(game), "")["gains"]
    assert [control["name"] for control in gains] == ["k2", "k3", "k4", "beta", "delta", "epsilon"]


def test_the_page_asks_no_network_for_anything() -> None:
    for path in PAGE.iterdir():
        text = path.read_text(encoding="utf-8").replace("http://www.w3.org/2000/svg", "")
        assert not re.search(r"https?:|//[\w.-]+\.\w+/|@import", text), path


@pytest.fixture(scope="module")
def served(fmu: Path) -> Iterator[Served]:
    with served_page(fmu) as served:
        yield served


def request(
    served: Served, method: str, path: str, body: object = None, headers: dict[str, str] | None = None
) -> tuple[int, dict[str, str], bytes]:
    connection = http.client.HTTPConnection(*served, timeout=60)
    try:
        text = body if isinstance(body, str | None) else json.dumps(body)
        connection.request(method, path, text, headers or {})
        answer = connection.getresponse()
        return answer.status, dict(answer.getheaders()), answer.read()
    finally:
        connection.close()


def test_only_the_page_itself_is_served(served: Served) -> None:
    host, port = served
    assert host == "127.0.0.1"
    for path in ("/", "/explore.js", "/bokeh/bokeh.min.js", "/game", "/nothing"):
        for method in ("GET", "POST"):
            status, _, body = request(served, method, path, headers={"Host": f"evil.example:{port}"})
            assert (status, body) == (403, b"403: Host is not localhost or 127.0.0.1\n")
    here = f"http://127.0.0.1:{port}"
    for origin in (
        "http://evil.example",
        "null",
        f"http://localhost:{port}",
        f"{here}1",
        here.replace("http", "https"),
    ):
        for path in ("/run", "/spectrum", "/claims", "/file.fmu", "/game"):
            method = "GET" if path == "/game" else "POST"
            status, headers, body = request(served, method, path, {}, {"Origin": origin})
            assert (status, body) == (403, b"403: Origin is not this page\n")
            assert "Access-Control-Allow-Origin" not in headers
    assert request(served, "POST", "/spectrum", {}, {"Origin": here})[0] == 200
    assert request(served, "GET", "/", headers={"Host": f"localhost:{port}"})[0] == 200


def test_the_pages_own_files(served: Served) -> None:
    for path in PAGE.iterdir():
        status, headers, body = request(served, "GET", "/" + path.name.replace("index.html", ""))
        assert (status, body) == (200, path.read_bytes())
        assert "script-src 'self';" in headers["Content-Security-Policy"]
    assert request(served, "GET", "/bokeh/bokeh-api.min.js")[0] == 200
    for other in ("/../server.py", "/%2e%2e/server.py", "/bokeh/compiler.js", "/run"):
        assert request(served, "GET", other)[0] in (404, 405)


def test_errors_are_answers(served: Served) -> None:
    status, _, body = request(served, "POST", "/run", {"changes": {"k1": -1}})
    assert status == 200
    head, arrays = unpacked(body, 10)
    assert head == {"samples": 0, "problem": "k1 is -1, expected a positive number", "figures": None}
    assert np.isnan(arrays[0]).all()
    for path in ("/spectrum", "/claims", "/file.toml", "/file.fmu", "/file.csv"):
        _, _, body = request(served, "POST", path, {"changes": {"k1": -1}})
        assert json.loads(body) == {"problem": "k1 is -1, expected a positive number"}
    _, _, body = request(served, "POST", "/file.csv", {})
    assert json.loads(body) == {"problem": "there are no pushes"}
    assert request(served, "POST", "/run", "{")[::2] == (400, b"400: The body is not JSON\n")


def test_files_to_keep(served: Served, tmp_path: Path) -> None:
    wish = {"changes": {"k1": 12.0}, "pushes": [[1.0, 2, 1, 30.0, 0.5]]}
    _, _, text = request(served, "POST", "/file.toml", wish)
    assert b"k1 = 12.0" in text
    (tmp_path / "game.fmu").write_bytes(request(served, "POST", "/file.fmu", wish)[2])
    assert read_model(tmp_path / "game.fmu").gains["k1"] == 12.0
    _, _, rows = request(served, "POST", "/file.csv", wish)
    assert rows.splitlines()[2].startswith(b"1.0,0.0,0.0,30.0,")


def test_claims(served: Served) -> None:
    _, _, body = request(served, "POST", "/claims", {"changes": {"k1": 5.0, "k3": 5.0, "k4": 5.0}})
    found = json.loads(body)
    verdicts = {claim["name"]: claim["verdict"] for claim in found["claims"]}
    assert verdicts["theorem_2_stability"] == "fails"
    assert found["summary"].startswith("Of ")


def test_a_port_that_is_taken(served: Served, fmu: Path) -> None:
    from typer.testing import CliRunner

    from mixed_order_game.cli.app import app

    done = CliRunner().invoke(app, ["explore", str(fmu), "--no-browser", "--port", str(served[1])])
    assert done.exit_code == 1
    assert done.stderr == f"mog: there can be no page at port {served[1]}: address already in use\n"


def test_what_the_documentation_shows() -> None:
    text = (PAGE.parents[2] / "docs" / "explore.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"^```console\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    for line in block.splitlines():
        name, command, *arguments = shlex.split(line)
        assert (name, command) == ("mog", "explore")
        with served_page(*arguments) as served:
            title = json.loads(request(served, "GET", "/game")[2])["title"]
            assert title == read_model(arguments[0] if arguments else None).title
