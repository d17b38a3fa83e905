"""Post-process engines: from state and pictures to observations."""
