"""ROS 2 nodes: a stage of the library each, plus translation of messages."""
