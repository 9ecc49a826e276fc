"""The names of graphs, for help texts and completion: light to import."""

GRAPH_KINDS = {
    "all": "every connected labelled graph",
    "classes": "one of every isomorphism class",
    "ring": "",
    "path": "",
    "star": "",
    "wheel": "",
    "complete": "",
    "tree": "",
    "random:P": "",
    "regular:DEGREE": "",
    "small-world:K:P": "",
    "scale-free:M": "",
    "geometric:RADIUS": "",
    "directed:ring": "",
    "directed:random:P": "",
    "own": "the game's",
}
"""Kinds of graphs, with what needs to be told of them."""

GRAPHS_HELP = ", ".join(f"{kind} ({told})" if told else kind for kind, told in GRAPH_KINDS.items()) + (
    ", or edges such as 1-2,2-3:0.5 or, directed, 1>2,2>3,3>1; @COUNT after a random kind draws as many"
)
