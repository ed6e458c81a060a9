"""What is asked: the configuration, checked and with its limits, as a list of points with their engines and costs.

Imports from filtration, packing, crystals and the ground.
"""
