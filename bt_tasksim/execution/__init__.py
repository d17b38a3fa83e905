"""A tree at work: the pipeline it runs on, the tick loop, the log of a run, and its replay."""
