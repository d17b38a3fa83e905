"""A real robot through rosbridge: ROS 2 topics in JSON over a WebSocket."""
