"""Imported by every Python process that finds this folder on its path: perturbed tests put it there."""

import os

import perturbation

perturbation.install_from(os.environ)
