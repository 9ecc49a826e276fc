"""Runs `mog validate` on random games.

python -m tests.judge_random_games --sound 100 --unsound 20

Prints what was said of each game, and exits with 1 if a sound one "fails" or an unsound one "holds".
"""

import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path
from time import perf_counter

from mixed_order_game import GameError, Validation, Verdict, build_fmu, validate
from tests.random_games import UNSOUND, sound_game


def judge(text: str, folder: Path, **options: float) -> Validation | GameError:
    """What is said of a game; the refusal of one that cannot be built."""
    game = folder / "game.toml"
    game.write_text(text)
    try:
        fmu = build_fmu(game, folder / "game.fmu")
    except GameError as error:
        return error
    return validate(fmu, **options)  # type: ignore[arg-type]


def false_verdicts(validation: Validation | GameError, kind: str) -> list[str]:
    """Claims that a sound game, or one unsound in some way, should not have got as they are."""
    if kind == "sound":
        if isinstance(validation, GameError):
            return [str(validation)]
        return validation.named(Verdict.FAILS)
    if isinstance(validation, GameError):
        return []
    held = validation.named(Verdict.HOLDS)
    false = [name for name in held if name.startswith("practical_convergence_actions")]
    if kind == "unstable_loop":
        false += [name for name in held if name.startswith("theorem_2")]
    if kind == "concave_cost":
        false += [name for name in held if name == "nash_equilibrium"]
    return false


def main() -> int:
    """Judge them all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sound", type=int, default=100)
    parser.add_argument("--unsound", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    arguments = parser.parse_args()
    kinds = list(UNSOUND)
    cases = [("sound", seed) for seed in range(arguments.first, arguments.first + arguments.sound)]
    cases += [(kinds[seed % len(kinds)], seed) for seed in range(arguments.unsound)]
    counts: Counter[str] = Counter()
    wrong = 0
    with tempfile.TemporaryDirectory() as folder:
        for kind, seed in cases:
            begin = perf_counter()
            text = sound_game(seed) if kind == "sound" else UNSOUND[kind](seed)
            validation = judge(text, Path(folder))
            false = false_verdicts(validation, kind)
            wrong += bool(false)
            if isinstance(validation, GameError):
                told, verdict = str(validation), "refused"
            else:
                actions = next(c for c in validation.claims if c.name == "practical_convergence_actions")
                told, verdict = actions.reason, actions.verdict.value
                others = [name for name in validation.named(Verdict.FAILS) if name != actions.name]
                told += f" Fails: {', '.join(others)}." if others else ""
            counts[f"{kind}: {verdict}"] += 1
            mark = "FALSE " + ",".join(false) if false else ""
            print(f"{kind} {seed} {perf_counter() - begin:.1f} s {verdict}: {told} {mark}", flush=True)
    for name, count in sorted(counts.items()):
        print(f"{count:4d} {name}")
    print(f"{wrong} false verdicts")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
