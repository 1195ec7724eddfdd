"""CANopen: the object dictionary `sw/canopen/objects.toml`, and C tables, EDS, DBC, accessors and page made from it."""
