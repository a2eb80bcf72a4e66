"""Figures for papers and screens: functions that draw solved values on given axes. Only this room uses matplotlib."""
