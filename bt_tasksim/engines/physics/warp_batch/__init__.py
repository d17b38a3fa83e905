"""MuJoCo Warp's worlds on a device, in groups of one structure; only its engine imports this, and Warp."""
