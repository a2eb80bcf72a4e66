"""What navirl writes and reads back: demonstrations, rewards, metrics."""
