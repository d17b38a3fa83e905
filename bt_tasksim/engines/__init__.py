"""The environment engine pipeline: kinematics, physics, rendering, post-process."""
