"""A learnt reward for other programs: Nav2's costs and masks, logs for viewers, tables of parameters."""
