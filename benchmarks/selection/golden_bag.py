"""What a selection of 8 tosses is worth on the recording that comes with the repository: the numbers in README.md.

The last six accepted tosses of bags/golden.mcap are held out. A polytope learns from 8 of the other 15, selected by the default
criterion or drawn at random, and from all 15; each predicts the six. A seed is that of the initial parameters and of the draw.

python -m benchmarks.selection.golden_bag          a minute or two
"""

from statistics import median

import contact_curation as cc

TOP, SEEDS, HELD_OUT = 8, 10, "14-20"

type Errors = tuple[float, float]


def errors(tosses: cc.Tosses, learned_from: cc.Tosses, seed: int) -> Errors:
    """Median errors on the held-out tosses: position [% of the width], rotation [degrees]."""
    model = cc.train(learned_from, protocol="exact", seed=seed)
    found = cc.evaluate(model, tosses, held_out=HELD_OUT).evaluations[0].errors
    return median(found.position), median(found.rotation)


def errors_of_seed(tosses: cc.Tosses, seed: int) -> dict[str, Errors]:
    """By what is learned from."""
    selected = cc.rank(tosses, top=TOP, held_out=HELD_OUT, seed=seed)
    drawn = cc.rank(tosses, top=TOP, held_out=HELD_OUT, criterion="random", seed=seed)
    pool = {toss.toss_id: toss for toss in tosses.accepted}
    sets = {
        f"{TOP} selected by representative": selected.selected,
        f"{TOP} at random": drawn.selected,
        f"all {len(selected.ids)}": cc.Tosses.of([pool[toss_id] for toss_id in selected.ids], tosses.body),
    }
    return {name: errors(tosses, each, seed) for name, each in sets.items()}


def main() -> None:
    """Prints a line for each set: medians over the seeds, and ranges."""
    tosses = cc.read("bags/golden.mcap")
    found = [errors_of_seed(tosses, seed) for seed in range(SEEDS)]
    for name in found[0]:
        said = []
        for kind, unit in enumerate(("% of the width", "degrees")):
            values = [one[name][kind] for one in found]
            said.append(f"{median(values):4.1f} ({min(values):.1f} to {max(values):.1f}) {unit}")
        print(f"{name:28} position {said[0]}, rotation {said[1]}")
    selected, drawn = list(found[0])[:2]
    better = [sum(one[selected][kind] < one[drawn][kind] for one in found) for kind in range(2)]
    print(f"selected better than drawn in {better[0]} and {better[1]} of {SEEDS} seeds")


if __name__ == "__main__":
    main()
