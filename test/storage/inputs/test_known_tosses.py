"""A whole toss takes the place of one that was rejected, whichever comes first; otherwise the first of an id stays."""

from itertools import permutations

from contact_curation.storage.inputs.known_tosses import DuplicateCheck, KnownTosses, LeftOut

SEEN = {"cut": ("a", "cut.mcap", False), "cut later": ("b", "later.mcap", False), "whole": ("c", "whole.mcap", True)}
"""By name: digest, recording, whether it is whole."""


def standings(*names: str) -> list[DuplicateCheck]:
    known = KnownTosses()
    return [known.see("7", digest, where, whole=whole) for digest, where, whole in (SEEN[name] for name in names)]


def test_the_cut_one_is_left_out_in_the_same_words_in_either_order() -> None:
    why = "toss 7 is left out: found it rejected here and accepted in whole.mcap, expected each once"
    left_out = LeftOut("cut.mcap", why)
    assert standings("cut", "whole") == [DuplicateCheck(True), DuplicateCheck(True, left_out)]
    assert standings("whole", "cut") == [DuplicateCheck(True), DuplicateCheck(False, left_out)]


def test_of_several_the_whole_one_is_taken_last_whatever_their_order() -> None:
    for names in permutations(SEEN):
        taken = [name for name, standing in zip(names, standings(*names)) if standing.taken]
        assert taken[-1] == "whole", names
        assert sum(standing.left_out is not None for standing in standings(*names)) == 2, names


def test_among_equals_the_first_stays() -> None:
    first, same, other = standings("cut", "cut", "cut later")
    assert (first.taken, same.taken, other.taken) == (True, False, False)
    assert same.left_out == LeftOut("cut.mcap", "toss 7 is left out: found the same one in cut.mcap, expected each once")
    assert other.left_out is not None
    assert other.left_out.where == "later.mcap"
    assert (
        "found another one of that id in cut.mcap, expected ids that tell tosses apart: header stamps, or names of .pt"
        in other.left_out.why
    )
