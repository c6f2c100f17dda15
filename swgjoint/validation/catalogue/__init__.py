"""A family of drives compared with a catalogue."""
