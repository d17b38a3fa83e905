"""Kinematics engines: from commands to joint targets."""
