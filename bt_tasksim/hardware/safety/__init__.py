"""Between a tree and a real robot: limits, checks, the guard, and a watchdog in a process of its own."""
