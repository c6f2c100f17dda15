"""Options, arguments and tables that several commands share."""
