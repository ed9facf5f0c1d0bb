"""Log times of tosses are found by their stamps, whatever lies between the two clocks."""

from contact_curation.storage.export.survey import Places, PoseTimes, Window, Windows

DAY = 86_400_000


def times_of(*stamps: int) -> PoseTimes:
    times = PoseTimes()
    for stamp_ns in stamps:
        times.note(stamp_ns, DAY + stamp_ns)
    return times


def test_windows_hold_both_of_their_ends_and_nothing_beside_them() -> None:
    windows = Windows([Window(50, 60), Window(10, 20)])
    assert [time for time in range(100) if windows.holds(time)] == [*range(10, 21), *range(50, 61)]
    assert not windows.over(60)
    assert windows.over(61)


def test_windows_that_overlap_are_one() -> None:
    windows = Windows([Window(10, 40), Window(20, 30), Window(35, 50)])
    assert all(windows.holds(time) for time in range(10, 51))
    assert not windows.holds(51)


def test_no_windows_hold_nothing_and_are_over_from_the_start() -> None:
    assert not Windows([]).holds(5)
    assert Windows([]).over(0)


def test_a_toss_is_found_by_its_stamps_with_as_much_around_it_as_is_wanted() -> None:
    times = times_of(*range(0, 1000, 10))
    places = times.places(300, 500, end=55)
    assert places == Places(30, 50)
    assert times.window(places) == Window(DAY + 300, DAY + 500)
    assert times.window(times.with_margins(places, 25, 40)) == Window(DAY + 280, DAY + 540)
    assert times.window(times.with_margins(places, 10_000, 10_000)) == Window(DAY, DAY + 990)


def test_of_a_clock_that_jumped_back_the_pass_is_taken_that_the_toss_came_out_of() -> None:
    times = times_of(*range(0, 600, 10), *range(0, 600, 10))
    first, second = times.places(300, 500, end=60), times.places(300, 500, end=len(times))
    assert (first, second) == (Places(30, 50), Places(90, 110))
    assert times.with_margins(second or Places(0, 0), 10_000, 10_000) == Places(60, 119)


def test_a_stray_stamp_within_a_toss_does_not_cut_it() -> None:
    assert times_of(0, 10, 20, 3, 30, 40, 50).places(10, 40, end=7) == Places(1, 5)


def test_a_stamp_that_nothing_was_recorded_with_is_not_found() -> None:
    assert times_of(500, 510).places(300, 400, end=2) is None
