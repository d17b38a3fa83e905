"""Rendering engines: from the state of the world to pictures."""
