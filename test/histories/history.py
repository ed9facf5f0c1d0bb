"""Random histories of a world: which steps come, and with which values, follows from a number; one that fails is shortened.

Hypothesis could do it, too, but its engine takes longer than the steps do.
"""

import gc
import os
import random
import secrets
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from typing import Any, NamedTuple

type Step = tuple[Any, ...]
"""The name of a method of the world, and its values."""
type History = tuple[Step, ...]
"""Its first step has the values that the world begins with."""

LEFT_OUT = 0.3
"""Share of the kinds of steps that do not come in a history: what others always prevent happens there."""


class Histories(NamedTuple):
    """What may happen to a world.

    Attributes:
        begin: makes the world, and gives back what it holds.
        first: what each of the values is chosen from that it begins with.
        steps: names of its methods, and what each of their values is chosen from.
        length: most steps of a history.
    """

    begin: Callable[..., AbstractContextManager[Any]]
    first: tuple[Sequence[Any], ...]
    steps: tuple[tuple[Any, ...], ...]
    length: int

    def history(self, number: int) -> History:
        """The same for the same number."""
        chance = random.Random(number)
        kinds = [kind for kind in self.steps if chance.random() > LEFT_OUT] or list(self.steps)
        chosen = [("begin", *self.first), *chance.choices(kinds, k=chance.randint(1, self.length))]
        return tuple((name, *map(chance.choice, choices)) for name, *choices in chosen)

    def play(self, history: History) -> None:
        """Raises what is wrong: at a step, or in the end, when the world is at rest."""
        first, *steps = history
        with self.begin(*first[1:]) as world:
            for name, *values in steps:
                getattr(world, name)(*values)
            world.finish()

    def fails(self, history: History) -> bool:
        """Whether anything is wrong."""
        try:
            self.play(history)
        except Exception:  # noqa: BLE001 - whatever it is, it is wrong
            return True
        return False

    def shortened(self, history: History) -> History:
        """One that fails, too, and needs each of its steps."""
        size = len(history) // 2
        while size:
            place = 1
            while place < len(history):
                without = history[:place] + history[place + size :]
                if self.fails(without):
                    history = without
                else:
                    place += size
            size //= 2
        return history


def try_histories(histories: Histories, variable: str, default: int) -> None:
    """Plays many histories.

    Args:
        histories: of what.
        variable: environment variable with their number; new ones each time.
        default: their number without it; always the same ones.

    Raises:
        AssertionError: one failed; its shortest form is in the message.
    """
    asked = os.environ.get(variable)
    begin = secrets.randbelow(1 << 40) if asked else 0
    gc.freeze()  # what is imported need not be searched for garbage again and again
    for number in range(begin, begin + int(asked or default)):
        history = histories.history(number)
        try:
            histories.play(history)
        except Exception as error:
            steps = "\n".join(f"    {step}," for step in histories.shortened(history))
            raise AssertionError(f"history {number} fails: {error!r}\n{steps}") from error
