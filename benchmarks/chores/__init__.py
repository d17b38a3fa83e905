"""Random chores over all concepts: one to three pieces of work in one scene, and their tree."""
