"""Builds a ROS interface package with pip, from the rosidl generators that the ros-* wheels install."""
