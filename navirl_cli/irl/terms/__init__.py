"""The reward is a sum of terms; each term stands in a file of its own."""
