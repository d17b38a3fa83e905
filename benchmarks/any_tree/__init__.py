"""Behaviour trees with any objects: what they are tried on."""
