"""What a selection of 8 tosses is worth on the recording that comes with the repository: the number in README.md.

The last six accepted tosses of bags/golden.mcap are held out. A polytope learns from 8 of the other 15, selected by the default
criterion or drawn at random ten times, and from all 15; each predicts the six.

python -m benchmarks.selection.golden_bag          about a minute
"""

from statistics import median

import contact_curation as cc

TOP, DRAWS, HELD_OUT = 8, 10, "14-20"


def errors(tosses: cc.Tosses, learned_from: cc.Tosses) -> tuple[float, float]:
    """Median errors on the held-out tosses: position [% of the width], rotation [degrees]."""
    model = cc.train(learned_from, protocol="exact")
    found = cc.evaluate(model, tosses, held_out=HELD_OUT).evaluations[0].errors
    return median(found.position), median(found.rotation)


def main() -> None:
    """Prints a line for each set."""
    tosses = cc.read("bags/golden.mcap")
    selected = cc.rank(tosses, top=TOP, held_out=HELD_OUT)
    pool = {toss.toss_id: toss for toss in tosses.accepted}
    everything = cc.Tosses.of([pool[toss_id] for toss_id in selected.ids], tosses.body)
    draws = [
        errors(tosses, cc.rank(tosses, top=TOP, held_out=HELD_OUT, criterion="random", seed=seed).selected)
        for seed in range(DRAWS)
    ]
    sets = {
        f"{TOP} selected by representative": errors(tosses, selected.selected),
        f"{TOP} at random, median of {DRAWS} draws": (median(one[0] for one in draws), median(one[1] for one in draws)),
        f"all {len(selected.ids)}": errors(tosses, everything),
    }
    for name, (position, rotation) in sets.items():
        print(f"{name:36} position {position:4.1f} % of the width, rotation {rotation:4.1f} degrees")


if __name__ == "__main__":
    main()
