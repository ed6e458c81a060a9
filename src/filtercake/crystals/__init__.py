"""Where crystals come from: size distributions, as a user has them and as a crystallizer makes them.

Imports only from the ground (units, errors, user_files, statistics).
"""
