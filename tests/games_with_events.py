"""Random games in which events of all kinds meet: bounded controls, tight weights, waves, noise, switches."""

import numpy as np

DISTURBANCES = (
    "{a} * square(t, {p})",
    "{a} * square(t - {b}, {p})",
    "{a} * noise({n} + l, {b})",
    "{a} * pulse(t, {b}, {a})",
    "{a} * if(mod(t, {p}) < {b}, 1, -1)",
    "{a} * abs(sin({p} * t))",
    "{a} * floor(2 * t) * exp(-t)",
    "{a} * max(sin({p} * t), 0.2)",
)
DYNAMICS = (
    "0.5 * abs(x[i,l])",
    "0.3 * max(x[i,l], 0.1)",
    "-0.4 * x[i,l] * abs(x[i,l]) / (1 + x[i,l]^2)",
    "if(x[i,l] > {b}, 0.5, 0.2) * x[i,l]",
    "min(0.5 * x[i,1], x[mod(i, N) + 1,1])",
    "0.2 * floor(x[i,l])",
    "0.3 * sin(x[i,1])",
)


def game_with_events(seed: int) -> str:
    """Text of a game of 2 to 4 players in 1 or 2 coordinates."""
    random = np.random.default_rng([seed, 77])
    players = int(random.integers(2, 5))

    def decades(low: float, high: float) -> float:
        return float(f"{np.exp(random.uniform(np.log(low), np.log(high))):.3g}")

    def filled(text: str) -> str:
        return text.format(
            a=decades(0.1, 2.0),
            b=decades(0.1, 2.0),
            p=int(random.integers(1, 12)) / 10.0,
            n=int(random.integers(1, 99)),
        )

    lines = [
        'title = "Events"',
        f"dimension = {random.integers(1, 3)}",
        "[gains]",
        f"k1 = {decades(3, 30)}",
        f"k2 = {decades(0.3, 2)}",
        f"k3 = {decades(10, 100)}",
        f"k4 = {decades(5, 50)}",
        f"beta = {decades(1, 300)}",
        f"delta = {decades(0.5, 10)}",
        f"epsilon = {decades(0.01, 1)}",
        "[rbf]",
        "centers = [-1.0, 0.0, 1.0]",
        f"width = {decades(1, 5)}",
        f"W_max = {decades(0.05, 50)}",
        "[graph]",
        f"edges = {[[i, i + 1] for i in range(1, players)]}",
    ]
    for i in range(1, players + 1):
        waves = [filled(random.choice(DISTURBANCES)) for _ in range(random.integers(1, 4))]
        coupling = [[i % players + 1, decades(0.05, 0.5)]]
        lines += [
            "[[player]]",
            f'name = "player {i}"',
            f"order = {random.integers(1, 3)}",
            f"x0 = {random.choice([-1.0, 1.0]) * decades(0.2, 5)}",
            f"cost = {{ quadratic = {decades(0.5, 2)}, linear = {decades(0.1, 3)}, coupling = {coupling} }}",
            f'disturbance = {{ expression = "{" + ".join(waves)}" }}',
        ]
        if random.uniform() < 0.8:
            lines.append(f"u_max = {decades(2, 50)}")
        if random.uniform() < 0.7:
            lines.append(f'dynamics = {{ expression = "{filled(random.choice(DYNAMICS))}" }}')
    return "\n".join(lines) + "\n"
