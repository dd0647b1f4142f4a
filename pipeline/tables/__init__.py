"""Tables a shader can look up, and how they are looked up."""
