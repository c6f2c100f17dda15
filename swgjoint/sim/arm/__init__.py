"""Arms: reading a file, holding joints, payloads, a scene around a bare arm."""
