"""Kinds of objects, one file each; what a kind says about itself is in `bt_tasksim.scene.shape_kind`."""
