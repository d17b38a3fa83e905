"""Ready-made trees, each with its scene."""
