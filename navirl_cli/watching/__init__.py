"""A folder of recordings that grows, and what is learnt from it so far."""
