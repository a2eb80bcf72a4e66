"""Scene, reward, soft values and visits, likelihood with its derivatives, fit, and paths from a policy."""
