"""The stages of the graph without ROS, each restartable at any time."""
