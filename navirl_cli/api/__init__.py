"""The Python interface: the public names of ``import navirl_cli as navirl``."""
