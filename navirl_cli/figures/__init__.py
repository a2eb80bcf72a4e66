"""Figures as a paper prints them: functions that draw on axes handed in; the only users of matplotlib."""
