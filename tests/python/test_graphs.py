"""Communication graphs: counts that are known, generators, text and the FMU's edges."""

from pathlib import Path

import networkx as nx
import numpy as np
import pytest

from mixed_order_game import default_game, read_model
from mixed_order_game.game.graphs import (
    CommunicationGraph,
    GraphError,
    all_connected,
    connected_classes,
    from_networkx,
    graph_of,
    graph_of_model,
    graph_of_text,
    graphs_of_text,
)
from tests.conftest import FmuOf


@pytest.mark.parametrize(("players", "count", "classes"), [(2, 1, 1), (3, 4, 2), (4, 38, 6), (5, 728, 21)])
def test_counts(players: int, count: int, classes: int) -> None:
    graphs = list(all_connected(players))
    assert len(set(graphs)) == count
    assert all(nx.is_connected(nx.from_numpy_array(graph.adjacency)) for graph in graphs)
    assert len(list(connected_classes(players))) == classes


@pytest.mark.parametrize(
    ("text", "edges"),
    [
        ("ring", "1-2 1-6 2-3 3-4 4-5 5-6"),
        ("path", "1-2 2-3 3-4 4-5 5-6"),
        ("star", "1-2 1-3 1-4 1-5 1-6"),
        ("3-1:0.5,2-3,3-4,4-5 5-6", "1-3:0.5 2-3 3-4 4-5 5-6"),
    ],
)
def test_fixed_kinds(text: str, edges: str) -> None:
    (graph,) = graphs_of_text(text, 6)
    assert graph.label == edges
    assert graph_of_text(edges, 6) == graph
    assert graph_of(graph.adjacency) == graph


@pytest.mark.parametrize(
    "text",
    ["tree@4", "random:0.4@4", "regular:3@4", "small-world:4:0.2@4", "scale-free:2@4", "geometric:0.5@4"],
)
def test_random_kinds(text: str) -> None:
    graphs = graphs_of_text(text, 12, seed=3)
    assert graphs == graphs_of_text(text, 12, seed=3)
    assert graphs != graphs_of_text(text, 12, seed=4)
    assert graphs_of_text(text.replace("@4", "@2"), 12, seed=3) == graphs[:2]
    assert len({graph.label for graph in graphs}) == 4
    for graph in graphs:
        assert graph.players == 12
        assert graph.algebraic_connectivity > 1e-6


def test_algebraic_connectivity() -> None:
    (complete,) = graphs_of_text("complete", 7)
    assert complete.algebraic_connectivity == pytest.approx(7.0)
    assert graph_of_text("1-2 3-4", 4).algebraic_connectivity == pytest.approx(0.0, abs=1e-12)


def test_networkx_weights() -> None:
    graph: nx.Graph[str] = nx.Graph()
    graph.add_edge("b", "a", weight=2.0)
    graph.add_edge("a", "c")
    assert from_networkx(graph) == CommunicationGraph(3, ((1, 2, 2.0), (2, 3, 1.0)))


