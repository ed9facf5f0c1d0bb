"""Translation between ROS messages and the library's records, one file per message."""
