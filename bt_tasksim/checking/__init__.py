"""What is wrong with a concept of one's own, told early: ``bt-tasksim check``."""
