"""Physics engines: from joint targets to the state of the world."""
