"""From a crystal size distribution to an accepted packing: cloud, settling, acceptance, and the engines."""
