"""Permeability of a packing: Stokes flow solved through its pores, and what follows for the Kozeny constant.

Imports from packing, filtration and the ground.
"""
