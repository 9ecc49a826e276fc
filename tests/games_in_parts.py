"""Games of three players that are taken apart: plain, with own gains, with expressions, directed."""

HEAD = """
title = "Three players"
dimension = 2
[gains]
k1 = 8.0
k2 = 1.0
k3 = 30.0
k4 = 20.0
beta = 10.0
delta = 3.0
epsilon = 0.5
[rbf]
centers = [-1.0, 0.0, 1.0]
width = 4.0
W_max = 1000.0
[graph]
edges = [[1, 2], [2, 3, 0.5]]
"""
GAME = (
    HEAD
    + """
[[player]]
name = "alpha"
order = 1
x0 = [1.0, -2.0]
cost = { quadratic = 1.125, linear = 0.5, coupling = [[2, 0.25]] }
dynamics = { linear = [[3, 0.4375]], square = [[1, 0.05]] }
disturbance = { amplitude = 0.75, frequency = 2.0 }
[[player]]
name = "beta"
order = 2
x0 = [0.5, 1.5]
v0 = [0.1, -0.1]
cost = { quadratic = 0.8125, coupling = [[1, 0.25], [3, 0.5]] }
[[player]]
name = "gamma"
order = 2
x0 = [-1.0, 2.0]
cost = { quadratic = 1.0625, linear = [-1.0, 1.0] }
dynamics = { linear = [[3, 0.3125]] }
disturbance = { bias = 0.6875 }
"""
)
OWN_GAINS = GAME.replace('name = "beta"', 'name = "beta"\ngains = { k4 = 25.0, k3 = 40.0, delta = 2.0 }')
EXPRESSIONS = (
    HEAD
    + """
[parameters]
secret_price = 2.0
drag = 0.25
[defaults]
y0 = "x0"
[[player]]
name = "alpha"
order = 1
x0 = [1.0, -2.0]
cost = { quadratic = 1.0, expression = "0.125 * exp(-(x[i,1] - x[2,1])^2) * secret_price" }
dynamics = { expression = "0.5 * sin(x[3,l]) * v[2,l]" }
[[player]]
name = "beta"
order = 2
x0 = [0.5, 1.5]
cost = { quadratic = 1.5 }
dynamics = { expression = "-drag * v[i,l] + cos(x[1,l])" }
[[player]]
name = "gamma"
order = 2
x0 = [-1.0, 2.0]
cost = { quadratic = 1.0, coupling = [[1, 0.5]] }
"""
)
DIRECTED = GAME.replace(
    "edges = [[1, 2], [2, 3, 0.5]]", "directed = true\nedges = [[1, 2], [2, 3, 0.5], [3, 1]]"
)
GAMES = {"coefficients": GAME, "own gains": OWN_GAINS, "expressions": EXPRESSIONS, "directed": DIRECTED}
