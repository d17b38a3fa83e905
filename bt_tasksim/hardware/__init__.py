"""Real robots: safety, ROS 2, and a twin to try them on."""
