"""A live run among programs of ROS: the same topics over rosbridge and as nodes of ROS 2."""
