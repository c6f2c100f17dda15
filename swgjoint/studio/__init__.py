"""Local web page on which a drive is designed and an arm is run."""
