"""One packing: the scene that decides it, its cloud, the engines that settle it, and what makes it acceptable.

Porosity is measured here, too. Imports only from crystals and the ground.
"""
