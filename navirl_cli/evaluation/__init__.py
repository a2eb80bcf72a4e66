"""How paths differ: metrics of demonstrated, learnt and baseline paths."""