def test_directed_graphs() -> None:
    graph = graph_of_text("3>1:0.5 1>2,2>3", 3)
    assert graph == CommunicationGraph(3, ((1, 2, 1.0), (2, 3, 1.0), (3, 1, 0.5)), directed=True)
    assert graph_of_text(graph.label, 3) == graph
    assert graph.adjacency.tolist() == [[0.0, 0.0, 0.5], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    assert graph.connected
    assert graph_of(graph.adjacency) == graph
    assert not graph_of_text("1>2 2>3", 3).connected
    (ring,) = graphs_of_text("directed:ring", 5)
    assert ring.label == "1>2 2>3 3>4 4>5 5>1"
    for drawn in graphs_of_text("directed:random:0.3@3", 6, seed=1):
        assert drawn.directed
        assert drawn.connected


def test_edges_of_an_fmu(fmu: Path, fmu_of: FmuOf) -> None:
    model = read_model(fmu)
    assert graph_of_model(model).label == "1-2 1-5 2-3 3-4 4-5"
    assert graphs_of_text("own", 5, own=graph_of_model(model)) == [graph_of_model(model)]
    values = graph_of_text("1-2 2-3:0.25 3-4 4-5", 5).start_values(model)
    assert len(values) == 10
    assert {name: value for name, value in values.items() if value} == {
        "a[1,2]": 1.0,
        "a[2,3]": 0.25,
        "a[3,4]": 1.0,
        "a[4,5]": 1.0,
    }
    with pytest.raises(GraphError, match="the graph has 3 players, the game has 5"):
        graph_of_text("1-2 2-3", 3).start_values(model)
    weighted = read_model(fmu_of("weighted_graph"))
    again = graph_of_text(graph_of_model(weighted).label, weighted.players)
    np.testing.assert_array_equal(again.adjacency, graph_of_model(weighted).adjacency)


def test_weights_of_a_directed_game(tmp_path: Path) -> None:
    """a[i,j] is with what weight i hears j; players of an undirected graph hear each other."""
    text = default_game().read_text(encoding="utf-8").replace("[graph]\n", "[graph]\ndirected = true\n")
    (tmp_path / "game.toml").write_text(text, encoding="utf-8")
    model = read_model(tmp_path / "game.toml")

    def heard(edges: str) -> dict[str, float]:
        values = graph_of_text(edges, 5).start_values(model)
        assert len(values) == 20
        return {name: value for name, value in values.items() if value}

    assert heard("1>2:0.5 5>3") == {"a[2,1]": 0.5, "a[3,5]": 1.0}
    assert heard("1-2:0.5 3-5") == {"a[1,2]": 0.5, "a[2,1]": 0.5, "a[3,5]": 1.0, "a[5,3]": 1.0}


@pytest.mark.parametrize(
    ("text", "players", "told"),
    [
        ("circle", 5, "no kind of graph 'circle'"),
        ("random", 5, "random takes 1 number after a colon, not 0"),
        ("random:x", 5, "numbers after"),
        ("ring@2", 5, "not random"),
        ("tree@0", 5, "count"),
        ("random:0", 5, "no connected graph"),
        ("regular:3", 5, "regular:3 with 5 players"),
        ("random:2", 5, "P of random is 2, expected a probability from 0 to 1"),
        ("directed:random:-0.1", 5, "P of directed:random is -0.1, expected a probability"),
        ("small-world:2:nan", 5, "P of small-world is nan, expected a probability"),
        ("small-world:2.5:0.1", 5, "K of small-world is 2.5, expected a whole number"),
        ("regular:inf", 5, "DEGREE of regular is inf, expected a whole number"),
        ("scale-free:1.9", 5, "M of scale-free is 1.9, expected a whole number"),
        ("geometric:-1", 5, "RADIUS of geometric is -1, expected a positive distance"),
        ("all", 7, "2 to 6 players, not for 7"),
        ("classes", 8, "2 to 7 players, not for 8"),
        ("ring", 10**9, "2 to 1000 players"),
        ("1-2 2-", 5, "'2-' is not an edge"),
        ("1-6", 5, "1-6 is no edge between players 1 to 5"),
        ("2-2", 5, "2-2 is no edge"),
        ("1-2 2-1", 5, "listed twice"),
        ("1-2:0", 5, "not positive"),
        ("1-2:1e", 5, "not a weight"),
        ("1>2 2-3", 5, "'2-3' is not an edge: 2>3 or 2>3:0.5 expected"),
        ("1>2 1>2", 5, "listed twice"),
        ("2>2", 5, "is no edge"),
        ("directed:star", 5, "no kind of graph 'directed:star'"),
        ("directed:random:0", 5, "no connected graph"),
    ],
)
def test_graphs_that_make_no_sense(text: str, players: int, told: str) -> None:
    with pytest.raises(GraphError) as error:
        graphs_of_text(text, players)
    assert told in str(error.value)
