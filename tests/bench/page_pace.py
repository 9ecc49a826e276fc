"""How long the page of mog explore takes from a slider to the painted picture.

`python -m tests.bench.page_pace` on idle cores; the figures stand in explore.md.
"""

import numpy as np

from tests.chromium import chromium
from tests.explored import served_page
from tests.python.test_explore_page import Page

CHANGES = {"k1": np.geomspace(5.0, 20.0, 40), "epsilon": np.geomspace(0.01, 0.1, 30)}


def main() -> None:
    """Turn gains of the five vehicles one by one, in a headless Chromium."""
    with served_page("five_vehicles") as served, chromium() as browser:
        page = Page(browser, served)
        page.open()
        for name, values in CHANGES.items():
            page.script("performance.clearMeasures()")
            for value in values:
                page.turn(name, value)
            paces = page.script(
                "return performance.getEntriesByName('change to picture').map(each => each.duration)"
            )
            least, median, most, longest = np.quantile(paces, [0.0, 0.5, 0.9, 1.0])
            print(
                f"{name}: {len(paces)} changes, ms: least {least:.0f}, median {median:.0f}, "
                f"90 % below {most:.0f}, longest {longest:.0f}"
            )


if __name__ == "__main__":
    main()
