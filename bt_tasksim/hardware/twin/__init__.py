"""A twin of a robot's cell: ROS 2 topics in front, MuJoCo physics behind.

The node (`node`) runs in a virtual environment of its own, with ROS 2 from wheels; `launch` starts it and a
bridge from this one.
"""
