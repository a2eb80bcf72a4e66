"""The Python door: what ``import navirl_cli as navirl`` offers. The rooms below do the work."""
