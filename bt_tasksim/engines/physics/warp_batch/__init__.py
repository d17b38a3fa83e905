"""MuJoCo Warp's worlds: on a device, in groups of one structure. Imports Warp, so only its engine imports it."""
