"""What everything else stands on: poses, the world at one instant, errors, files."""
