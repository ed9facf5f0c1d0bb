"""docs/ros/reference.md says what the nodes and the messages are now."""

from test.docs.reference import PAGE, page


def test_the_reference_is_that_of_the_nodes_and_messages_as_they_are() -> None:
    assert PAGE.read_text() == page(), "write it anew with `python -m test.docs.reference`"
