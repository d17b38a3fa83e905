"""Objects, scenes, robots, demonstrations and trained policies, as package data.

Open them with ``importlib.resources.files("assets")``: it finds them in a checkout and in an installed wheel.
"""
